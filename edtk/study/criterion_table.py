"""A criterion with its parameters, as a study's key `criterion`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

# Numbers of compliances, which a person names by joint: {q2 = 1, q3 = -1}.
BY_JOINT = ("c",)
LISTED = ("interest",)  # compliances that a person lists: ["q2", "q3"]


class CriterionTable(BaseModel):
    """The criterion that the study is about, with the parameters that it needs."""

    # Parameters are those of the criterion, which plug-ins extend; the criterion checks them.
    model_config = ConfigDict(extra="allow", frozen=True)

    name: str = Field(description="Name of the criterion, see `edtk criteria`")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, given: Any) -> Any:
        """A name stands for a table that holds nothing else."""
        if isinstance(given, str):
            return {"name": given}
        if not isinstance(given, Mapping | CriterionTable):
            raise PydanticCustomError("criterion", "expected a name, or a table with a name")
        return given

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters as they are written."""
        return dict(self.model_extra or {})

    def build(self, unknown: Sequence[str]) -> dict[str, Any]:
        """The parameters as `criteria.create` takes them.

        Args:
            unknown: Names (p,) of the joints whose compliances are unknown.

        Raises:
            ValueError: A joint is not among them; the line names it.
        """
        return _built(self.parameters, unknown)


def _built(parameters: Mapping[str, Any], unknown: Sequence[str]) -> dict[str, Any]:
    """Parameters with arrays in place of names of joints, those of parts included."""
    found = dict(parameters)
    for key in BY_JOINT:
        if isinstance(found.get(key), Mapping):
            factors = found[key]
            _require_unknown(factors, unknown)
            found[key] = [factors.get(name, 0.0) for name in unknown]
    for key in LISTED:
        names = found.get(key)
        if isinstance(names, Sequence) and all(isinstance(name, str) for name in names):
            _require_unknown(names, unknown)
            found[key] = np.array([[float(each == name) for name in names] for each in unknown])
    if isinstance(found.get("criteria"), Sequence):
        found["criteria"] = [
            _built(part, unknown) if isinstance(part, Mapping) else part
            for part in found["criteria"]
        ]
    return found


def _require_unknown(names: Any, unknown: Sequence[str]) -> None:
    for name in names:
        if name not in unknown:
            raise ValueError(f"{name!r} is no unknown joint; expected {', '.join(unknown)}")
