"""Measured positions of markers, a visit of a pose at a time."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.fit.correlated_noise import row_numbers
from edtk.measure.measured_model import ROWS_OF, Kind
from edtk.robots.frames import all_wrenches
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

LOST = 1e-9  # [m] a position as near to the instrument's origin is a lost beam


@dataclass(frozen=True, eq=False)
class MarkerPositions(Presented):
    """What k instruments read in v visits: positions as a rule; NaN where nothing was seen.

    Attributes:
        q: Joint variables (v, n) [rad or m].
        wrench: Forces and torques (v, 6) at the load point [N, N m]; zero where nothing loads.
        measured: Positions (v, k, 3) in the frame of the instrument [m], or in visits that are
            differences their change under the load; a distance stands in the first coordinate.
        row: Row of the file (v, k) that holds each, counted from 0; -1 where there is none.
        markers: Names (k,).
        turns: Orientations (v, k, 3, 3) there, where they were measured with the positions; NaN
            where nothing was seen. Where the visit is a difference, the turn under the load.
        differs: Which visits (v,) are differences of a loaded and an unloaded reading; None where
            all are absolute.
        kinds: What is read of each (k,); by default positions, or poses where there are turns.
    """

    q: Array
    wrench: Array
    measured: Array
    row: Indices
    markers: tuple[str, ...]
    turns: Array | None = None
    differs: Mask | None = None
    kinds: tuple[Kind, ...] = ()

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, chosen: Indices | slice | Mask) -> "MarkerPositions":
        """Some of the visits."""
        names = ["q", "wrench", "measured", "row"]
        names += [name for name in ("turns", "differs") if getattr(self, name) is not None]
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
            kinds=tuple(self.kinds[i] for i in order) if self.kinds else (),
        )

    @property
    def rows(self) -> int:
        """Rows of an instrument: three, or six where orientations are measured."""
        return 3 if self.turns is None else 6

    @cached_property
    def present(self) -> Mask:
        """Which of these (k, rows) each instrument reads."""
        if not self.kinds:
            return np.ones((len(self.markers), self.rows), dtype=bool)
        count = np.array([ROWS_OF[kind] for kind in self.kinds])
        return np.arange(self.rows) < count[:, None]

    def with_visits(self, others: "MarkerPositions") -> "MarkerPositions":
        """The visits, then others of the same markers."""
        differs = np.concatenate([self.is_difference, others.is_difference])
        turns = None
        if self.turns is not None and others.turns is not None:
            turns = np.concatenate([self.turns, others.turns])
        return replace(
            self,
            q=np.concatenate([self.q, others.q]),
            wrench=all_wrenches(self.wrench, others.wrench),
            measured=np.concatenate([self.measured, others.measured]),
            row=np.concatenate([self.row, others.row]),
            turns=turns,
            differs=differs if differs.any() else None,
        )

    def with_markers(self, others: "MarkerPositions") -> "MarkerPositions":
        """The same visits with other instruments too, after these."""
        turns = None
        if self.turns is not None and others.turns is not None:
            turns = np.concatenate([self.turns, others.turns], axis=1)
        usual: Kind = "position" if self.turns is None else "pose"
        return replace(
            self,
            measured=np.concatenate([self.measured, others.measured], axis=1),
            row=np.concatenate([self.row, others.row], axis=1),
            markers=(*self.markers, *others.markers),
            turns=turns,
            kinds=(*(self.kinds or (usual,) * len(self.markers)), *others.kinds),
        )

    @cached_property
    def is_difference(self) -> Mask:
        """Which visits (v,) are differences of two readings."""
        return np.zeros(len(self), dtype=bool) if self.differs is None else self.differs

    @property
    def absolute(self) -> "MarkerPositions":
        """The visits that are read absolutely."""
        return self if self.differs is None else self[~self.differs]

    def headline(self) -> str:
        """How many positions in how many poses."""
        return (
            f"{self.count} positions of {len(self.markers)} markers in {self.poses} poses, "
            f"{len(self)} visits"
        )

    @cached_property
    def seen(self) -> Mask:
        """Which markers (v, k) were seen."""
        return np.asarray((np.isfinite(self.measured) | ~self.present[:, :3]).all(axis=-1))

    @cached_property
    def rows_seen(self) -> Mask:
        """Which rows (v, k, rows) were read."""
        return np.asarray(self.seen[..., None] & self.present)

    @cached_property
    def lost(self) -> Mask:
        """Which markers (v, k) are at the instrument's origin, where no beam has reached them."""
        size = np.abs(np.where(self.rows_seen[..., :3], self.measured, 0.0)).max(axis=-1)
        return np.asarray(self.seen & (size < LOST) & ~self.is_difference[:, None])

    def without_lost(self) -> "MarkerPositions":
        """The positions without those of lost beams."""
        return replace(self, measured=np.where(self.lost[..., None], np.nan, self.measured))

    @property
    def count(self) -> int:
        """Number of positions."""
        return int(self.seen.sum())

    @cached_property
    def pose(self) -> Indices:
        """Number (v,) of each visit's pose and load, counted from 0 in order of appearance.

        Differences count apart from absolute readings of the same pose and load.
        """
        return row_numbers(self.q, self.wrench, self.is_difference[:, None].astype(float))

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
    def worth(self) -> Array:
        """As many absolute readings say as much of each row, by their noise (poses, k, rows).

        A difference has the noise of two readings, and counts as half of one.
        """
        each = np.where(self.means.is_difference, 0.5, 1.0)
        return np.asarray((self.counts * each[:, None])[..., None] * self.present)

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
            None if self.differs is None else self.differs[first],
            self.kinds,
        )

    def _mean_turns(self, turns: Array) -> Array:
        """The rotations (poses, k, 3, 3) nearest to the sums of those of the visits."""
        total = np.zeros((self.poses, len(self.markers), 3, 3))
        turned = self.rows_seen[..., 3]
        np.add.at(total, self.pose, np.where(turned[..., None, None], turns, 0.0))
        unseen = ((self.counts == 0) | ~self.present[:, 3])[..., None, None]
        U, _, Vt = np.linalg.svd(np.where(unseen, np.eye(3), total))
        sign = np.ones((*unseen.shape[:2], 3))
        sign[..., 2] = np.linalg.det(U @ Vt)
        return np.where(unseen, np.nan, (U * sign[..., None, :]) @ Vt)

    def rows_of_pose(self, pose: int) -> list[int]:
        """Rows of the file that a pose is in, counted from 0."""
        rows = self.row[self.pose == pose]
        return sorted(set(rows[rows >= 0].tolist()))
