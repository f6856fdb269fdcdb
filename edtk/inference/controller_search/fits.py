"""Many fits of an arm to positions at once."""

from dataclasses import dataclass, fields, replace

import numpy as np

from edtk.inference.controller_search.positions import Positions
from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Fits:
    """Ways to count the joints, with the frame of the instrument and the markers' places.

    The model's joints are ``q = L c + o`` for values c of the controller; a marker at m in the
    flange's frame, whose pose is (R, p), is seen at ``y = W (R m + p) + t``.

    Attributes:
        counting: Signs and couplings L (b, n, n).
        offset: Offsets o (b, n) [rad or m].
        turn: Rotations W (b, 3, 3) from the robot's base to the instrument.
        shift: Places t (b, 3) of the robot's base [m].
        marker: Places m (b, k, 3) of the markers in the flange's frame [m].
        rms: Root mean square (b,) of the distances that the fit leaves [m].
    """

    counting: Array
    offset: Array
    turn: Array
    shift: Array
    marker: Array
    rms: Array

    @classmethod
    def at(cls, counting: Array, offset: Array, markers: int) -> "Fits":
        """Ways to count whose frames and markers are not fitted yet."""
        b = len(offset)
        turn = np.broadcast_to(np.eye(3), (b, 3, 3))
        marker = np.zeros((b, markers, 3))
        return cls(counting, offset, turn, np.zeros((b, 3)), marker, np.full(b, np.inf))

    def __len__(self) -> int:
        return len(self.offset)

    def __getitem__(self, chosen: "Indices | Mask | slice") -> "Fits":
        return Fits(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @classmethod
    def joined(cls, parts: list["Fits"]) -> "Fits":
        """All fits of several lots."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def better_of(self, other: "Fits") -> "Fits":
        """Of each pair of fits the one that leaves less."""
        better = other.rms < self.rms
        values = []
        for field in fields(self):
            own = getattr(self, field.name)
            lifted = better.reshape(-1, *(1,) * (own.ndim - 1))
            values.append(np.where(lifted, getattr(other, field.name), own))
        return Fits(*values)

    def frames(self, robot: Robot, positions: Positions) -> Frames:
        """Frames of all fits (b, p) in all poses; the tool frame is the flange's."""
        q = positions.shown @ np.swapaxes(self.counting, 1, 2) + self.offset[:, None]
        return robot.frames(q)

    def arms(self, frames: Frames, positions: Positions) -> tuple[Array, Array]:
        """Vectors R m (b, m, 3) and points R m + p (b, m, 3) of all positions, in the base."""
        rotation = np.moveaxis(frames.rotation, (0, 1), (-1, -2))[:, positions.pose]
        place = np.moveaxis(frames.position, 0, -1)[:, positions.pose]
        arm = (rotation @ self.marker[:, positions.marker, :, None])[..., 0]
        return rotation, place + arm

    def residual(self, points: Array, positions: Positions) -> Array:
        """Measured less predicted positions (b, m, 3) [m]."""
        seen = points @ np.swapaxes(self.turn, 1, 2) + self.shift[:, None]
        return np.asarray(positions.measured - seen)

    def with_rms(self, residual: Array, positions: Positions) -> "Fits":
        """The same fits with what they leave."""
        squares = ((residual**2).sum(axis=-1) * positions.count).sum(axis=-1)
        return replace(self, rms=np.sqrt(squares / positions.count.sum()))
