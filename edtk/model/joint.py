"""One joint of a serial chain."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from edtk.model.aligned import aligned
from edtk.system.typing import Array

Kind = Literal["revolute", "prismatic"]
SHORTEST = 1e-6  # axis; one that is shorter, or longer than its reciprocal, is a slip of the pen
ONE_TURN = (-np.pi, np.pi)  # limits of a joint that has none [rad]
LONGEST_NAME = 64  # characters
# Signs that begin a comment in a table, or let a spreadsheet take it for one with semicolons.
REFUSED = ("#", ";")
UNIT_LENGTH = 8 * np.finfo(float).eps  # rounding of the length of a vector that was normalised


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the chain, relative to the frame of the joint before.

    Args:
        name: Name, as used in studies and column headers.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame; normalised here.
        limits: Lower and upper limit [rad], or [m] for a prismatic joint.
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
        if not SHORTEST <= length <= 1 / SHORTEST:  # the square of a smaller one underflows
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
