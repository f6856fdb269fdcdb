"""Joints of a serial chain, the bodies that they move, and what else moves the joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from edtk.robots.rotations import aligned
from edtk.system.typing import Array

AT_LIMIT = 1e-9  # [rad or m] beyond a limit: what a conversion of units leaves of a joint on it
# Axis; one that is shorter, or longer than its reciprocal, is a slip of the pen.
SHORTEST_AXIS = 1e-6
LONGEST_NAME = 64  # characters
# Signs that begin a comment in a table, or let a spreadsheet take it for one with semicolons.
REFUSED = ("#", ";")


@dataclass(frozen=True)
class Unit:
    """A unit of people, and how it relates to the SI unit that the program computes with.

    Attributes:
        name: As printed: "mm".
        per_si: How many of it are one SI unit: 1e3.
    """

    name: str
    per_si: float


METRE = Unit("m", 1.0)
MILLIMETRE = Unit("mm", 1e3)
DEGREE = Unit("deg", 180 / np.pi)


@dataclass(frozen=True, eq=False)
class Link:
    """The body that a joint moves, up to the next joint, as far as gravity knows it.

    Args:
        mass: Mass, zero for a body without weight [kg].
        center: Centre of mass (3,) in the frame of the joint that moves the body [m].

    Raises:
        ValueError: The mass is negative or no number, or the centre is no point.
    """

    mass: float
    center: Array

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise ValueError(f"the mass is {self.mass:g} kg; expected a number from 0 on")
        center = np.asarray(self.center, dtype=float)
        if center.shape != (3,) or not np.isfinite(center).all():
            raise ValueError("the centre of mass must be a point of three numbers")
        object.__setattr__(self, "mass", float(self.mass))
        object.__setattr__(self, "center", center)


Kind = Literal["revolute", "prismatic"]
UNITS: dict[Kind, str] = {"revolute": "deg", "prismatic": "mm"}  # of what people read
ONE_TURN = (-np.pi, np.pi)  # limits of a joint that has none [rad]
UNIT_LENGTH = 8 * np.finfo(float).eps  # rounding of the length of a vector that was normalised


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the chain, relative to the frame of the joint before.

    Args:
        name: Name, as used in studies and column headers.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame; normalised here.
        limits: Lower and upper limit of what a pose says of it [rad], or [m] for a prismatic joint:
            of its drive, where the joint is coupled to others.
        kind: "revolute" or "prismatic".
        continuous: A revolute joint that turns without end; its limits are `ONE_TURN`, within which
            its angle is written.

    Raises:
        ValueError: The name cannot head a column, the axis is zero, the limits are not in order or
            those of a continuous joint are not one turn, or the kind is unknown.
    """

    name: str
    origin: Array
    axis: Array
    limits: tuple[float, float]
    kind: Kind = "revolute"
    continuous: bool = False

    def __post_init__(self) -> None:
        _require_name(self.name)
        axis = np.asarray(self.axis, dtype=float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise ValueError(
                f"joint {self.name}: the axis must be a non-zero vector of three numbers"
            )
        length = float(np.linalg.norm(axis))
        if (
            not SHORTEST_AXIS <= length <= 1 / SHORTEST_AXIS
        ):  # the square of a smaller one underflows
            raise ValueError(
                f"joint {self.name}: the axis has the length {length:g}; expected about 1"
            )
        lower, upper = self.limits
        if not lower < upper:
            raise ValueError(f"joint {self.name}: the lower limit must lie below the upper one")
        if self.kind not in get_args(Kind):
            raise ValueError(
                f"joint {self.name}: kind must be 'revolute' or 'prismatic', not {self.kind!r}"
            )
        if self.continuous and (self.kind, self.limits) != ("revolute", ONE_TURN):
            raise ValueError(
                f"joint {self.name}: a continuous joint is revolute, and its limits are one turn"
            )
        # A second division could move the last digit: a joint that is written and read again
        # has to be the same one.
        if abs(length - 1.0) > UNIT_LENGTH:
            axis = axis / length
        object.__setattr__(self, "axis", axis)

    @cached_property
    def aligned(self) -> Array:
        """A rotation (3, 3) in the joint's frame whose third column is the axis."""
        return aligned(self.axis)


def _require_name(name: str) -> None:
    """Check that a name can head a column of a table.

    Raises:
        ValueError: It cannot; the message says what a name may be.
    """
    is_plain = name.isprintable() and not any(sign in name for sign in REFUSED)
    # A table's reader calls a column without a header so.
    is_own = name == name.strip() and not name.startswith("Unnamed:")
    if not (is_plain and is_own and 0 < len(name) <= LONGEST_NAME):
        raise ValueError(
            f"joint name {name!r}: expected 1 to {LONGEST_NAME} letters, digits, blanks and signs "
            f"but {' and '.join(REFUSED)}, without blanks at either end or 'Unnamed:'"
        )


Shares = tuple[tuple[str, float], ...]  # joints by name, and factors of their variables


@dataclass(frozen=True, eq=False)
class TiedJoint:
    """A joint of a chain whose variable is ``sum_m factor_m x_m + offset``.

    The tie is a mechanism: a joint that follows has no motor and no spring of its own, and the
    springs of its masters give way to what loads both.

    Args:
        name: Its name.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame.
        kind: "revolute" or "prismatic".
        place: Its index in the chain, in which joints that follow are counted too.
        follows: The joints that it follows, which follow none so, and its motion for one unit of
            each, not zero.
        offset: Its variable where those are zero [rad or m].

    Raises:
        ValueError: A factor is zero, or a number is none, or a joint is followed twice.
    """

    name: str
    origin: Array
    axis: Array
    kind: Kind
    place: int
    follows: Shares
    offset: float

    def __post_init__(self) -> None:
        for master, factor in self.follows:
            if not (np.isfinite(factor) and np.isfinite(self.offset) and factor):
                raise ValueError(
                    f"joint {self.name}: follows {master} with the factor {factor:g} and the "
                    f"offset {self.offset:g}; expected numbers, and a factor that is not zero"
                )
        if len(dict(self.follows)) < max(len(self.follows), 1):
            raise ValueError(f"joint {self.name}: expected each joint that it follows once")

    @property
    def masters(self) -> tuple[str, ...]:
        """Names of the joints that it follows."""
        return tuple(name for name, _ in self.follows)


@dataclass(frozen=True)
class Coupling:
    """A joint that its drive turns against a body before the one that carries the joint.

    A motor on the base that turns the forearm through a parallelogram, or one on the forearm whose
    shaft passes the joints of a hollow wrist: while the drive stands, joint j moves by ``factor``
    for each unit that joint m moves. With the drive's coordinate a_j, the variables of the joints
    are ``x_j = a_j + sum_m factor_m x_m``. The motor's torque and its spring belong to a_j, and so
    do the joint's limits and what a pose says of it.

    Args:
        joint: Name of the joint.
        follows: Name of the joint that moves it too.
        factor: By how much, not zero.
        limits: Limits of the joint's own variable x_j; None where those of the drives are all
            [rad].

    Raises:
        ValueError: A joint is coupled to itself, or a number is none.
    """

    joint: str
    follows: str
    factor: float
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.joint == self.follows:
            raise ValueError(f"joint {self.joint} is coupled to itself; expected another joint")
        if not (np.isfinite(self.factor) and self.factor):
            raise ValueError(
                f"joint {self.joint}: coupled to {self.follows} with the factor {self.factor:g}; "
                "expected a number that is not zero"
            )
        if self.limits is not None and not self.limits[0] < self.limits[1]:
            raise ValueError(
                f"joint {self.joint}: expected the lower limit of its own angle below the upper one"
            )


def variables_by_drives(joints: Sequence[Joint], couplings: Sequence[Coupling]) -> Array:
    """Variables of free joints by the coordinates of their drives (n, n): ``x = a + F x``.

    Without a circle F is nilpotent, and the inverse of I - F is the sum of its powers.

    Raises:
        ValueError: A coupling is of a joint that does not exist, does not turn or turns without
            end, or is there twice, or joints are coupled in a circle.
    """
    names = [joint.name for joint in joints]
    factors = np.zeros((len(names), len(names)))
    for one in couplings:
        for name in (one.joint, one.follows):
            _require_coupled(name, joints)
        if joints[names.index(one.follows)].continuous:
            raise ValueError(
                f"joint {one.follows} turns without end, and {one.joint} would with it; expected "
                f"limits for {one.follows}"
            )
        place = names.index(one.joint), names.index(one.follows)
        if factors[place]:
            raise ValueError(f"joint {one.joint} is coupled to {one.follows} twice")
        factors[place] = one.factor
    if np.linalg.matrix_power(factors != 0, len(names)).any():
        which = ", ".join(dict.fromkeys(one.joint for one in couplings))
        raise ValueError(f"joints are coupled in a circle, among {which}; expected none")
    powers = (np.linalg.matrix_power(factors, k) for k in range(len(names)))
    return sum(powers, np.zeros_like(factors))


def _require_coupled(name: str, joints: Sequence[Joint]) -> None:
    """Check that a joint can be coupled.

    Raises:
        ValueError: It is none of the free ones, or slides.
    """
    kinds = {joint.name: joint.kind for joint in joints}
    if name not in kinds:
        raise ValueError(f"no free joint {name!r}; this robot has {', '.join(kinds)}")
    if kinds[name] != "revolute":
        raise ValueError(f"joint {name} is {kinds[name]}; expected couplings of joints that turn")


@dataclass(frozen=True, eq=False)
class Ties:
    """The affine map ``x = P q + b`` from the drives q (n) to all joints x (N) of a chain.

    Derivatives by q are those by x, folded: ``dy/dq = P' dy/dx``. Arrays are component first.

    Attributes:
        matrix: P (N, n).
        offset: b (N,) [rad or m].
        free: Index of each free joint (n,) among all.
    """

    matrix: Array
    offset: Array
    free: list[int]

    def variables(self, q: Array) -> Array:
        """Variables x (N, ...) of all joints for those of the free ones (n, ...)."""
        lift = (slice(None),) + (None,) * (q.ndim - 1)
        return self.spread(q) + self.offset[lift]

    def spread(self, values: Array) -> Array:
        """P times values (n, ...) of the free joints: values (N, ...) of all."""
        return np.tensordot(self.matrix, values, axes=1)

    def fold(self, values: Array) -> Array:
        """P' times values (N, ...) of all joints: values (n, ...) of the free ones."""
        return np.tensordot(self.matrix.T, values, axes=1)

    def fold_sizes(self, sizes: Array) -> Array:
        """Bounds (n, ...) on folded values, of bounds (N or 1, ...) on the values."""
        every = np.broadcast_to(sizes, (len(self.matrix), *sizes.shape[1:]))
        return np.tensordot(np.abs(self.matrix.T), every, axes=1)
