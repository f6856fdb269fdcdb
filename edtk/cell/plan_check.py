"""Whether the poses of a plan are free and seen: what is nearest in each, and what is hidden."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.cell.cell import Cell, Clearance
from edtk.cell.seen import Seen
from edtk.cell.ways import DrivenWay
from edtk.robots.robot import Robot
from edtk.system.presented import Presented
from edtk.system.typing import Array

MM = 1e3


@dataclass(frozen=True, eq=False)
class PlanCheck(Presented):
    """The poses of a plan in a cell, before an instrument, or both.

    Attributes:
        cell: The cell; None where nothing is known of what stands around the robot.
        q: The poses (k, n), in the order of the plan [rad or m].
        ways: How the arm gets from row to row; none where nobody asked.
        seen: Which markers are read; None where all are.
    """

    cell: Cell | None
    q: Array
    ways: tuple[DrivenWay, ...] = ()
    seen: Seen | None = None

    @cached_property
    def clearance(self) -> Clearance:
        """How free each pose (k,) is."""
        if self.cell is None:
            none = len(self.q)
            return Clearance(np.full(none, np.inf), np.zeros(none, dtype=int), ())
        return self.cell.clearance(self.q)

    @property
    def free(self) -> bool:
        """Whether nothing touches, as far as there is a cell, and all ways are free."""
        return bool(self.clearance.free.all()) and not self.blocked

    @property
    def blocked(self) -> int:
        """Number of legs in whose place no free way was found."""
        return sum(one.way is None for one in self.ways)

    @property
    def nearest(self) -> int:
        """Index of the pose with the least clearance."""
        return int(np.argmin(self.clearance.least))

    def headline(self) -> str:
        """How many poses touch, or that all are free; how many markers are read."""
        freedom = () if self.cell is None else (self._freedom(),)
        sight = () if self.seen is None else (self.seen.headline(),)
        return "; ".join((*freedom, *sight))

    def _freedom(self) -> str:
        """How many poses and ways touch, or that all are free."""
        touching = int((~self.clearance.free).sum())
        poses = f"all {len(self.q)} poses are free"
        if touching:
            poses = f"{touching} of {len(self.q)} poses touch{'es' if len(self.q) == 1 else ''}"
        if not self.ways:
            return poses
        if not self.blocked:
            return f"{poses}, and all {len(self.ways)} ways between them"
        return f"{poses}, and {self.blocked} of {len(self.ways)} ways between them are not free"

    def to_dict(self) -> dict[str, Any]:
        """For JSON: whether all is free, how much room each pose leaves, and what is seen.

        The room is beyond the margin. Without a cell nobody knows whether all is free: null.
        """
        least = self.clearance.least
        return {
            "free": None if self.cell is None else self.free,
            "margin_mm": None if self.cell is None else self.cell.margin * MM,
            "poses": [
                {
                    "clearance_mm": float(room) * MM if np.isfinite(room) else None,
                    "pair": list(self.clearance.names(i) or ()) or None,
                    **({} if self.seen is None else self.seen.to_dict(i)),
                }
                for i, room in enumerate(least)
            ],
            "legs": [] if self.cell is None else [_way(self.cell.robot, one) for one in self.ways],
        }


def _way(robot: Robot, one: DrivenWay) -> dict[str, Any]:
    """A way for JSON: rows count from 1, home is null; angles are those of the controller."""
    start, end = (None if row is None else row + 1 for row in one.rows)
    leg = one.nearest
    via = np.zeros((0, robot.n)) if one.way is None else one.way.via
    return {
        "from": start,
        "to": end,
        "free": one.way is not None,
        "direct": one.direct.verdict,
        "via_deg": (robot.shown(via) / robot.units).tolist(),
        "clearance_mm": leg.clearance * MM if np.isfinite(leg.clearance) else None,
        "pair": list(leg.pair or ()) or None,
        "t": leg.t,
        "seconds": None if one.way is None else one.way.seconds,
    }
