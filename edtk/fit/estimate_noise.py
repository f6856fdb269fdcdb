"""How large the errors of tracker, joints and model are, by residual maximum likelihood."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.fit.correlated_noise import RowNoise, whiten_columns
from edtk.fit.distributions import fisher_tail
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements, joint_motion
from edtk.fit.outliers import UNLIKELY, LackOfFit
from edtk.fit.restricted_likelihood import Blocks, fit_variances
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array, Indices, Mask

# Singular values of unit columns that are rounding.
ROUNDING_OF_STRATA = 1e-9
SETTLED_VARIANCE = 1e-8  # change of what a variance adds, over the mean square
POSES_IN_CACHE = 1e5  # numbers of a matrix for each of some poses
MOST_ROWS = 1500  # measurements from which noise is estimated; of more, some poses
MOST_IN_POSE = 150  # measurements of one pose; of more, the first ones
NO_ERRORS = 1e-6  # of the tracker's noise: residuals as small are no errors
ENOUGH_OF_TRACKER = 10  # degrees of freedom from which the tracker's own scatter is a yardstick


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """The coordinates of one pose, N of them, whatever visits and markers they are of.

    Attributes:
        residual: Whitened residuals (N,).
        Q: Orthonormal columns (N, p) of the regressors of all poses.
        motion: Motions (N, n) by errors of the joints that all visits share.
        apart: The same by errors of each visit (N, n visits).
        shared: Displacements (N, lengths places) of each marker that all visits share.
    """

    residual: Array
    Q: Array
    motion: Array
    apart: Array
    shared: Array


@dataclass(frozen=True, eq=False)
class Visited:
    """Measurements, each in a visit of a pose, in units of the tracker's noise.

    Attributes:
        residual: Whitened residuals (m, rows) of the least-squares fit.
        Q: Orthonormal columns (m, rows, p) of its regressors.
        motion: Whitened derivatives (m, rows, n) by the joints, times the standard deviations that
            the joints have for a variance of one.
        pose: Number (m,) of each row's pose and load, from 0.
        visit: Number (m,) of its visit, from 0.
        place: Number (m,) of its pose, load and marker, from 0.
        unit: What a unit of each length of a measurement is, whitened (m, rows, lengths) [1/m].
    """

    residual: Array
    Q: Array
    motion: Array
    pose: Indices
    visit: Indices
    place: Indices
    unit: Array

    def poses(self) -> Iterator[PoseErrors]:
        """The poses, one after another."""
        order = np.argsort(self.pose, kind="stable")
        for rows in np.split(order, np.cumsum(np.bincount(self.pose))[:-1]):
            motion = self.motion[rows]
            N = motion.shape[0] * motion.shape[1]
            yield PoseErrors(
                self.residual[rows].reshape(N),
                self.Q[rows].reshape(N, -1),
                motion.reshape(N, -1),
                _apart(motion, self.visit[rows]).reshape(N, -1),
                _apart(self.unit[rows], self.place[rows]).reshape(N, -1),
            )


def _apart(columns: Array, number: Indices) -> Array:
    """Columns (m, rows, c groups): those of each group of rows, zero in the others."""
    of_group = number == np.unique(number)[:, None]
    return np.concatenate([columns * chosen[:, None, None] for chosen in of_group], axis=-1)


@dataclass(frozen=True)
class Stratum:
    """One part of the residuals.

    Attributes:
        squares: Sum of squares, in units of the tracker's noise.
        dof: Degrees of freedom.
    """

    squares: float
    dof: int

    @property
    def mean_square(self) -> float:
        """Mean square, of expectation one where only the tracker errs, as stated."""
        return self.squares / self.dof

    def __add__(self, other: "Stratum") -> "Stratum":
        """Both together."""
        return Stratum(self.squares + other.squares, self.dof + other.dof)


@dataclass(frozen=True)
class ErrorStrata:
    """Residuals in four parts, in order of what adds to them.

    Of each pose, with C the motions of the joints in each visit of it, J those common to all
    visits, and E what visits have in common at all. J is in C and in E; columns of the regressor
    are ``dy/dq_j tau_j`` and so in J: the fit takes p degrees of freedom of the last part, and
    where only the tracker errs the sums of squares are independent chi-squares.

    Attributes:
        tracker: Outside of C and E: errors of the tracker alone.
        shape: In E outside of C: what all visits show, and no motion of joints makes: tracker and
            discrepancy.
        visits: In C outside of J: visits of a pose differ by motions of joints: tracker and
            repeatability.
        poses: In J, less what the compliances took: tracker, repeatability and discrepancy.
    """

    tracker: Stratum
    shape: Stratum
    visits: Stratum
    poses: Stratum

    @property
    def all(self) -> tuple[Stratum, ...]:
        """Those of them that have degrees of freedom."""
        found = (self.tracker, self.shape, self.visits, self.poses)
        return tuple(stratum for stratum in found if stratum.dof > 0)

    @classmethod
    def of(cls, seen: Visited) -> "ErrorStrata":
        """Split the residuals, pose by pose."""
        found = [Stratum(0.0, 0), Stratum(0.0, 0), Stratum(0.0, 0), Stratum(0.0, 0)]
        for pose in seen.poses():
            found = [before + part for before, part in zip(found, _parts(pose), strict=True)]
        # What is fitted lies in the last part alone.
        found[3] = found[3] + Stratum(0.0, -seen.Q.shape[-1])
        return cls(*found)


def _parts(pose: PoseErrors) -> Iterator[Stratum]:
    """The strata of one pose, before anything was fitted."""
    z = pose.residual
    together = _orthonormal(pose.motion, np.zeros((len(z), 0)))
    moving = _orthonormal(pose.apart, together)
    shape = _orthonormal(pose.shared, np.hstack([together, moving]))
    every = np.hstack([together, moving, shape])
    rest = z - every @ (every.T @ z)
    yield Stratum(float(rest @ rest), len(z) - every.shape[1])
    for U in (shape, moving, together):
        yield Stratum(float(((U.T @ z) ** 2).sum()), U.shape[1])


def _orthonormal(X: Array, apart: Array) -> Array:
    """Orthonormal columns of what X (N, c) spans beyond orthonormal columns `apart` (N, d)."""
    size = np.linalg.norm(X, axis=0)
    unit = X[:, size > 0] / size[size > 0]
    beyond = unit - apart @ (apart.T @ unit)
    U, s, _ = np.linalg.svd(beyond, full_matrices=False)
    found = U[:, s > ROUNDING_OF_STRATA]
    # Once more, as a difference of nearly equal columns is orthogonal only to its own rounding.
    return np.linalg.qr(found - apart @ (apart.T @ found))[0]


def visit_variances(seen: Visited, told: Mask, stated: Array) -> tuple[Array, Array]:
    """Fit ``V = v_0 I + v_1 C C' + v_2 E E'`` to whitened residuals by restricted likelihood.

    Args:
        seen: The residuals.
        told: Mask (3,) of the variances that are fitted.
        stated: Variances (3,) of the others.

    Returns:
        Variances (3,), and their covariance (3, 3); NaN where a variance is zero, or stated.

    Raises:
        numpy.linalg.LinAlgError: The residuals do not tell the variances apart.
    """
    poses = list(seen.poses())
    sizes = np.array([len(pose.residual) for pose in poses])
    alike = (np.flatnonzero(sizes == size) for size in np.unique(sizes))
    known = np.where(told, 0.0, stated)
    parts = (some for same in alike for some in _in_parts(same, sizes))
    blocks = [_blocks([poses[i] for i in some], known) for some in parts]
    found = fit_variances(blocks, told, SETTLED_VARIANCE)
    unknown = found.variances <= 0
    return known + found.variances, np.where(unknown | unknown[:, None], np.nan, found.covariance)


def _in_parts(poses: Indices, sizes: Array) -> list[Indices]:
    """Poses of one size, so many at once that their matrices fit into a core's cache."""
    most = max(int(POSES_IN_CACHE / sizes[poses[0]] ** 2), 1)
    return np.split(poses, range(most, len(poses), most))


def _blocks(poses: list[PoseErrors], known: Array) -> Blocks:
    """Poses of one size, with what tracker, visits and model add to them, of known variances."""
    apart = [pose.apart @ pose.apart.T for pose in poses]
    shared = [pose.shared @ pose.shared.T for pose in poses]
    residual = np.stack([pose.residual for pose in poses])
    eye = np.broadcast_to(np.eye(residual.shape[1]), (len(poses), *apart[0].shape))
    kinds = (eye, np.stack(apart), np.stack(shared))
    fixed = np.einsum("k,kbrs->brs", known, np.stack(kinds))
    design = np.stack([pose.Q for pose in poses])
    return Blocks.dense(fixed, kinds, residual, design)


def visit_residuals(
    model: ElastostaticModel,
    data: Measurements,
    A: Array,
    measured: Array,
    joints: Array,
    own: RowNoise | None = None,
) -> Visited | None:
    """Fit with the tracker's noise alone, and keep what joints and model may have added.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, markers, visits and the tracker's noise.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        joints: Standard deviations (n,) of the joints for a variance of one [rad or m].
        own: Noise of each measurement by itself; that of the measurements by default.

    Returns:
        The residuals; None where no visit has more than one measurement, so that nothing tells
        motions of the joints from errors of the tracker, or compliances are left open.
    """
    if data.alone:
        return None
    rows = _some_visits(data)
    some = data[rows]
    if len(np.unique(some.visits)) == len(some):
        return None
    noise = (data.own_noise if own is None else own)[rows]
    try:
        whitened = Whitened.of(A[rows], noise, model.parameters)
    except SingularPlanError:
        return None
    # The discrepancy is one of lengths.
    unit = some.lengths[:, :, None] * np.eye(A.shape[1])[:, :3]
    return Visited(
        residual=whitened.residual(measured[rows]),
        Q=whitened.Q,
        motion=whiten_columns(joint_motion(model, some) * joints, noise),
        pose=some.pose,
        visit=some.visits,
        place=some.places,
        unit=whiten_columns(unit, noise),
    )


def _some_visits(data: Measurements) -> Indices:
    """Rows of at most so many measurements, whole visits of whole poses as far as these go."""
    if len(data) <= MOST_IN_POSE:
        return np.arange(len(data))
    pose = data.pose
    # Rows of a visit stand together, the first visits of the first poses ahead.
    order = np.lexsort((data.visits, pose))
    first = np.cumsum(np.bincount(pose)) - np.bincount(pose)
    in_pose = np.arange(len(order)) - first[pose[order]]
    chosen = order[in_pose < MOST_IN_POSE][:MOST_ROWS]
    return np.sort(chosen)


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """Estimated sizes of errors, and whether joints move markers together.

    Attributes:
        tracker: Standard deviation of the tracker's errors, over the stated one.
        joints: That of the joints, over the one that a motion of size one is by: degrees, and
            millimetres where they slide.
        discrepancy: That of the model, which visits of a pose share [m].
        std: Standard deviations (3,) of these three; NaN where one is zero or cannot be told.
        told: Whether each of the three can be told from the others.
        F: Mean square of what joints make, over that of the rest.
        p: Probability of so large an F where joints do not move, and the model fits.
        strata: The residuals, split by what moves together.
        by_joints: Root mean square of what joints add to a coordinate, over the tracker's stated
            noise.
        by_model: The same of the discrepancy.
    """

    tracker: float
    joints: float
    discrepancy: float
    std: Array
    told: tuple[bool, bool, bool]
    F: float
    p: float
    strata: ErrorStrata
    by_joints: float
    by_model: float

    @property
    def revisited(self) -> bool:
        """Whether F compares visits of a pose, in which the model has no part."""
        return self.strata.visits.dof > 0

    def relative_dof(self, i: int) -> float:
        """Degrees of freedom of a variance, as if it were a chi-square over them.

        ``2 v^2 / var(v)`` (Satterthwaite 1946), and a standard deviation has half the relative
        error of its square.
        """
        size = (self.tracker, self.joints, self.discrepancy)[i]
        return 0.5 * (size / float(self.std[i])) ** 2

    @property
    def common_dof(self) -> float:
        """Degrees of freedom of the larger of the errors that a visit shares, one at least."""
        dof = self.relative_dof(1 if self.by_joints >= self.by_model else 2)
        return max(dof, 1.0) if np.isfinite(dof) else float(self.strata.poses.dof)

    def to_dict(self) -> dict[str, Any]:
        """The estimates, for JSON; one that cannot be told is null."""
        std = [value if np.isfinite(value) else None for value in self.std.tolist()]
        return {
            "tracker_ratio": self.tracker,
            "tracker_ratio_std": std[0],
            "repeatability_deg": self.joints if self.told[1] else None,
            "repeatability_deg_std": std[1],
            "discrepancy_mm": 1e3 * self.discrepancy if self.told[2] else None,
            "discrepancy_mm_std": None if std[2] is None else 1e3 * std[2],
            "together": {"F": self.F, "p": self.p, "revisited": self.revisited},
        }

    @property
    def moves(self) -> bool:
        """Whether what joints make is larger than the rest, by more than chance."""
        return self.p < UNLIKELY and self.joints > 0

    @property
    def lack_of_fit(self) -> LackOfFit | None:
        """Whether markers of a visit agree better with motions of joints than with the model."""
        strata = self.strata
        apart = yardstick(strata)
        if strata.poses.dof < 1 or apart is None:
            return None
        F = strata.poses.mean_square / apart.mean_square
        return LackOfFit(
            F=F,
            p=float(fisher_tail(F, strata.poses.dof, apart.dof)),
            pure_error=float(np.sqrt(apart.mean_square)),
            common=float(np.hypot(self.by_joints, self.by_model)),
            dof=(strata.poses.dof, apart.dof),
        )


@dataclass(frozen=True)
class StatedSizes:
    """What a study says of errors beside the tracker's, and what of it the sheet shall tell.

    Attributes:
        joints: Standard deviation of the joints, in the unit of the estimate.
        discrepancy: That of the model [m].
        estimated: Whether tracker, joints and discrepancy (3,) are estimated, where they are told.
    """

    joints: float = 0.0
    discrepancy: float = 0.0
    estimated: tuple[bool, bool, bool] = (True, True, True)


def estimate_noise(seen: Visited, stated: StatedSizes = StatedSizes()) -> NoiseEstimate | None:
    """Split the residuals by what moves together, test whether joints move, estimate the variances.

    Where joints do not move and the model fits, mean squares of strata are independent chi-squares
    over their degrees of freedom, and the ratio F has Fisher's distribution.

    Args:
        seen: Residuals of the least-squares fit with the tracker's noise.
        stated: Sizes that count where they are not estimated.

    Returns:
        The estimate; None where nothing but joints can have made the residuals, so that the
        tracker's errors cannot be told from theirs, or nothing else is left; or the residuals do
        not tell variances.
    """
    strata = ErrorStrata.of(seen)
    rest = yardstick(strata)
    moved = strata.visits if strata.visits.dof > 0 else strata.poses
    if rest is None or moved.dof < 1 or rest.mean_square < NO_ERRORS**2:
        return None
    free = told_apart(strata) & stated.estimated
    known = np.square([0.0, stated.joints, stated.discrepancy])
    told = free | (known > 0)
    try:
        v, covariance = visit_variances(seen, free, known)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(v).all():
        return None
    size = np.sqrt(v)
    std = np.divide(np.sqrt(np.diag(covariance)), 2 * size, out=np.full(3, np.nan), where=size > 0)
    F = moved.mean_square / rest.mean_square
    moved_by = np.sqrt(np.mean((seen.motion**2).sum(axis=-1)))
    shared_by = np.sqrt(np.mean((seen.unit**2).sum(axis=-1)))
    return NoiseEstimate(
        tracker=float(size[0]),
        joints=float(size[1]),
        discrepancy=float(size[2]),
        std=std,
        told=(bool(told[0]), bool(told[1]), bool(told[2])),
        F=float(F),
        p=float(fisher_tail(F, moved.dof, rest.dof)),
        strata=strata,
        by_joints=float(size[1] * moved_by),
        by_model=float(size[2] * shared_by),
    )


def yardstick(strata: ErrorStrata) -> Stratum | None:
    """The tracker's scatter; with what all visits show beside motions of joints where it is poor.

    Without a discrepancy both are the same, and a discrepancy hides motions of the joints rather
    than feigning them.
    """
    if strata.tracker.dof >= ENOUGH_OF_TRACKER:
        return strata.tracker
    both = strata.tracker + strata.shape
    return both if both.dof > 0 else None


def told_apart(strata: ErrorStrata) -> Mask:
    """Which of tracker, joints and discrepancy (3,) can be told apart.

    The discrepancy needs a second yardstick beside that of the joints: visits that differ, or
    markers whose shape all visits see beside the tracker's own scatter.
    """
    second = strata.visits.dof > 0 or (strata.tracker.dof > 0 and strata.shape.dof > 0)
    return np.array([True, True, second])
