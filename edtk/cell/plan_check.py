"""Whether the poses of a plan are free and seen: what is nearest in each, and what is hidden."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.cell.cell import Cell, Clearance
from edtk.cell.sight import Sight
from edtk.cell.ways import DrivenWay
from edtk.robots.frames import MM
from edtk.robots.robot import Robot
from edtk.system.presented import Presented
from edtk.system.typing import Array

ALL = "all markers"  # what is read in a pose that hides none


@dataclass(frozen=True, eq=False)
class Seen:
    """What the instruments read in some poses.

    Attributes:
        sight: Eyes and markers.
        q: The poses (k, n) [rad or m].
    """

    sight: Sight
    q: Array

    @cached_property
    def markers(self) -> tuple[str, ...]:
        """Names of the markers that need a line of sight; the tool point where it has none."""
        return tuple(one.name or "tool point" for one in self.sight.seeable)

    @cached_property
    def hidden(self) -> list[dict[str, str]]:
        """Why markers are not read, by pose and name."""
        seeable = [i for i, one in enumerate(self.sight.reflectors) if one is not None]
        return [
            {
                name: str(row[i])
                for name, i in zip(self.markers, seeable, strict=True)
                if row[i] is not None
            }
            for row in self.sight.hidden(self.q)
        ]

    @property
    def read(self) -> list[list[str]]:
        """Names of the markers that are read, by pose."""
        return [[name for name in self.markers if name not in row] for row in self.hidden]

    def headline(self) -> str:
        """How many of the markers are read, one in each pose counted as one."""
        poses = f"{len(self.q)} pose{'s' if len(self.q) > 1 else ''}"
        every = len(self.markers) * len(self.q)
        read = every - sum(map(len, self.hidden))
        if read == every:
            return f"{ALL} in {poses}"
        return f"a marker is read {read} times of {every} in {poses}"

    def words(self, pose: int) -> str:
        """What hides which marker in a pose."""
        return "; ".join(f"{name} {why}" for name, why in self.hidden[pose].items()) or ALL

    def hiding(self) -> list[str]:
        """A line for each pose that hides some; rows count from 1."""
        return [f"row {i + 1}: {self.words(i)}" for i, row in enumerate(self.hidden) if row]

    def to_dict(self, pose: int) -> dict[str, object]:
        """For JSON: the markers that are read in a pose, and why the others are not."""
        return {"read": self.read[pose], "hidden": self.hidden[pose]}


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
