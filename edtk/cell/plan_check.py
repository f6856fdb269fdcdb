"""Whether the poses of a plan are free, each with the two bodies that are nearest."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.cell.cell import Cell, Clearance
from edtk.cell.sight import Sight
from edtk.cell.ways import DrivenWay
from edtk.system.presented import Presented
from edtk.system.typing import Array

MM = 1e3


@dataclass(frozen=True, eq=False)
class PlanCheck(Presented):
    """The poses of a plan in a cell.

    Attributes:
        cell: The cell.
        q: The poses (k, n), in the order of the plan [rad or m].
        ways: How the arm gets from row to row; none where nobody asked.
        sight: Which markers are read; None where all are.
    """

    cell: Cell
    q: Array
    ways: tuple[DrivenWay, ...] = ()
    sight: Sight | None = None

    @cached_property
    def clearance(self) -> Clearance:
        """How free each pose (k,) is."""
        return self.cell.clearance(self.q)

    @cached_property
    def hidden(self) -> list[dict[str, str]]:
        """Why markers are not read, by pose and name; the tool point where it has none."""
        if self.sight is None:
            return [{} for _ in self.q]
        names = ["" if one is None else one.name or "tool point" for one in self.sight.reflectors]
        return [
            {name: str(why) for name, why in zip(names, row, strict=True) if why is not None}
            for row in self.sight.hidden(self.q)
        ]

    @property
    def free(self) -> bool:
        """Whether nothing touches, and all ways are free."""
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
        """How many poses touch, or that all are free."""
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
        """For JSON: whether all is free, and how much room each pose leaves beyond the margin."""
        least = self.clearance.least
        return {
            "free": self.free,
            "margin_mm": self.cell.margin * MM,
            "poses": [
                {
                    "clearance_mm": float(room) * MM if np.isfinite(room) else None,
                    "pair": list(self.clearance.names(i) or ()) or None,
                    **({} if self.sight is None else {"hidden": self.hidden[i]}),
                }
                for i, room in enumerate(least)
            ],
            "legs": [self._way(one) for one in self.ways],
        }

    def _way(self, one: DrivenWay) -> dict[str, Any]:
        """A way for JSON: rows count from 1, home is null; angles are those of the controller."""
        start, end = (None if row is None else row + 1 for row in one.rows)
        robot = self.cell.robot
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
