"""Errors of positions in millimetres, as a sheet tells them and its fit weighs them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from edtk.measure.noise import Tracker, VisitNoise
from edtk.measure.whitening import Scatter, component_first, diagonal_blocks, of_rows
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

ROUNDING = 1e-6  # [mm] no instrument reads better


@dataclass(frozen=True, eq=False)
class BlockVariances:
    """Variances, and how well they are known.

    Attributes:
        variances: One a kind (c,).
        covariance: Of these (c, c); zero where a variance is, which then counts as known.
        log_likelihood: The residual log-likelihood, up to a constant.
    """

    variances: Array
    covariance: Array
    log_likelihood: float

    def relative_dof(self, slopes: Array) -> Array:
        """Degrees of freedom (...,) of sums ``slopes v``: ``2 mean^2 / variance`` (Satterthwaite).

        Args:
            slopes: Sums' derivatives (..., c) by the variances.
        """
        mean = slopes @ self.variances
        spread = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(spread > 0, 2 * mean**2 / spread, np.inf)

    def first(self, count: int) -> "BlockVariances":
        """The first of the variances alone."""
        return replace(
            self, variances=self.variances[:count], covariance=self.covariance[:count, :count]
        )


@dataclass(frozen=True, eq=False)
class PositionNoise:
    """Errors of a pose's positions, in millimetres and milliradians.

    A reading of all markers has the covariance ``R = T + r^2 I + sum_j s_j^2 J_j J_j'`` with the
    errors T of a tracker, marker by marker, and the motion J_j of the markers by joint j: the
    joints move all of them together. Repeats average it out.
    What the model leaves out, ``D = w^2 I + e^2 sum_j J_j J_j'``, they do not: it is as if each
    joint were wrong by another small angle in each pose, as by gears that are not round.

    Attributes:
        reading: r [mm].
        joints: s (n,) [mrad, or mm of a prismatic joint].
        model_white: w [mm].
        model_joints: e (n,) likewise: the same for all joints of a kind, or one size a joint where
            the residuals speak for that.
        model_fit: The fitted variances of the model's part, those of `model_change` last where it
            is not nothing; None where none was fitted.
        repeats: Degrees of freedom of the repeats that told r and s; zero where they were stated.
        turn: The same as r, of orientations [mrad], where they are measured; their rows follow the
            positions of each marker.
        model_turn: The same as w, of orientations [mrad].
        model_change: The same as w and `model_turn`, of what a load changes [mm, mrad]: readings
            under a load have it besides, and differences of two readings it alone.
        tracker: The tracker, in the frame of the places that it is asked about; None where its
            errors are part of r.
        tracked: Which instruments (k,) it sees; None for all.
        ratios: Errors (k,) of the instruments' lengths, as shares of r: those of distances; None
            where all are one.
        unknown: Whether residuals tell how large the instrument's errors are, of which T, r and
            `turn` say the shape: then w is part of them, as nothing tells both apart.
    """

    reading: float
    joints: Array
    model_white: float = 0.0
    model_joints: Array = field(default_factory=lambda: np.zeros(0))
    model_fit: BlockVariances | None = None
    repeats: int = 0
    turn: float | None = None
    model_turn: float = 0.0
    model_change: tuple[float, float] = (0.0, 0.0)
    tracker: Tracker | None = None
    tracked: Mask | None = None
    ratios: Array | None = None
    unknown: bool = False

    def beside(
        self, tracker: Tracker | None = None, repeatability: Array | None = None
    ) -> "PositionNoise":
        """The same with what else a reading errs by, as a `VisitNoise` takes it [m, rad]."""
        joints = self.joints if repeatability is None else MM * repeatability + 0.0 * self.joints
        return replace(self, tracker=tracker, joints=joints)

    def of_mean(self, readings: float) -> "PositionNoise":
        """The errors of a mean of readings, which lessens all but what the model leaves out."""
        share = 1 / np.sqrt(readings)
        tracker = self.tracker
        if tracker is not None:
            (a, b), (c, d) = tracker.along, tracker.across
            tracker = replace(tracker, along=(share * a, share * b), across=(share * c, share * d))
        turn = None if self.turn is None else share * self.turn
        joints = share * np.asarray(self.joints)
        return replace(
            self, reading=share * self.reading, joints=joints, turn=turn, tracker=tracker
        )

    def of_visits(self, width: int, markers: int) -> VisitNoise:
        """The same of the rows of visits that are read once.

        Args:
            width: Rows r of a visit.
            markers: Instruments, each with as many of them.
        """
        each = width // markers
        turn = max(self.turn or 0.0, ROUNDING)
        reading = self._white(max(self.reading, ROUNDING), turn, width)
        return VisitNoise(
            self.tracker,
            () if self.tracker is None else tuple((i, each * i) for i in self.sees(markers)),
            np.asarray(self.joints),
            np.sqrt(reading * self.squared_ratios(width)),
            np.sqrt(self._white(self.model_white, self.model_turn, width)),
            readings=1,
            unit=MM,
            turns=np.asarray(self.model_joints),
            change=np.sqrt(self._white(*self.model_change, width)),
        )

    @property
    def rows(self) -> int:
        """Measured coordinates of a marker."""
        return 3 if self.turn is None else 6

    def white_kinds(self, width: int) -> list[Array]:
        """Masks (r,) of the coordinates that share a white error: positions, and orientations."""
        return white_kinds(self.rows, width)

    def _white(self, position: float, turn: float, width: int) -> Array:
        """Variances (r,) of white errors."""
        sizes = (position, turn)
        kinds = self.white_kinds(width)
        return np.asarray(sum(size**2 * kind for size, kind in zip(sizes, kinds, strict=False)))

    def of_markers(self, chosen: Indices) -> "PositionNoise":
        """The same of some of the instruments."""
        tracked = None if self.tracked is None else self.tracked[chosen]
        ratios = None if self.ratios is None else self.ratios[chosen]
        return replace(self, tracked=tracked, ratios=ratios)

    def squared_ratios(self, width: int) -> Array:
        """Variances (r,) of the rows over those that are said of them, by their instruments."""
        if self.ratios is None:
            return np.ones(width)
        return np.repeat(self.ratios**2, width // len(self.ratios))

    def scaled(self, ratio: float) -> "PositionNoise":
        """The same, with an instrument that errs by so many times as much in positions."""
        tracker = None if self.tracker is None else self.tracker.scaled(ratio)
        return replace(self, reading=ratio * self.reading, tracker=tracker)

    def sized(self, sizes: Sequence[float]) -> "PositionNoise":
        """The same with an instrument so many times as bad in positions, and in orientations."""
        turn = None if self.turn is None else sizes[1] * self.turn
        return replace(self.scaled(sizes[0]), turn=turn)

    def seen_from(self, frame: Array) -> "PositionNoise":
        """The same in another frame, in which the world is a motion (4, 4) away."""
        if self.tracker is None:
            return self
        return replace(self, tracker=self.tracker.seen_from(frame))

    def of_drawing(self, share: float) -> "PositionNoise":
        """The same, whose model leaves out errors of the drawing alone, of such a share of its own.

        Differences of two readings have none: the drawing errs by the same in both.
        """
        return replace(
            self.without_changes,
            model_white=share * self.model_white,
            model_joints=share * np.asarray(self.model_joints),
            model_turn=share * self.model_turn,
        )

    @property
    def changes(self) -> int:
        """How many of the fitted variances are of changes."""
        return self.rows // 3 if any(self.model_change) else 0

    @property
    def without_changes(self) -> "PositionNoise":
        """The same, whose model leaves out nothing of what a load changes."""
        fit = self.model_fit
        told = None if fit is None else fit.first(len(fit.variances) - self.changes)
        return replace(self, model_fit=told, model_change=(0.0, 0.0))

    @property
    def draws(self) -> bool:
        """Whether the model leaves out anything of absolute readings."""
        return bool(self.model_white or self.model_turn or np.any(self.model_joints))

    def with_place_of(self, other: "PositionNoise") -> "PositionNoise":
        """The same, whose tracker stands where another one does."""
        if self.tracker is None or other.tracker is None:
            return self
        return replace(self, tracker=replace(self.tracker, position=other.tracker.position))

    def sees(self, markers: int) -> Indices:
        """The instruments, of so many, that the tracker sees."""
        return np.arange(markers) if self.tracked is None else np.flatnonzero(self.tracked)

    def of_instrument(self, places: Array, width: int) -> Array:
        """Covariances (m or 1, r, r) [mm^2] of a reading, without what the joints do.

        Args:
            places: Where the markers are (m, k, 3), in the frame of the tracker [m].
            width: Rows r of a pose.
        """
        apart = self.apart(places, width)
        return Scatter(apart, np.zeros((len(apart), width, 0))).dense

    def apart(self, places: Array, width: int) -> Array:
        """The same by instrument (m or 1, k, d, d), each of which errs by itself."""
        some = places[:1] if self.tracker is None else places
        m, k = some.shape[:2]
        noise = self.of_visits(width, k)
        V = np.zeros((m, k, width // k, width // k))
        V += (noise.white**2).reshape(k, -1, 1) * np.eye(width // k)
        if self.tracker is not None:
            own = self.sees(k)
            T = self.tracker.covariance(np.moveaxis(some[:, own], 0, -1))
            V[:, own, :3, :3] += noise.unit**2 * np.moveaxis(T, -1, 0)
        return V

    def squared_reading(self, places: Array) -> Array:
        """Mean squared distances (m, k) [mm^2] by which an instrument's readings are off.

        Where its size is unknown, what the model leaves out of each coordinate is part of it.
        """
        width = self.rows * places.shape[1]
        own = np.einsum("mkdd->mkd", self.apart(places, width))[..., :3].sum(axis=-1)
        return np.broadcast_to(own, places.shape[:2])

    def typical(self, places: Array) -> float:
        """Root mean square error [mm] of a coordinate that is read at places (m, k, 3)."""
        return float(np.sqrt(self.squared_reading(places).mean() / 3))

    def by_whites(self, places: Array, width: int) -> list[Array]:
        """Covariances (m or 1, r, r) by the fitted variances of white errors.

        Those of an instrument of unknown size are proportional to its variance.
        """
        kinds = self.white_kinds(width)
        if not self.unknown or self.model_fit is None:
            return [np.diag(kind)[None] for kind in kinds]
        V = self.of_instrument(places, width)
        whites = zip(kinds, self.model_fit.variances, strict=False)
        return [V * np.outer(kind, kind) / (v if v > 0 else 1.0) for kind, v in whites]

    def of_reading(self, motion: Array, places: Array) -> Array:
        """Covariances R (m, r, r) [mm^2] of one reading.

        Args:
            motion: Motions (m, r, n) of the coordinates by the joints [mm/mrad].
            places: Where the markers are (m, k, 3), in the frame of the tracker [m].
        """
        noise = self.of_visits(motion.shape[1], places.shape[1])
        V = noise.scatter(np.moveaxis(places, 0, -1), component_first(motion))
        return np.asarray(np.moveaxis(V, -1, 0))

    def of_model(
        self, motion: Array, differs: Mask | None = None, loaded: Mask | None = None
    ) -> Array:
        """Covariances D (m, r, r) [mm^2] of what the model leaves out.

        Args:
            motion: Motions (m, r, n) of the coordinates by the joints [mm/mrad].
            differs: Which poses (m,) are differences of two readings; None for none.
            loaded: Which (m,) are under a load; by default those that are differences.
        """
        white, turns = self._left_out(motion.shape[1], differs, loaded)
        moved = motion[..., : turns.shape[1]] * turns[:, None]
        return np.asarray(moved @ np.swapaxes(moved, 1, 2) + diagonal_blocks(white))

    def _left_out(
        self, width: int, differs: Mask | None, changes: Array | Mask | None
    ) -> tuple[Array, Array]:
        """What poses lack in the model: variances (m or 1, r), and turns of joints (m or 1, n).

        Args:
            width: Rows r of a pose.
            differs: Which poses (m,) are differences of two readings; None for none.
            changes: What shares (m,) or (m, k, rows) of the variance of a change the rows have; by
                default those of differences.
        """
        differs = np.zeros(1, dtype=bool) if differs is None else differs
        changes = differs if changes is None else changes
        share = of_rows(changes, width) if changes.ndim == 3 else 1.0 * changes[:, None]
        white = np.outer(~differs, self._white(self.model_white, self.model_turn, width))
        turns = np.outer(~differs, self.model_joints)
        return white + share * self.of_changes(width), turns

    def of_changes(self, width: int) -> Array:
        """Variances (r,) of what the model leaves out of a change [mm^2, mrad^2]."""
        return self._white(*self.model_change, width)

    def of_change(self, motion: Array, places: Array) -> Array:
        """Covariances (m, r, r) of differences of two readings, with what the model leaves out."""
        return 2 * self.of_reading(motion, places) + np.diag(self.of_changes(motion.shape[1]))

    def of_pose(
        self,
        motion: Array,
        places: Array,
        counts: Array | Indices,
        differs: Mask | None = None,
        changes: Array | None = None,
    ) -> Scatter:
        """Covariances (m, r, r) of means over some readings.

        Args:
            motion: Motions (m, r, n) of the coordinates [mm/mrad].
            places: Where the markers are (m, k, 3), in the frame of the tracker [m].
            counts: Readings (m, k) of each marker, or what those of each row (m, k, rows) are
                worth; where there is none, the coordinates count as independent and of size one.
            differs: Which poses (m,) are differences of two readings; None for none.
            changes: What shares (m, k, rows) of the variance of a change the rows have; by default
                those of differences.
        """
        m, width, _ = motion.shape
        k = places.shape[1]
        worth = of_rows(counts, width)
        there = worth > 0
        share = there / np.sqrt(np.where(there, worth, 1.0))
        own = share.reshape(m, k, -1)
        of_reading = self.apart(places, width) * own[..., None] * own[..., None, :]
        left, turns = self._left_out(width, differs, changes)
        turns = turns if turns.any() else turns[:, :0]
        turns = np.broadcast_to(turns, (m, turns.shape[1]))
        joints = np.asarray(self.joints) if np.any(self.joints) else np.zeros(0)
        sizes = ((share, np.broadcast_to(joints, (m, len(joints)))), (1.0 * there, turns))
        together = [
            motion[..., : size.shape[1]] * rows[..., None] * size[:, None] for rows, size in sizes
        ]
        V = Scatter(of_reading, np.concatenate(together, axis=-1))
        return V.with_white(np.where(there, left, 1.0))


def white_kinds(rows: int, width: int) -> list[Array]:
    """Masks (width,) of the coordinates that share a white error: positions, and orientations."""
    if rows == 3:
        return [np.ones(width)]
    turns = np.arange(width) % rows >= 3
    return [(~turns).astype(float), turns.astype(float)]
