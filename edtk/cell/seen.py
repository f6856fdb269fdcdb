"""Which markers are read in the poses of a plan, and why the others are not."""

from dataclasses import dataclass
from functools import cached_property

from edtk.cell.sight import Sight
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

    def to_dict(self, pose: int) -> dict[str, object]:
        """For JSON: the markers that are read in a pose, and why the others are not."""
        return {"read": self.read[pose], "hidden": self.hidden[pose]}
