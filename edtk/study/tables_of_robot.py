"""Tables of a study about its robot: joints, loads, workspace and parameters."""

from typing import Annotated, Literal

import numpy as np
from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError, PydanticKnownError

from edtk.robots.constraints.constraint import Constraint
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.radius import Radius
from edtk.robots.constraints.tilt import Tilt
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.loads.load import Load
from edtk.system.fields import (
    ZERO,
    Compliance,
    Finite,
    NotNegative,
    Positive,
    Table,
    Vector3,
    listed,
)

# Relative standard deviation of a known compliance that comes without one: catalogues state the
# stiffness of gears at rated torque alone, and leave bearings and links out.
KNOWN_WITHIN = 0.3
NO_SPRINGS = "no springs"  # of the context of a validation: whether all joints may be rigid


class KnownCompliance(Table):
    """A compliance that a maker or an earlier calibration tells."""

    value: Compliance = Field(description="The compliance [rad/(N m)]")
    std: Annotated[Finite, Field(ge=0, le=1e3)] | None = Field(
        None, description="Its standard deviation; defaults to 30 % of the value [rad/(N m)]"
    )

    @property
    def deviation(self) -> float:
        """The standard deviation [rad/(N m)]."""
        return KNOWN_WITHIN * self.value if self.std is None else self.std


def _form(given: object) -> str:
    """Whether a known compliance is a table or a number."""
    return ":table" if isinstance(given, dict | KnownCompliance) else ":number"


Known = Annotated[
    Annotated[Compliance, Tag(":number")] | Annotated[KnownCompliance, Tag(":table")],
    Discriminator(_form),
]


class JointsTable(Table):
    """Joints whose compliances are unknown or known, and joints that do not move."""

    unknown: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        description="Names of the joints whose compliances are identified"
    )
    known_rad_per_Nm: dict[str, Known] = Field(
        {},
        description="Compliances that are known, by joint; none of them is among `unknown`: a "
        "number, or `{ value = 3e-7, std = 1e-7 }` [rad/(N m)]",
    )
    fixed_deg: dict[str, Finite] = Field(
        {}, description="Angles of revolute joints that stay where they are, by joint [deg]"
    )
    fixed_mm: dict[str, Finite] = Field(
        {}, description="Positions of prismatic joints that stay where they are, by joint [mm]"
    )
    limits_deg: dict[str, tuple[Finite, Finite]] = Field(
        {},
        description="Lower and upper limits of revolute joints, by joint, in place of the robot's "
        "own, which a URDF may leave open; in the angles of its file [deg]",
    )
    limits_mm: dict[str, tuple[Finite, Finite]] = Field(
        {}, description="The same of prismatic joints [mm]"
    )

    margin_deg: NotNegative = Field(
        0.0,
        description="How far plans keep revolute joints away from their limits, at which "
        "controllers stop; poses that were measured may be nearer [deg]",
    )
    margin_mm: NotNegative = Field(0.0, description="The same of prismatic joints [mm]")

    @field_validator("unknown")
    @classmethod
    def _some(cls, given: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        """One at least, unless the study is about geometry too."""
        if not given and not (info.context or {}).get(NO_SPRINGS):
            at_least = {"field_type": "Tuple", "min_length": 1, "actual_length": 0}
            raise PydanticKnownError("too_short", at_least)
        return given

    @field_validator("limits_deg", "limits_mm")
    @classmethod
    def _in_order(cls, given: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for name, (low, high) in given.items():
            if not low < high:
                message = "{name}: expected the lower limit before the upper one"
                raise PydanticCustomError("limits", message, {"name": name})
        return given

    def margin(self) -> dict[str, float]:
        """How far plans keep away from limits, by kind of joint [rad, m]."""
        return {"revolute": float(np.deg2rad(self.margin_deg)), "prismatic": self.margin_mm / 1e3}

    @property
    def known(self) -> dict[str, KnownCompliance]:
        """The known compliances with their standard deviations, by joint."""
        return {
            name: one if isinstance(one, KnownCompliance) else KnownCompliance(value=one, std=None)
            for name, one in self.known_rad_per_Nm.items()
        }

    def known_in_words(self, plus_minus: str = "+-") -> str:
        """The known compliances with their standard deviations, for people; empty without any."""
        return ", ".join(
            f"{name} {one.value:g} {plus_minus} {one.deviation:g} rad/(N m)"
            for name, one in self.known.items()
        )

    def limits(self) -> dict[str, tuple[float, float]]:
        """The limits that take the place of the robot's own, by joint [rad or m]."""
        angles = {name: np.deg2rad(pair).tolist() for name, pair in self.limits_deg.items()}
        lengths = {name: [x / 1e3 for x in pair] for name, pair in self.limits_mm.items()}
        return {name: (low, high) for name, (low, high) in (angles | lengths).items()}


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

    list_at_mm: Annotated[tuple[Vector3, ...], Field(min_length=1)] | None = Field(
        None,
        description="Where each of list_F_N acts, in the place of at_mm: offsets from the tool "
        "point, in the tool frame [mm]",
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
        if self.list_at_mm is not None:
            if self.list_F_N is None or len(self.list_at_mm) != len(self.list_F_N):
                raise PydanticCustomError("load", "list_at_mm needs a place for each of list_F_N")
            if any(self.at_mm):
                raise PydanticCustomError("load", "expected one of at_mm and list_at_mm")
        if self.direction is not None and (self.F_max_N is None or not any(self.direction)):
            raise PydanticCustomError("load", "direction goes with F_max_N, and is not zero")
        return self

    def build(self) -> Load:
        """The family of wrenches [N, N m]."""
        if self.F_N is not None:
            return FixedLoad(np.array([*self.F_N, *self.T_Nm]))
        if self.list_F_N is not None:
            wrenches = np.array([[*F, 0, 0, 0] for F in self.list_F_N], dtype=float)
            if self.list_at_mm is None:
                return ListedLoad(wrenches)
            return ListedLoad(np.hstack([wrenches, np.array(self.list_at_mm, dtype=float) / 1e3]))
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
        if self.list_F_N is not None and self.list_at_mm is not None:
            pairs = zip(self.list_F_N, self.list_at_mm, strict=True)
            loads = (f"{_words(F)} N at {_words(at)} mm" for F, at in pairs)
            return f"loads {' or '.join(loads)} from the tool point"
        if self.list_F_N is not None:
            return f"loads {' or '.join(map(_words, self.list_F_N))} N"
        if self.direction is None:
            return f"any force up to {self.F_max_N:g} N"
        return f"up to {self.F_max_N:g} N along {_words(self.direction)}"


def _words(vector: Vector3) -> str:
    """A vector as a person writes it."""
    return f"({', '.join(f'{component:g}' for component in vector)})"


class WorkspaceTable(Table):
    """Constraints on the calibration poses, besides the joint limits."""

    height_min_mm: Finite | None = Field(
        None, description="Least height of the tool point above the world's origin [mm]"
    )
    radius_min_mm: Positive | None = Field(
        None, description="Least distance of the tool point from the world's z-axis [mm]"
    )
    tilt_max_deg: Annotated[Positive, Field(le=90)] | None = Field(
        None, description="Largest angle of the tool's z-axis to the horizontal plane [deg]"
    )
    plan_resolution_deg: Annotated[Finite, Field(ge=0)] = Field(
        0.0, description="Rounding of plans that are read: a pose is feasible within it [deg]"
    )
    excluded: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="Plan (CSV), or list of plans, of poses that plans keep away from; paths "
        "beside the study",
    )
    excluded_within_deg: Positive = Field(
        5.0,
        description="Least distance from each excluded pose, Euclidean over the revolute joints "
        "[deg]",
    )

    def build(self) -> tuple[Constraint, ...]:
        """The constraints that are given [m, rad]; excluded poses are no part of them."""
        found: list[Constraint] = []
        if self.height_min_mm is not None:
            found.append(Height(self.height_min_mm / 1e3))
        if self.radius_min_mm is not None:
            found.append(Radius(self.radius_min_mm / 1e3))
        if self.tilt_max_deg is not None:
            found.append(Tilt(float(np.deg2rad(self.tilt_max_deg))))
        return tuple(found)


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
    springs: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="Springs that are unknown: 'joints' (the compliances of all joints), 'lateral' "
        "(the turns across each joint too), 'all' (the 6 x 6 matrix of the frame before each "
        "joint), or a list of these, of joints ('q2'), of axes of the frame before a joint "
        "('q3.rx', 'q3.z'), of entries off the diagonal ('q3.rx.z'), of laws ('q2.square', "
        "'q2.cubic', 'q2.sign', 'q2.gap'), and of all of a joint ('q3.lateral', 'q3.all')",
    )
    compensators: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="Numbers of compensators that are unknown, as changes of what the robot's file "
        "states: stiffness and preload of those at some joints ('q2'), or 'q2.stiffness' [N/mm], "
        "'q2.preload' [kN], 'q2.anchor1', 'q2.anchor2.x' [mm], 'q2.all'; a second one at a joint "
        "is 'q2:2'",
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
