"""How a controller counts the joints, as measured positions tell it."""

from dataclasses import dataclass
from typing import Any

from edtk.inference.controller_search.counted import Counted
from edtk.system.presented import Presented
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class FoundController(Presented):
    """The way to count that fits measured positions best, and how sure it is.

    Attributes:
        robot: Name of the robot.
        best: Signs, zeros and coupling.
        zero_std: Standard deviations (n,) of the zeros, from what the fit leaves [deg, mm].
        untold: What else would have to be known for a joint's zero, by joint.
        same: Other ways to count that describe the same arm, which no such measurement tells apart.
        second: The best of all other ways; None if there is no other.
        others: Ways that fit nearly as well as the best one.
        clear: Whether no other way comes near.
        poses: Number of poses.
        coordinates: Number of measured coordinates, the mean of repetitions counted once.
        unknowns: Number of fitted numbers.
        markers: Names of the markers.
        marker: Their places (k, 3) in the flange's frame [m].
        base: Pose (4, 4) of the robot's base in the instrument's frame [m].
        far_off: Whether even the best way leaves more than such an arm can be wrong by.
    """

    robot: str
    best: Counted
    zero_std: Array
    untold: dict[str, str]
    same: tuple[Counted, ...]
    second: Counted | None
    others: tuple[Counted, ...]
    clear: bool
    poses: int
    coordinates: int
    unknowns: int
    markers: tuple[str, ...]
    marker: Array
    base: Array
    far_off: bool

    def headline(self) -> str:
        """What the fit leaves, and whether the answer is clear."""
        clear = "clear" if self.clear else "not clear"
        return f"{self.robot}: {1e3 * self.best.rms:.3g} mm from {self.poses} poses, {clear}"

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers: lengths in metres; zeros in degrees and millimetres, as they are typed."""
        return {
            "controller": self.best.table(),
            "rms": self.best.rms,
            "zero_std": dict(zip(self.best.names, self.zero_std.tolist(), strict=True)),
            "clear": self.clear,
            "untold": self.untold,
            "same": [one.to_dict() for one in self.same],
            "second": None if self.second is None else self.second.to_dict(),
            "others": [one.to_dict() for one in self.others],
            "poses": self.poses,
            "coordinates": self.coordinates,
            "unknowns": self.unknowns,
            "markers": dict(zip(self.markers, self.marker.tolist(), strict=True)),
            "base": self.base.tolist(),
            "far_off": self.far_off,
        }
