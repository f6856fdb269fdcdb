"""The loads that a calibration experiment may apply, as the keys of a study's table `load`."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from edtk.model.loads.bounded_load import BoundedLoad
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.free_load import FreeLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.model.loads.load import Load
from edtk.study.table import Positive, Table
from edtk.system.finite import ZERO, Vector3


class LoadChoice(Table):
    """Loads of a calibration experiment: one fixed, one of a list, or any up to a largest force.

    Exactly one of `F_N`, `F_max_N` and `list_F_N` is given.
    """

    F_N: Vector3 | None = Field(
        None, description="Force of every experiment, in world axes at the tool point [N]"
    )
    T_Nm: Vector3 = Field(
        ZERO, description="Torque of every experiment, in world axes; goes with F_N only [N m]"
    )
    F_max_N: Positive | None = Field(
        None, description="Largest force; each experiment chooses its own up to this size [N]"
    )
    direction: Vector3 | None = Field(
        None,
        description="Direction of the force in world axes, of any length; goes with F_max_N only, "
        "without it the force may point anywhere [-]",
    )
    list_F_N: Annotated[tuple[Vector3, ...], Field(min_length=1)] | None = Field(
        None, description="Forces of which each experiment takes one, in world axes [N]"
    )

    at_mm: Vector3 = Field(
        ZERO,
        description="Where the load acts: offset from the tool point, in the tool frame [mm]",
    )

    @model_validator(mode="after")
    def _one_of_them(self) -> "LoadChoice":
        given = [key for key in ("F_N", "F_max_N", "list_F_N") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError("load", "expected one of F_N, F_max_N and list_F_N")
        if any(self.T_Nm) and self.F_N is None:
            raise PydanticCustomError("load", "T_Nm goes with F_N only")
        if self.direction is not None and (self.F_max_N is None or not any(self.direction)):
            raise PydanticCustomError("load", "direction goes with F_max_N, and is not zero")
        return self

    def build(self) -> Load:
        """The family of wrenches [N, N m]."""
        if self.F_N is not None:
            return FixedLoad(np.array([*self.F_N, *self.T_Nm]))
        if self.list_F_N is not None:
            return ListedLoad(np.array([[*F, 0, 0, 0] for F in self.list_F_N], dtype=float))
        assert self.F_max_N is not None
        if self.direction is None:
            return FreeLoad(self.F_max_N)
        unit = np.array(self.direction) / np.linalg.norm(self.direction)
        return BoundedLoad(np.append(self.F_max_N * unit, np.zeros(3)))

    def describe(self) -> str:
        """The loads in words, for reports."""
        where = f" at {_words(self.at_mm)} mm from the tool point" if any(self.at_mm) else ""
        return f"{self._forces()}{where}"

    def _forces(self) -> str:
        """The forces in words."""
        if self.F_N is not None:
            return f"load F = {_words(self.F_N)} N"
        if self.list_F_N is not None:
            return f"loads {' or '.join(map(_words, self.list_F_N))} N"
        if self.direction is None:
            return f"any force up to {self.F_max_N:g} N"
        return f"up to {self.F_max_N:g} N along {_words(self.direction)}"


def _words(vector: Vector3) -> str:
    """A vector as a person writes it."""
    return f"({', '.join(f'{component:g}' for component in vector)})"
