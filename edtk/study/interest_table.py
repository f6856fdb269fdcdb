"""Which compliances a calibration is about, as a study's table `interest`."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from edtk.study.listed import listed
from edtk.study.table import Table
from edtk.system.finite import Finite
from edtk.system.typing import Array


class InterestTable(Table):
    """The compliances that criteria are about; the others are unknown too, but do no harm."""

    joints: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (), description="Joints whose compliances are of interest; each is one of `joints.unknown`"
    )
    combinations: tuple[dict[str, Finite], ...] = Field(
        (),
        description="Linear combinations of compliances that are of interest, each as factors by "
        "joint: `[{ q2 = 1, q3 = -1 }]` for the difference of two [-]",
    )

    parameters: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="For a study with `parameters`, which of them are of interest: 'geometry', "
        "'compliance', 'base', 'tool', joints ('q2': the six errors of the frame before it), kinds "
        "('zeros', 'lengths', 'tilts') or single ones ('q2.rx', 'k_q2')",
    )

    @model_validator(mode="after")
    def _something(self) -> "InterestTable":
        if not self.joints and not self.combinations and not self.parameters:
            raise PydanticCustomError("interest", "expected joints or combinations")
        return self

    def build(self, unknown: Sequence[str]) -> Array:
        """Combinations K (p, s), one a column: those of single joints first.

        Args:
            unknown: Names (p,) of the joints whose compliances are unknown.
        """
        factors = [*({name: 1.0} for name in self.joints), *self.combinations]
        return np.array([[each.get(name, 0.0) for each in factors] for name in unknown])
