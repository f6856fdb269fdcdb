"""Whether the poses of a plan are free, each with the two bodies that are nearest."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.cell.cell import Cell, Clearance
from edtk.system.presented import Presented
from edtk.system.typing import Array

MM = 1e3


@dataclass(frozen=True, eq=False)
class PlanCheck(Presented):
    """The poses of a plan in a cell.

    Attributes:
        cell: The cell.
        q: The poses (k, n), in the order of the plan [rad or m].
    """

    cell: Cell
    q: Array

    @cached_property
    def clearance(self) -> Clearance:
        """How free each pose (k,) is."""
        return self.cell.clearance(self.q)

    @property
    def free(self) -> bool:
        """Whether nothing touches."""
        return bool(self.clearance.free.all())

    @property
    def nearest(self) -> int:
        """Index of the pose with the least clearance."""
        return int(np.argmin(self.clearance.least))

    def headline(self) -> str:
        """How many poses touch, or that all are free."""
        touching = int((~self.clearance.free).sum())
        if not touching:
            return f"all {len(self.q)} poses are free"
        return f"{touching} of {len(self.q)} poses touch{'es' if len(self.q) == 1 else ''}"

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
                }
                for i, room in enumerate(least)
            ],
            "legs": [],
        }
