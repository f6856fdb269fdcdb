"""What a calibration of geometry and springs asks for, as a study's table `parameters`."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from edtk.study.listed import listed
from edtk.study.table import Table


def _all_or_listed(value: object) -> object:
    """The word "all", or a list of names; other values are rejected here, in one line."""
    named = [value] if isinstance(value, str) else value
    if not isinstance(named, list | tuple) or not all(isinstance(one, str) for one in named):
        raise PydanticCustomError("geometry", "expected 'all', or a list of names")
    return value if value == "all" else tuple(named)


class ParametersTable(Table):
    """The unknowns of a calibration by absolute positions: geometry, base, tools and springs.

    What cannot be told apart is found, and a minimal set is kept.
    """

    compliance: Annotated[tuple[str, ...], BeforeValidator(listed)] | None = Field(
        None,
        description="Joints whose compliances are unknown [1e-6 rad/(N m)]; defaults to "
        "`joints.unknown`, or none",
    )
    geometry: Annotated[
        Literal["all"] | tuple[str, ...],
        Field(union_mode="left_to_right"),
        BeforeValidator(_all_or_listed),
    ] = Field(
        "all",
        description="'all', or a list of joints ('q2': the six errors of the frame before it), "
        "of kinds ('zeros', 'lengths', 'tilts') and of single errors ('q2.rx') [mm, mrad]",
    )
    base: bool = Field(
        True, description="Whether the place of the robot in the instrument's frame is unknown"
    )
    tool: bool = Field(True, description="Whether the places of the markers on the tool are")
