"""Noise of a visit: tracker, joints that come back, and what the model leaves out."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.model_error import ModelError
from edtk.measure.whitening import lifted
from edtk.robots.robot import joint_distance
from edtk.system.typing import Array, Indices, Mask

FramesLike = TypeVar("FramesLike")
FramesLike_contra = TypeVar("FramesLike_contra", contravariant=True)

SAME = 1e-9  # [rad]: poses nearer than this are one pose, whatever the distance that is asked for


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

    def to_dict(self) -> dict[str, Any]:
        """Plain data [m]."""
        return {
            "position": self.position.tolist(),
            "along": list(self.along),
            "across": list(self.across),
        }

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

    def to_dict(self) -> dict[str, Any]:
        """Plain data [m, rad], as certificates hold it: the white part, and the rest."""
        error = {} if self.error is None else {"model_error": self.error.to_dict(self.unit)}
        return {
            "sigma": (self.white / self.unit).tolist(),
            "noise": {
                "tracker": None if self.tracker is None else self.tracker.to_dict(),
                "repeatability": (self.repeatability / self.unit).tolist(),
                "discrepancy": (self.discrepancy / self.unit).tolist(),
                "within": self.within,
                "readings": self.readings,
                **error,
            },
        }

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
            weights *= lifted(self._rates(visits), weights)
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
            lifted(self.white**2, counted) + lifted(self.discrepancy**2, counted) * counted
        )

    def _rates(self, visits: ArrayLike) -> Array:
        """Twice the variances (n, ...) of the joints, as often as these count."""
        rates = np.multiply.outer(self.repeatability**2, 2 * np.asarray(self.readings))
        if not self.turns.any():
            return np.asarray(rates)
        counted = np.atleast_1d(2 * self._counted(visits))
        of_model = lifted(self.turns**2, counted[None]) * counted
        return np.asarray(lifted(rates, of_model) + of_model)

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
    J = motion[moving] * lifted(sizes[moving], motion)
    for row in range(rows):
        V[row, : row + 1] = np.einsum("j...,jk...->k...", J[:, row], J[:, : row + 1])
        V[:row, row] = V[row, :row]
    return V
