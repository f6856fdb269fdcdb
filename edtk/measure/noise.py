"""Noise of a visit: tracker, joints that come back, and what the model leaves out."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.model_error import ModelError
from edtk.robots.robot import joint_distance
from edtk.system.typing import Array, Indices, Mask

FramesLike = TypeVar("FramesLike")
FramesLike_contra = TypeVar("FramesLike_contra", contravariant=True)

SAME = 1e-9  # [rad]: poses nearer than this are one pose, whatever the distance that is asked for
ROUNDING = 1e-6  # [mm] no instrument reads better
MM = 1e3  # [mm/m]


@dataclass(frozen=True, eq=False)
class Tracker:
    """Standard deviations ``a + b r`` of one reading, along and across the beam of length r.

    With the beam's direction u from the tracker to a point, a reading of the point has the
    covariance

        T = c^2 I + (e^2 - c^2) u u',   e = along[0] + along[1] r,   c = across[0] + across[1] r.

    Attributes:
        position: Where the tracker stands (3,), in the world frame [m].
        along: Coefficients a [m] and b [m/m] of the standard deviation along the beam.
        across: Coefficients of the one across the beam, in each of both directions.
    """

    position: Array
    along: tuple[float, float]
    across: tuple[float, float]

    def covariance(self, points: Array) -> Array:
        """Covariances T (markers, 3, 3, ...) [m^2] of readings of points (markers, 3, ...) [m]."""
        r, u = self._beam(points)
        c = _error(self.across, r)
        e = _error(self.along, r)
        # The product of both directions comes first: rounding then keeps the matrix symmetric.
        T = (e**2 - c**2)[:, None, None] * (u[:, :, None] * u[:, None])
        for axis in range(3):
            T[:, axis, axis] += c**2
        return T

    def slope(self, points: Array, S: Array) -> Array:
        """Derivatives of ``<S, T>`` by the points, S held fixed.

        With ``s = u' S u``, ``f = c^2`` and ``g = e^2 - c^2``, whose derivatives by r are f' and
        g', and with ``dr = u.dp`` and ``du = (I - u u') dp / r``,

            d<S, T>/dp = (f' trace S + g' s) u + 2 g (S u - s u) / r.

        Args:
            points: Points (markers, 3, ...) [m].
            S: Symmetric weights (markers, 3, 3, ...).

        Returns:
            Array (markers, 3, ...).
        """
        r, u = self._beam(points)
        c = _error(self.across, r)
        e = _error(self.along, r)
        f_slope = 2 * c * self.across[1]
        g = e**2 - c**2
        g_slope = 2 * e * self.along[1] - f_slope
        Su = np.einsum("mij...,mj...->mi...", S, u)
        s = np.einsum("mi...,mi...->m...", u, Su)
        radial = f_slope * np.einsum("mii...->m...", S) + g_slope * s
        return np.asarray(radial[:, None] * u + (2 * g / r)[:, None] * (Su - s[:, None] * u))

    def least(self, reach: float) -> float:
        """The least standard deviation [m] within a distance [m] of the world's origin."""
        nearest = max(0.0, float(np.linalg.norm(self.position)) - reach)
        return min(a + b * nearest for a, b in (self.along, self.across))

    def scaled(self, ratio: float) -> "Tracker":
        """The same whose errors are so many times as large."""
        along, across = ((ratio * a, ratio * b) for a, b in (self.along, self.across))
        return Tracker(self.position, along, across)

    def seen_from(self, frame: Array) -> "Tracker":
        """The same in another frame, in which the world is a motion (4, 4) away."""
        return replace(self, position=frame[:3, :3] @ self.position + frame[:3, 3])

    def _beam(self, points: Array) -> tuple[Array, Array]:
        """Ranges r (markers, ...) [m] and directions u (markers, 3, ...) from the tracker."""
        lift = (slice(None),) + (None,) * (points.ndim - 2)
        beam = points - self.position[lift]
        r = np.sqrt(np.einsum("mi...,mi...->m...", beam, beam))
        return r, beam / r[:, None]


def _error(coefficients: tuple[float, float], r: Array) -> Array:
    """``a + b r`` [m]."""
    a, b = coefficients
    return a + b * r


def shared_visits(
    q: Array,
    repeats: ArrayLike,
    prismatic: Mask,
    within: float,
    wrench: Array | None = None,
) -> Array:
    """Count the visits of poses that are nearer than a distance, the pose's own included.

    A visit under a load errs by what bends, and one without a load by what stands still: they share
    nothing.

    Errors of the model in v poses near each other have some correlation C (v, v) that nobody knows.
    Whatever it is, ``C <= v I``; and if only poses nearer than `within` are correlated at all, then
    ``C <= diag(v_i)`` with v_i the number of visits within that distance of visit i, since
    ``diag(v_i) - C`` is diagonally dominant. To count the variance of each pose v_i times is thus
    safe, and exact for repeats of one pose: a plan is worth at least what it is said to be.

    Args:
        q: Poses (k, n) [rad or m].
        repeats: Visits (k,) of each.
        prismatic: Which joints (n,) are prismatic; they do not count.
        within: The distance, Euclidean over the revolute joints, each difference taken the short
            way round [rad].
        wrench: Loads (k, 6) of the poses [N, N m]; None where all are loaded.

    Returns:
        Numbers of visits (k,).
    """
    limit = max(within * (1 - SAME), SAME)
    visits = np.asarray(repeats, dtype=float)
    loaded = np.ones(len(q)) if wrench is None else np.any(wrench, axis=1).astype(float)
    near = (joint_distance(q, own, prismatic) < limit for own in q)
    each = zip(near, loaded.tolist(), strict=True)
    return np.array([visits[some & (loaded == own)].sum() for some, own in each])


@dataclass(frozen=True, eq=False)
class Whitener:
    """The lower triangle L of ``Sigma = L L'`` (Cholesky), component first.

    Attributes:
        L: Lower triangles (rows, rows, ...); entries above the diagonal are not used.
    """

    L: Array

    @classmethod
    def of(cls, Sigma: Array) -> "Whitener":
        """Factorise covariances.

        Args:
            Sigma: Symmetric matrices (rows, rows, ...); only their lower triangles are read.

        Returns:
            The whitener. Where a covariance is not positive definite its rows are NaN: the caller
            decides what such a pose means.
        """
        rows = len(Sigma)
        L = np.zeros(Sigma.shape)
        # Loops over rows, array operations over poses: a call of LAPACK for each small matrix
        # takes three times as long.
        for j in range(rows):
            column = Sigma[j:, j].copy()
            for k in range(j):
                column -= L[j:, k] * L[j, k]
            L[j, j] = np.sqrt(np.where(column[0] > 0, column[0], np.nan))
            L[j + 1 :, j] = column[1:] / L[j, j]
        return cls(L)

    def rows(self, A: Array) -> Array:
        """Whitened rows ``L^-1 A`` of columns A (p, rows, ...), in the same layout."""
        shape = np.broadcast_shapes(A.shape[2:], self.L.shape[2:])
        white = np.empty((*A.shape[:2], *shape))
        for i in range(len(self.L)):
            rest = white[:, i]
            rest[...] = A[:, i]
            for k in range(i):
                rest -= self.L[i, k] * white[:, k]
            rest /= self.L[i, i]
        return white

    def transposed(self, B: Array) -> Array:
        """The adjoint, ``L^-T B`` of columns B (p, rows, ...), in the same layout."""
        shape = np.broadcast_shapes(B.shape[2:], self.L.shape[2:])
        found = np.empty((*B.shape[:2], *shape))
        last = len(self.L) - 1
        for i in range(last, -1, -1):
            rest = found[:, i]
            rest[...] = B[:, i]
            for k in range(last, i, -1):
                rest -= self.L[k, i] * found[:, k]
            rest /= self.L[i, i]
        return found

    def slope_weights(self, weights: Array, rows: Array) -> Array:
        """Weights (rows, rows, ...) of dSigma in ``-<P Q', dSigma>/2``, which whitened rows add.

        Args:
            weights: Weights ``P = L^-T B`` (p, rows, ...) of the rows themselves.
            rows: Whitened rows ``L^-1 A`` (p, rows, ...), so that ``Q = Sigma^-1 A``.
        """
        return -0.5 * np.einsum("pr...,ps...->rs...", weights, self.transposed(rows))


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """What makes errors of size one of independent ones, as `Whitener` does of others.

    Attributes:
        sizes: Standard deviations (rows,) or (rows, ...).
    """

    sizes: Array

    def rows(self, A: Array) -> Array:
        """Rows over their standard deviations, of columns A (p, rows, ...)."""
        return np.asarray(A / _lifted(self.sizes, A[0]))

    def transposed(self, B: Array) -> Array:
        """The adjoint, which is the same."""
        return self.rows(B)


class Measured(Protocol[FramesLike_contra]):
    """What the noise needs to know of a model: where it measures, and how joints move that.

    What it computes of poses beforehand, as `Frames`, is its own matter.
    """

    def points_of(self, frames: FramesLike_contra, /) -> Array:
        """Positions (markers, 3, ...) of the markers in the world frame [m]."""

    def motion_of(self, frames: FramesLike_contra, /) -> Array:
        """Derivatives dy/dq (n, rows, ...) of all measured rows by all joints."""

    def motion_slope_of(self, frames: FramesLike_contra, B: Array, /) -> Array:
        """Derivatives (n, ...) of ``<B, dy/dq>`` by all joints, B (n, rows, ...) held fixed."""


class Loaded(Measured[FramesLike_contra], Protocol[FramesLike_contra]):
    """What an error of the model needs besides: how a wrench loads the joints."""

    def torque_of(self, frames: FramesLike_contra, wrench: ArrayLike, /) -> Array:
        """Loads tau (n, ...) of all joints [N m or N]."""

    def torque_slope_of(self, frames: FramesLike_contra, wrench: ArrayLike, s: Array, /) -> Array:
        """Derivatives (n, ...) of ``sum_j s_j tau_j`` by all joints, s (n, ...) held fixed."""


@dataclass(frozen=True, eq=False)
class VisitNoise:
    """Errors of the rows that a visit of a pose measures, and of several visits of it.

    A visit is `readings` readings of all markers (two for loaded minus unloaded), to each of which
    the robot comes anew. With the covariance T(p) of the tracker at each marker, the motion
    ``J = dy/dq`` of the rows, and variances ``s^2`` of the joints and w^2 of white noise, a visit
    scatters by

        V(q) = readings (T + J diag(s^2) J') + diag(w^2).

    The joints move all markers of a visit together, so that V is full. What the model leaves out
    is no scatter: with the variances d^2 of the discrepancy, which is the same in all poses, the
    variances e^2 of joints that are wrong by another small angle in each pose, as by gears that
    are not round, and the covariance E of a `ModelError`, which grows with what the springs do
    under the load,

        D(q, load) = diag(d^2) + J diag(e^2) J' + E(q, load).

    Visits of one pose have errors of their own, but share this one: the mean of v visits has the
    covariance ``V/v + D``, and all of them together have the information

        A' (V/v + D)^-1 A = v A' (V + v D)^-1 A,

    which is concave in v, at most v times that of one visit, and at most ``A' D^-1 A``.
    `covariance_of` therefore gives ``V + v D``: the covariance that one of v visits counts with.

    Arrays are component first, as in `Frames`.

    Attributes:
        tracker: The tracker; None where its errors are part of the white noise.
        tracked: For each marker that the tracker sees, its index among the model's points and the
            first of its three rows.
        repeatability: Standard deviations s (n,) of the joints in one reading [rad or m].
        white: Standard deviations w (rows,) of a visit's rows [m, rad]; or of each visit's
            (rows, ...), as the next but two may be.
        discrepancy: Standard deviations d (rows,) of the model's errors [m, rad].
        within: Poses nearer than this, Euclidean over the revolute joints, share the model's errors
            [rad].
        readings: Readings whose difference or value a row is: two, or one for absolute positions.
        unit: What a metre and a radian are in the units of all these: one, or 1000 where they are
            in millimetres and milliradians; joints are in radians and metres where it is one.
        turns: Standard deviations e (n,) of the joints that the model's errors are as [rad or m];
            none of them for none.
        change: What the discrepancy is (rows,) of differences, where others are read once; None
            where it is the same.
        error: The part of the model's errors that grows with the load; None for none.
        groups: Groups (rows,) of rows that it treats alike, see `ModelError`.
        apart: Whether each visit has an error of the model of its own, as if poses were far apart.
    """

    tracker: Tracker | None
    tracked: tuple[tuple[int, int], ...]
    repeatability: Array
    white: Array
    discrepancy: Array
    within: float = 0.0
    readings: int | Array = 2
    unit: float = 1.0
    turns: Array = field(default_factory=lambda: np.zeros(0))
    change: Array | None = None
    error: ModelError | None = None
    groups: Indices = field(default_factory=lambda: np.zeros(0, dtype=int))
    apart: bool = False

    @cached_property
    def shares(self) -> bool:
        """Whether visits of one pose share an error, so that repeats do not average it out."""
        return not self.apart and self._leaves_out

    @property
    def _leaves_out(self) -> bool:
        """Whether the model leaves anything out."""
        constant = bool(self.discrepancy.any() or self.turns.any())
        return constant or self.error is not None

    @cached_property
    def alone(self) -> "VisitNoise":
        """The noise of visits that share nothing: each has an error of the model of its own."""
        return replace(self, apart=True) if self.shares else self

    @property
    def exact(self) -> "VisitNoise":
        """The same where the model leaves nothing out."""
        nothing = np.zeros_like(self.discrepancy)
        return replace(self, discrepancy=nothing, turns=np.zeros(0), error=None)

    @property
    def is_white(self) -> bool:
        """Whether the errors of all rows are independent, and alike in all poses."""
        still = not (self.repeatability.any() or self.turns.any())
        return self.tracker is None and self.error is None and still

    def of_differences(self, differs: Mask | None) -> "VisitNoise":
        """The same of visits of which some (m,) are differences of two readings; None for none.

        They have twice the variances of a reading, and nothing of what both readings err by.
        """
        if differs is None:
            return self
        readings = np.where(differs, 2.0, 1.0)
        change = self.discrepancy if self.change is None else self.change
        return replace(
            self,
            white=np.multiply.outer(self.white, np.sqrt(readings)),
            discrepancy=np.where(differs, change[:, None], self.discrepancy[:, None]),
            readings=readings,
            turns=np.multiply.outer(self.turns, ~differs),
        )

    def least(self, reach: Sequence[float]) -> "VisitNoise":
        """White errors that are no larger than these, in any pose.

        Information falls as the covariance rises, so that a bound with these holds. Of a tracker
        they are those of the shorter axis of its ellipsoid where it stands nearest.

        Args:
            reach: Upper bounds on the distances of the points from the world's origin [m].
        """
        white = np.square(self.white)
        for point, row in self.tracked:
            least = 0.0 if self.tracker is None else self.tracker.least(reach[point])
            white[row : row + 3] += self.readings * (self.unit * least) ** 2
        still = np.zeros_like(self.repeatability)
        return replace(
            self,
            white=np.sqrt(white),
            tracker=None,
            repeatability=still,
            turns=np.zeros(0),
            error=None,
        )

    @property
    def of_readings(self) -> "VisitNoise | None":
        """The same without errors that grow with the load; None if that is white."""
        left = replace(self, error=None)
        moves = left.tracker is not None or left.repeatability.any()
        return left if moves or left.shares else None

    def scatter_of(self, model: Measured[FramesLike], frames: FramesLike) -> Array:
        """The part V (rows, rows, ...) of the covariance that repeats average out [m^2, rad^2]."""
        return self.scatter(model.points_of(frames), model.motion_of(frames))

    def shared_of(self, model: Loaded[FramesLike], frames: FramesLike, wrench: ArrayLike) -> Array:
        """The part D (rows, rows, ...) that visits of a pose share [m^2, rad^2].

        Args:
            model: The model that is measured.
            frames: The poses.
            wrench: Their loads (..., 6) or (6,) [N, N m].
        """
        motion = model.motion_of(frames)
        return self.shared(motion, None if self.error is None else model.torque_of(frames, wrench))

    def shared(self, motion: Array, torque: Array | None = None) -> Array:
        """The same of rows with motions (n, rows, ...), whose joints have loads (n, ...)."""
        rows = motion.shape[1]
        D = np.zeros((rows, rows, *motion.shape[2:]))
        if self.error is not None and torque is not None:
            D += self.error.covariance(self.error.bends(motion, torque), self.groups)
        if self.turns.any():
            D += _of_joints(motion, self.turns)
        for row, size in enumerate(self.discrepancy):
            D[row, row] += size**2
        return D

    def covariance_of(
        self,
        model: Loaded[FramesLike],
        frames: FramesLike,
        wrench: ArrayLike,
        visits: ArrayLike = 1.0,
    ) -> Array:
        """Covariance ``V + v D`` with which one of v visits of a pose counts.

        Args:
            model: The model that is measured.
            frames: The poses.
            wrench: Their loads (..., 6) or (6,) [N, N m].
            visits: Number v of visits, which broadcasts to the poses (...); one where visits share
                nothing.

        Returns:
            Covariances (rows, rows, ...) [m^2, rad^2].
        """
        Sigma = self.scatter_of(model, frames)
        if self._leaves_out:
            Sigma += self._counted(visits) * self.shared_of(model, frames, wrench)
        return Sigma

    def _counted(self, visits: ArrayLike) -> Array:
        """How often the model's errors of a pose count."""
        return np.asarray(visits, dtype=float) if self.shares else np.ones(1)

    def slope_of(
        self,
        model: Loaded[FramesLike],
        frames: FramesLike,
        S: Array,
        wrench: ArrayLike,
        visits: ArrayLike = 1.0,
    ) -> Array:
        """Derivatives of ``<S, V + v D>`` by all joints, S held fixed.

        ``d<S, J diag(s^2) J'> = 2 sum_j s_j^2 <S J_j, dJ_j>``; the tracker's part follows the
        markers, see `Tracker.slope`, and the model's errors follow motion and loads, see
        `ModelError.slope_weights`.

        Args:
            model: The model that is measured.
            frames: The poses.
            S: Symmetric weights (rows, rows, ...).
            wrench: Loads (..., 6) or (6,) of the poses [N, N m].
            visits: Number v of visits.

        Returns:
            Derivatives (n, ...).
        """
        motion = model.motion_of(frames)
        slope = np.zeros((len(motion), *S.shape[2:]))
        if self.repeatability.any() or self.turns.any():
            weights = np.einsum("rs...,js...->jr...", S, motion)
            weights *= _lifted(self._rates(visits), weights)
            slope += model.motion_slope_of(frames, weights)
        if self.tracker is not None:
            points = model.points_of(frames)[[point for point, _ in self.tracked]]
            own = np.stack([S[row : row + 3, row : row + 3] for _, row in self.tracked])
            by_point = self.unit**2 * self.readings * self.tracker.slope(points, own)
            for (_, row), g in zip(self.tracked, by_point, strict=True):
                slope += np.einsum("ji...,i...->j...", motion[:, row : row + 3], g)
        if self.error is not None:
            B, s = self._error_weights(motion, model.torque_of(frames, wrench), S, visits)
            slope += model.motion_slope_of(frames, B) + model.torque_slope_of(frames, wrench, s)
        return slope

    def load_slope_of(
        self,
        model: Loaded[FramesLike],
        frames: FramesLike,
        S: Array,
        wrench: ArrayLike,
        changes: Sequence[Array],
        visits: ArrayLike = 1.0,
    ) -> list[Array]:
        """Derivatives of ``<S, V + v D>`` by changes of the loads of all joints, S held fixed.

        Args:
            model: The model that is measured.
            frames: The poses.
            S: Symmetric weights (rows, rows, ...).
            wrench: Loads (..., 6) or (6,) of the poses [N, N m].
            changes: How the loads of the joints change (n, ...), one for each way.
            visits: Number v of visits.

        Returns:
            A derivative (...) for each change; zeros where no error follows the load.
        """
        if self.error is None:
            return [np.zeros(S.shape[2:]) for _ in changes]
        motion, torque = model.motion_of(frames), model.torque_of(frames, wrench)
        _, s = self._error_weights(motion, torque, S, visits)
        return [np.einsum("j...,j...->...", s, change) for change in changes]

    def _error_weights(
        self, motion: Array, torque: Array, S: Array, visits: ArrayLike
    ) -> tuple[Array, Array]:
        """How ``<S, v E>`` follows motion (n, rows, ...) and loads (n, ...)."""
        assert self.error is not None
        weights = self._counted(visits) * S
        return self.error.slope_weights(motion, torque, weights, self.groups)

    def sizes(self, visits: ArrayLike = 1.0) -> Array:
        """Standard deviations (rows, ...) by white errors and the discrepancy alone."""
        counted = np.atleast_1d(self._counted(visits))[None]
        return np.sqrt(
            _lifted(self.white**2, counted) + _lifted(self.discrepancy**2, counted) * counted
        )

    def _rates(self, visits: ArrayLike) -> Array:
        """Twice the variances (n, ...) of the joints, as often as these count."""
        rates = np.multiply.outer(self.repeatability**2, 2 * np.asarray(self.readings))
        if not self.turns.any():
            return np.asarray(rates)
        counted = np.atleast_1d(2 * self._counted(visits))
        of_model = _lifted(self.turns**2, counted[None]) * counted
        return np.asarray(_lifted(rates, of_model) + of_model)

    def scatter(self, points: Array, motion: Array) -> Array:
        """V (rows, rows, ...) of points (markers, 3, ...) and motion (n, rows, ...)."""
        rows = motion.shape[1]
        if self.repeatability.any():
            root = np.sqrt(self.readings)
            V = _of_joints(motion, np.multiply.outer(self.repeatability, root))
        else:
            V = np.zeros((rows, rows, *motion.shape[2:]))
        for row, size in enumerate(self.white):
            V[row, row] += size**2
        if self.tracker is not None:
            T = self.tracker.covariance(points[[point for point, _ in self.tracked]])
            for (_, row), own in zip(self.tracked, T, strict=True):
                V[row : row + 3, row : row + 3] += self.unit**2 * self.readings * own
        return V


def _of_joints(motion: Array, sizes: Array) -> Array:
    """``J diag(s^2) J'`` (rows, rows, ...) of motions (n, rows, ...) by joints that err by s.

    Args:
        motion: Motions J.
        sizes: Standard deviations s (n,), or of each pose (n, ...).
    """
    moving = np.flatnonzero(sizes.reshape(len(sizes), -1).any(axis=1))
    rows = motion.shape[1]
    V = np.zeros((rows, rows, *motion.shape[2:]))
    J = motion[moving] * _lifted(sizes[moving], motion)
    for row in range(rows):
        V[row, : row + 1] = np.einsum("j...,jk...->k...", J[:, row], J[:, : row + 1])
        V[:row, row] = V[row, :row]
    return V


def _lifted(numbers: Array, like: Array) -> Array:
    """Numbers (n,) or (n, ...) that multiply arrays (n, rows, ...)."""
    missing = like.ndim - numbers.ndim
    return numbers.reshape(len(numbers), *[1] * missing, *numbers.shape[1:])


@dataclass(frozen=True, eq=False)
class BlockVariances:
    """Variances, and how well they are known.

    Attributes:
        variances: One a kind (c,).
        covariance: Of these (c, c); infinite where a variance is zero and so not bounded below.
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
        model_fit: The fitted variances of the model's part; None where none was fitted.
        repeats: Degrees of freedom of the repeats that told r and s; zero where they were stated.
        turn: The same as r, of orientations [mrad], where they are measured; their rows follow the
            positions of each marker.
        model_turn: The same as w, of orientations [mrad].
        model_change: The same as w and `model_turn`, of differences of two readings [mm, mrad]:
            what both readings err by is not in them.
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
        some = places[:1] if self.tracker is None else places
        still = np.zeros((len(some), width, len(self.joints)))
        return replace(self, joints=np.zeros(len(self.joints))).of_reading(still, some)

    def squared_reading(self, places: Array) -> Array:
        """Mean squared distances (m, k) [mm^2] by which an instrument's readings are off.

        Where its size is unknown, what the model leaves out of each coordinate is part of it.
        """
        width = self.rows * places.shape[1]
        own = np.einsum("mrr->mr", self.of_instrument(places, width))
        own = own.reshape(len(own), places.shape[1], -1)[..., :3].sum(axis=-1)
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

    def of_model(self, motion: Array, differs: Mask | None = None) -> Array:
        """Covariances D (m, r, r) [mm^2] of what the model leaves out.

        Args:
            motion: Motions (m, r, n) of the coordinates by the joints [mm/mrad].
            differs: Which poses (m,) are differences of two readings; None for none.
        """
        noise = self.of_visits(motion.shape[1], 1).of_differences(differs)
        return np.asarray(np.moveaxis(noise.shared(component_first(motion)), -1, 0))

    def of_change(self, motion: Array, places: Array) -> Array:
        """Covariances (m, r, r) of differences of two readings, with what the model leaves out."""
        white = self._white(*self.model_change, motion.shape[1])
        return 2 * self.of_reading(motion, places) + np.diag(white)

    def of_pose(
        self,
        motion: Array,
        places: Array,
        counts: Array | Indices,
        differs: Mask | None = None,
    ) -> Array:
        """Covariances (m, r, r) of means over some readings.

        Args:
            motion: Motions (m, r, n) of the coordinates [mm/mrad].
            places: Where the markers are (m, k, 3), in the frame of the tracker [m].
            counts: Readings (m, k) of each marker, or what those of each row (m, k, rows) are
                worth; where there is none, the coordinates count as independent and of size one.
            differs: Which poses (m,) are differences of two readings; None for none.
        """
        worth = of_rows(counts, motion.shape[1])
        size = np.sqrt(np.where(worth > 0, worth, 1.0))
        D = self.of_model(motion, differs)
        V = self.of_reading(motion, places) / (size[:, :, None] * size[:, None]) + D
        return only_seen(V, worth > 0)


def component_first(A: Array) -> Array:
    """Arrays (c, r, m) of those (m, r, c), as `VisitNoise` has them."""
    return np.ascontiguousarray(np.moveaxis(A, 0, -1).swapaxes(0, 1))


def of_rows(by_marker: Array | Indices | Mask, width: int) -> Array:
    """Numbers (m, width) of all rows, of those (m, k) of markers or (m, k, rows) of their rows."""
    m, k = by_marker.shape[:2]
    if by_marker.ndim == 3:
        return by_marker.reshape(m, width).astype(float)
    return np.repeat(by_marker, width // k, axis=1).astype(float)


def only_seen(V: Array, seen: Mask) -> Array:
    """Covariances (m, r, r) in which rows that were not seen are independent, of size one.

    Args:
        V: Covariances.
        seen: Which markers (m, k) were seen, or which rows (m, r).
    """
    there = of_rows(seen, V.shape[1])
    return np.ascontiguousarray(np.moveaxis(read_alone(np.moveaxis(V, 0, -1), there.T), -1, 0))


def read_alone(V: Array, there: Array | Mask) -> Array:
    """Covariances (r, r, ...) in which rows that are not read are independent, of size one.

    So those that are read have, once whitened, no part in the others: it is as if the others had
    been struck out before.

    Args:
        V: Covariances.
        there: Whether each row (r, ...) is read: true or one, else false or zero.
    """
    there = np.asarray(there, dtype=float)
    found = V * there[:, None] * there
    for row, own in enumerate(there):
        found[row, row] += 1 - own
    return found


def white_kinds(rows: int, width: int) -> list[Array]:
    """Masks (width,) of the coordinates that share a white error: positions, and orientations."""
    if rows == 3:
        return [np.ones(width)]
    turns = np.arange(width) % rows >= 3
    return [(~turns).astype(float), turns.astype(float)]
