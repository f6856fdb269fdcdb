"""Measured positions of markers, a visit of a pose at a time."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

LOST = 1e-9  # [m] a position as near to the instrument's origin is a lost beam


@dataclass(frozen=True, eq=False)
class MarkerPositions(Presented):
    """Positions of k markers in v visits; a marker that was not seen is NaN.

    Attributes:
        q: Joint variables (v, n) [rad or m].
        wrench: Forces and torques (v, 6) at the load point [N, N m]; zero where nothing loads.
        measured: Positions (v, k, 3) in the frame of the instrument [m].
        row: Row of the file (v, k) that holds each, counted from 0; -1 where there is none.
        markers: Names (k,).
        turns: Orientations (v, k, 3, 3) there, where they were measured with the positions; NaN
            where nothing was seen.
    """

    q: Array
    wrench: Array
    measured: Array
    row: Indices
    markers: tuple[str, ...]
    turns: Array | None = None

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, chosen: Indices | slice | Mask) -> "MarkerPositions":
        """Some of the visits."""
        names = ["q", "wrench", "measured", "row", *(["turns"] if self.turns is not None else [])]
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def of_markers(self, chosen: Indices | list[int] | slice) -> "MarkerPositions":
        """Some of the markers, in their order."""
        order = np.arange(len(self.markers))[chosen]
        return replace(
            self,
            measured=self.measured[:, order],
            row=self.row[:, order],
            markers=tuple(self.markers[i] for i in order),
            turns=None if self.turns is None else self.turns[:, order],
        )

    @property
    def rows(self) -> int:
        """Measured coordinates of a marker: three, or six with its orientation."""
        return 3 if self.turns is None else 6

    def headline(self) -> str:
        """How many positions in how many poses."""
        return (
            f"{self.count} positions of {len(self.markers)} markers in {self.poses} poses, "
            f"{len(self)} visits"
        )

    @cached_property
    def seen(self) -> Mask:
        """Which markers (v, k) were seen."""
        return np.asarray(np.isfinite(self.measured).all(axis=-1))

    @cached_property
    def lost(self) -> Mask:
        """Which markers (v, k) are at the instrument's origin, where no beam has reached them."""
        size = np.abs(np.where(self.seen[..., None], self.measured, np.inf)).max(axis=-1)
        return np.asarray(size < LOST)

    def without_lost(self) -> "MarkerPositions":
        """The positions without those of lost beams."""
        return replace(self, measured=np.where(self.lost[..., None], np.nan, self.measured))

    @property
    def count(self) -> int:
        """Number of positions."""
        return int(self.seen.sum())

    @cached_property
    def pose(self) -> Indices:
        """Number (v,) of each visit's pose and load, counted from 0 in order of appearance."""
        keys = np.hstack([self.q, self.wrench]) + 0.0
        _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        rank = np.empty(len(first), dtype=int)
        rank[np.argsort(first)] = np.arange(len(first))
        return rank[inverse.reshape(-1)]

    @cached_property
    def poses(self) -> int:
        """Number of poses, each under its load."""
        return int(self.pose.max(initial=-1)) + 1

    @cached_property
    def counts(self) -> Indices:
        """How often each marker was seen in each pose (poses, k)."""
        found = np.zeros((self.poses, len(self.markers)), dtype=int)
        np.add.at(found, self.pose, self.seen)
        return found

    @cached_property
    def means(self) -> "MarkerPositions":
        """The mean of the visits of each pose, a visit a pose."""
        total = np.zeros((self.poses, len(self.markers), 3))
        np.add.at(total, self.pose, np.where(self.seen[..., None], self.measured, 0.0))
        with np.errstate(invalid="ignore"):
            mean = total / self.counts[..., None]
        _, first = np.unique(self.pose, return_index=True)
        return MarkerPositions(
            self.q[first],
            self.wrench[first],
            mean,
            self.row[first],
            self.markers,
            None if self.turns is None else self._mean_turns(self.turns),
        )

    def _mean_turns(self, turns: Array) -> Array:
        """The rotations (poses, k, 3, 3) nearest to the sums of those of the visits."""
        total = np.zeros((self.poses, len(self.markers), 3, 3))
        np.add.at(total, self.pose, np.where(self.seen[..., None, None], turns, 0.0))
        unseen = (self.counts == 0)[..., None, None]
        U, _, Vt = np.linalg.svd(np.where(unseen, np.eye(3), total))
        sign = np.ones((*unseen.shape[:2], 3))
        sign[..., 2] = np.linalg.det(U @ Vt)
        return np.where(unseen, np.nan, (U * sign[..., None, :]) @ Vt)

    def rows_of_pose(self, pose: int) -> list[int]:
        """Rows of the file that a pose is in, counted from 0."""
        rows = self.row[self.pose == pose]
        return sorted(set(rows[rows >= 0].tolist()))
