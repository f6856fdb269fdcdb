"""Measured positions of markers with what the controller showed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Array, Indices

STILL = 1e-6  # [rad or m]


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of markers in poses, the mean of repeated ones.

    Attributes:
        shown: Values (p, n) that the controller shows in each pose [rad or m].
        pose: Pose (m,) of each position, by its index.
        marker: Marker (m,) of each position, by its index.
        measured: Positions (m, 3) in the frame of the instrument [m].
        count: How often each was measured (m,).
        names: Names of the markers (k,).
    """

    shown: Array
    pose: Indices
    marker: Indices
    measured: Array
    count: Indices
    names: tuple[str, ...]

    @classmethod
    def of_rows(cls, shown: Array, measured: Array, markers: Sequence[str]) -> "Positions":
        """Average the rows of one pose and marker.

        Args:
            shown: Values (r, n) that the controller shows [rad or m].
            measured: Positions (r, 3) [m].
            markers: Name of the marker of each row.
        """
        names = tuple(dict.fromkeys(markers))
        of_name = {name: i for i, name in enumerate(names)}
        marker = np.array([of_name[name] for name in markers])
        poses, pose = np.unique(shown, axis=0, return_inverse=True)
        key = pose.reshape(-1) * len(names) + marker
        kept, row, count = np.unique(key, return_inverse=True, return_counts=True)
        mean = np.zeros((len(kept), 3))
        np.add.at(mean, row.reshape(-1), measured)
        mean /= count[:, None]
        return cls(poses, kept // len(names), kept % len(names), mean, count, names)

    @classmethod
    def of_sheet(cls, sheet: MarkerPositions) -> "Positions":
        """Take the positions of a sheet, whose joint variables are what the controller shows."""
        visit, marker = np.nonzero(sheet.seen)
        names = [sheet.markers[i] for i in marker]
        return cls.of_rows(sheet.q[visit], sheet.measured[visit, marker], names)

    @property
    def moving(self) -> list[int]:
        """Joints that do not stand still in all poses."""
        return [int(j) for j in np.flatnonzero(np.ptp(self.shown, axis=0) > STILL)]

    def thinned(self, poses: int, marker: int | None) -> "Positions":
        """A part of the positions: poses spread over all, and one marker where one is named."""
        chosen = np.unique(np.linspace(0, len(self.shown) - 1, poses).round().astype(int))
        kept = np.isin(self.pose, chosen)
        if marker is not None:
            kept &= self.marker == marker
        used, pose = np.unique(self.pose[kept], return_inverse=True)
        return Positions(
            shown=self.shown[used],
            pose=pose.reshape(-1),
            marker=self.marker[kept] if marker is None else np.zeros(int(kept.sum()), dtype=int),
            measured=self.measured[kept],
            count=self.count[kept],
            names=self.names if marker is None else (self.names[marker],),
        )

    def __len__(self) -> int:
        return len(self.pose)
