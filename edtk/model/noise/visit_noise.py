"""The covariance of what one visit of a pose measures, and its slope."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.frames import Frames
from edtk.model.noise.tracker import Tracker
from edtk.system.typing import Array


class Measured(Protocol):
    """What the noise needs to know of a model: where it measures, and how joints move that."""

    def points_of(self, frames: Frames) -> Array:
        """Positions (markers, 3, ...) of the markers in the world frame [m]."""

    def motion_of(self, frames: Frames) -> Array:
        """Derivatives dy/dq (n, rows, ...) of all measured rows by all joints."""

    def motion_slope_of(self, frames: Frames, B: Array) -> Array:
        """Derivatives (n, ...) of ``<B, dy/dq>`` by all joints, B (n, rows, ...) held fixed."""


@dataclass(frozen=True, eq=False)
class VisitNoise:
    """Errors of the rows that a visit of a pose measures, and of several visits of it.

    A visit is `readings` readings of all markers (two for loaded minus unloaded), to each of which
    the robot comes anew. With the covariance T(p) of the tracker at each marker, the motion
    ``J = dy/dq`` of the rows, and variances ``s^2`` of the joints, w^2 of white noise and d^2 of
    the discrepancy,

        V(q) = readings (T + J diag(s^2) J') + diag(w^2),
        Sigma(q) = V(q) + diag(d^2).

    The joints move all markers of a visit together, so that V is full. Visits of one pose have
    errors of their own, but share the discrepancy: the mean of v visits has the covariance
    ``V/v + diag(d^2)``, and all of them together have the information

        A' (V/v + diag(d^2))^-1 A = v A' (V + v diag(d^2))^-1 A,

    which is concave in v and at most v times that of one visit. `covariance_of` therefore gives
    ``V + v diag(d^2)``: the covariance that one of v visits counts with.

    Arrays are component first, as in `Frames`.

    Attributes:
        tracker: The tracker; None where its errors are part of the white noise.
        tracked: For each marker that the tracker sees, its index among the model's points and the
            first of its three rows.
        repeatability: Standard deviations s (n,) of the joints in one reading [rad or m].
        white: Standard deviations w (rows,) of a visit's rows [m, rad].
        discrepancy: Standard deviations d (rows,) of the model's errors [m, rad].
        within: Poses nearer than this, Euclidean over the revolute joints, share the discrepancy
            [rad].
        readings: Readings whose difference or value a row is: two, or one for absolute positions.
    """

    tracker: Tracker | None
    tracked: tuple[tuple[int, int], ...]
    repeatability: Array
    white: Array
    discrepancy: Array
    within: float = 0.0
    readings: int = 2

    @cached_property
    def shares(self) -> bool:
        """Whether visits of one pose share an error, so that repeats do not average it out."""
        return bool(self.discrepancy.any())

    @cached_property
    def alone(self) -> "VisitNoise":
        """The noise of visits that share nothing: each has a discrepancy of its own."""
        if not self.shares:
            return self
        white = np.hypot(self.white, self.discrepancy)
        return replace(self, white=white, discrepancy=np.zeros_like(white))

    def scatter_of(self, model: Measured, frames: Frames) -> Array:
        """The part V (rows, rows, ...) of the covariance that repeats average out [m^2, rad^2]."""
        return self._scatter(model.points_of(frames), model.motion_of(frames))

    def covariance_of(self, model: Measured, frames: Frames, visits: ArrayLike = 1.0) -> Array:
        """Covariance ``V + v diag(d^2)`` with which one of v visits of a pose counts.

        Args:
            model: The model that is measured.
            frames: The poses.
            visits: Number v of visits, which broadcasts to the poses (...).

        Returns:
            Covariances (rows, rows, ...) [m^2, rad^2].
        """
        Sigma = self.scatter_of(model, frames)
        v = np.asarray(visits, dtype=float)
        for row in np.flatnonzero(self.discrepancy):
            Sigma[row, row] += v * self.discrepancy[row] ** 2
        return Sigma

    def slope_of(self, model: Measured, frames: Frames, S: Array) -> Array:
        """Derivatives of ``<S, Sigma>`` by all joints, S held fixed; visits do not matter.

        ``d<S, J diag(s^2) J'> = 2 sum_j s_j^2 <S J_j, dJ_j>``, and the tracker's part follows the
        markers, see `Tracker.slope`.

        Args:
            model: The model that is measured.
            frames: The poses.
            S: Symmetric weights (rows, rows, ...).

        Returns:
            Derivatives (n, ...).
        """
        motion = model.motion_of(frames)
        slope = np.zeros((len(motion), *S.shape[2:]))
        if self.repeatability.any():
            weights = np.einsum("rs...,js...->jr...", S, motion)
            weights *= self._lifted(2 * self.readings * self.repeatability**2, weights)
            slope += model.motion_slope_of(frames, weights)
        if self.tracker is not None:
            points = model.points_of(frames)[[point for point, _ in self.tracked]]
            own = np.stack([S[row : row + 3, row : row + 3] for _, row in self.tracked])
            by_point = self.readings * self.tracker.slope(points, own)
            for (_, row), g in zip(self.tracked, by_point, strict=True):
                slope += np.einsum("ji...,i...->j...", motion[:, row : row + 3], g)
        return slope

    def _scatter(self, points: Array, motion: Array) -> Array:
        """V (rows, rows, ...) of points (markers, 3, ...) and motion (n, rows, ...)."""
        rows = motion.shape[1]
        V = np.zeros((rows, rows, *motion.shape[2:]))
        moving = np.flatnonzero(self.repeatability)
        if len(moving):
            J = motion[moving]
            J = J * self._lifted(np.sqrt(self.readings) * self.repeatability[moving], J)
            for row in range(rows):
                V[row, : row + 1] = np.einsum("j...,jk...->k...", J[:, row], J[:, : row + 1])
        for row in range(rows):
            V[row, row] += self.white[row] ** 2
            V[:row, row] = V[row, :row]
        if self.tracker is not None:
            T = self.tracker.covariance(points[[point for point, _ in self.tracked]])
            for (_, row), own in zip(self.tracked, T, strict=True):
                V[row : row + 3, row : row + 3] += self.readings * own
        return V

    @staticmethod
    def _lifted(numbers: Array, like: Array) -> Array:
        """Numbers (n,) that multiply arrays (n, rows, ...)."""
        return numbers.reshape(-1, *[1] * (like.ndim - 1))
