"""A fit of geometry and springs, judged: what it is worth, and each pose predicted without it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.fit.fitted_geometry import (
    FittedGeometry,
    GeometricFit,
    ToldBefore,
    TurnResiduals,
    loading_of,
    student_quantile,
)
from edtk.fit.least_squares import ALONE, alike
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import WHITE_SHARE, PoseRows, known_before
from edtk.fit.prior import Prior, PriorRows
from edtk.fit.same_poses import SINGULAR
from edtk.measure.few_columns import Beside, sandwich
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import Parameter
from edtk.measure.position_noise import PositionNoise
from edtk.measure.rest import Loads
from edtk.measure.whitening import Precision, Scatter, diagonal_blocks
from edtk.robots.frames import MM
from edtk.system.typing import Array

IN_CACHE = 1_000_000  # numbers of a matrix for each of some poses
# Of a direction of the prior, that its own rows leave: all else tells it a thousand times worse.
UNTOLD = 1e-6


def judge_fit(
    model: MeasuredModel,
    theta: Array,
    noise: PositionNoise,
    weighting: tuple[Scatter, Array],
    data: MarkerPositions,
    loads: Loads | None,
    beside: tuple[tuple[Parameter, ...], Array, Array, Array | None],
    prior: Prior,
) -> GeometricFit:
    """The fit with its covariance, and each pose as it is predicted without it.

    Parameters have the covariance ``R^-1 S R^-T``, ``S = sum_b Q_b' V_b Q_b``, of any weighted
    least squares whose weights are not the inverse of V (Huber 1967).

    Args:
        model: The identified parameters.
        theta: Their values (p,) in SI units.
        noise: The errors of a pose, and so V.
        weighting: Covariances (m, 3k, 3k) of the poses with one size of the model's error for all
            joints, by which the fit weighted them, and weights (m,) of a robust loss.
        data: The positions.
        loads: What loads the joints.
        beside: Open parameters, how they hang on the others, and where the markers were placed
            and how they were turned there.
        prior: What is known of the parameters before, whose rows count as those of poses do.
    """
    common, weights = weighting
    open_parameters, shares, placed, placed_turns = beside
    means = data.means
    before = known_before(prior, model, theta)
    torque = loading_of(model.bending(theta), means, loads)
    rows = PoseRows.of(model, theta, means, torque, before)
    trust = rows.weights(weights)
    work = rows.working(common, means).over(trust)
    V = noise.of_pose(rows.motion, rows.places, rows.worth(data), rows.differs(means))
    told = _Told.of(rows, work)
    # Sizes that each joint has of its own may be those of one wrong pose, which they would hide.
    out = _LeftOutPoses.of(told, V.over(trust), common.over(trust))
    fitted = FittedGeometry(
        model=model,
        theta=theta,
        covariance=out.covariance,
        open_parameters=open_parameters,
        shares=shares,
        noise=noise,
        placed=placed,
        placed_turns=placed_turns,
    )
    left = _LeftOutVisits.of(out, means, weights, noise.model_fit is not None)
    dof = fitted.dof(rows.motion[: len(means)], rows.places[: len(means)])
    half = left.std * _by_marker(student_quantile(dof), means)
    residual = means.same_poses.back(_by_marker(rows.residual, means))
    residual, left_out, left_out_half = parts = [
        part / MM + np.where(means.rows_seen, 0.0, np.nan) for part in (residual, left.errors, half)
    ]
    turns = [part[..., 3:] for part in parts]
    return GeometricFit(
        fitted=fitted,
        data=data,
        structural=model.p,
        redundant=(),
        open=(),
        placed=np.nan,
        residual=residual[..., :3],
        left_out=left_out[..., :3],
        left_out_half=left_out_half[..., :3],
        turns=None if means.turns is None else TurnResiduals(*turns),
        surprise=left.surprise,
        independent=left.independent,
        weights=weights,
        told_before=_told_before(out, prior, before, model, theta, float(np.median(dof))),
    )


def left_out_alone(model: MeasuredModel, theta: Array, means: MarkerPositions) -> Array:
    """Measured less predicted (m, k, 3) [m] of poses that are left out, of base and tools alone.

    All means have equal weights, as where a robot is placed.

    Args:
        model: The drawing.
        theta: Its parameters (p,), of base and tools where they fit best.
        means: Absolute readings, a visit a pose.
    """
    means = replace(means, readings=None)
    own = [i for i, one in enumerate(model.parameters) if one.place in ("base", "tool")]
    some = model.with_parameters(tuple(model.parameters[i] for i in own))
    rows = PoseRows.of(some, theta[own], means, None)
    worth = means.same_poses.worth.reshape(rows.residual.shape)
    still = Scatter(diagonal_blocks(0.0 * means.same_poses.worth), rows.motion[..., :0])
    V = still.with_white(1 / np.where(worth > 0, worth, 1.0))
    told = _Told(Beside.of(rows.columns.independent(), V), rows.residual, V, len(means))
    errors = [(poses.without @ poses.residual[..., None])[..., 0] for _, poses in told.parts]
    each = means.same_poses.back(_by_marker(np.concatenate(errors), means)) / MM
    return np.where(means.rows_seen, each, np.nan)[..., :3]


def _by_marker(rows: Array, means: MarkerPositions) -> Array:
    """Rows of poses, and of what was known behind them, as those of the poses (m, k, rows)."""
    return rows[: len(means)].reshape(means.rows_seen.shape)


def _told_before(
    out: "_LeftOutPoses",
    prior: Prior,
    before: PriorRows,
    model: MeasuredModel,
    theta: Array,
    dof: float,
) -> ToldBefore | None:
    """What was known before, beside what all else says of the same; None where nothing was."""
    if prior.is_flat:
        return None
    p = len(theta)
    mean, std = np.full(p, np.nan), np.full(p, np.nan)
    apart = before.values - before.rows @ (theta / model.scales)
    for row, i in enumerate(before.parameters):
        error, covariance, rank = out.of_rows(before.rows[[row]], apart[[row]])
        if not rank:  # nothing else says anything of it
            continue
        size = before.rows[row, i]
        mean[i] = (before.values[row] - error[0]) / size * model.scales[i]
        # The row's own error, of size one, is a part of that of the difference.
        std[i] = np.sqrt(max(covariance[0, 0] - 1, 0.0)) / size * model.scales[i]
    rows = slice(len(before.parameters), len(before))
    error, covariance, rank = out.of_rows(before.rows[rows], apart[rows])
    square = float(error @ np.linalg.pinv(covariance, rcond=SINGULAR, hermitian=True) @ error)
    count = float(np.einsum("rp,pq,rq->", before.rows, out.H, before.rows)) / (1 + WHITE_SHARE)
    return ToldBefore(prior, mean, std, square, rank, dof, count)


@dataclass(frozen=True, eq=False)
class _Told:
    """What the weighted rows of all poses tell of the parameters.

    Attributes:
        beside: Columns X of all blocks and weights W, with C (p, p), ``C C' = H = (X' W X)^-1``.
        residual: Residuals (m, r).
        work: The covariances that W are the inverse of.
        poses: How many of the blocks are poses; these come first.
    """

    beside: Beside
    residual: Array
    work: Scatter
    poses: int

    @classmethod
    def of(cls, rows: PoseRows, work: Scatter) -> "_Told":
        """Of rows with weights that are not those of their errors."""
        poses = len(rows.residual) - rows.beside
        return cls(Beside.of(rows.columns, work), rows.residual, work, poses)

    @cached_property
    def H(self) -> Array:
        """``(X' W X)^-1`` (p, p)."""
        return np.asarray(self.beside.root @ self.beside.root.T)

    def sandwich(self, V: Scatter) -> Array:
        """``C' X' W V W X C`` (p, p) of the errors' covariances V."""
        root = self.beside.root
        return root.T @ sandwich(self.beside.design, self.beside.weights, V) @ root

    @property
    def parts(self) -> Iterator[tuple[slice, "_SomePoses"]]:
        """Poses, so many at once that their matrices stay in a core's cache."""
        r = self.residual.shape[1]
        step = max(1, IN_CACHE // r**2)
        for first in range(0, self.poses, step):
            some = slice(first, min(first + step, self.poses))
            columns = self.beside.design[some].combined(self.beside.root)
            fitted = columns @ np.swapaxes(columns, 1, 2)
            residual, weights = self.residual[some], self.beside.weights[some]
            yield some, _SomePoses(residual, weights, self.work[some].dense, columns, fitted)


@dataclass(frozen=True, eq=False)
class _SomePoses:
    """Some of the poses, of r rows each.

    Attributes:
        residual: Residuals (m, r).
        weights: W.
        work: ``W^-1`` (m, r, r).
        columns: ``X C`` (m, r, p), orthonormal beside the weights of all.
        fitted: ``F = X H X'`` (m, r, r).
    """

    residual: Array
    weights: Precision
    work: Array
    columns: Array
    fitted: Array

    def of_residuals(self, V: Scatter, S: Array) -> Array:
        """Covariances (m, r, r) of the residuals, ``V - V W F - F W V + X C S C' X'``.

        Args:
            V: Covariances of the errors.
            S: The `sandwich` of all poses.
        """
        crossed = V.times(self.weights.times(self.fitted))
        spread = self.columns @ S @ np.swapaxes(self.columns, 1, 2)
        return V.dense - crossed - np.swapaxes(crossed, 1, 2) + spread

    @cached_property
    def without(self) -> Array:
        """T (m, r, r), ``T r`` the residuals r of a fit without the pose, see `_LeftOutPoses`.

        A pose that alone tells something leaves nothing to compare it with: its residual is zero
        there.
        """
        left = self.work - self.fitted
        try:
            np.linalg.cholesky(left - ALONE * self.work)
        except np.linalg.LinAlgError:
            root = np.linalg.inv(np.linalg.cholesky(self.work))
            values, vectors = np.linalg.eigh(root @ left @ np.swapaxes(root, 1, 2))
            told = values > ALONE
            inverse = np.divide(told, values, out=np.zeros_like(values), where=told)
            both = np.swapaxes(root, 1, 2) @ vectors
            return np.asarray(self.work @ (both * inverse[:, None]) @ np.swapaxes(both, 1, 2))
        return np.asarray(self.work @ np.linalg.inv(left))

    def surprise(self, R: Array) -> Array:
        """Squared sizes (m,) of errors left out, over covariances of which some are singular.

        Errors left out are sums of the residuals that can be undone, so that these have the same.

        Args:
            R: Covariances (m, r, r) of the residuals.
        """
        # The least that counts, beside the mean of those of a pose: of most sheets all of them do.
        sizes = np.einsum("mrr->m", R) / np.einsum("mrr->m", self.work)
        try:
            np.linalg.cholesky(R - SINGULAR * sizes[:, None, None] * self.work)
        except np.linalg.LinAlgError:
            root = np.linalg.inv(np.linalg.cholesky(self.work))
            inner = root @ R @ np.swapaxes(root, 1, 2)
            inverse = np.linalg.pinv(inner, rcond=SINGULAR, hermitian=True)
            e = (root @ self.residual[..., None])[..., 0]
            return np.asarray(np.einsum("mr,mrs,ms->m", e, inverse, e))
        solved = np.linalg.solve(R, self.residual[..., None])[..., 0]
        return np.asarray((self.residual * solved).sum(axis=1))


@dataclass(frozen=True, eq=False)
class _LeftOutPoses:
    """Poses as they are predicted without them.

    With weights W of the blocks and ``F_b = X_b H X_b'``, the residual r of a pose b becomes
    ``e = T r``, ``T = W^-1 (W^-1 - F_b)^-1``, where the fit is made without it: exactly so where
    the model is linear. The covariance of e is that of r on both sides of T.

    Attributes:
        errors: Measured less predicted coordinates (m, r) [mm].
        covariance_of_errors: Of those of each pose (m, r, r) [mm^2].
        common: The same with one size of the model's error for all joints.
        surprise: Squared sizes (m,) of the errors over covariances.
        covariance: Of the parameters (p, p), in their units: ``H S H`` (Huber 1967).
        H: ``(X' W X)^-1`` (p, p).
    """

    errors: Array
    covariance_of_errors: Array
    common: Array
    surprise: Array
    covariance: Array
    H: Array

    @classmethod
    def of(cls, told: _Told, V: Scatter, common: Scatter) -> "_LeftOutPoses":
        """Of poses whose errors have covariances V, and surprise beside others."""
        S, of_common = told.sandwich(V), told.sandwich(common)
        m, r = told.poses, told.residual.shape[1]
        errors, surprise, covariances = np.empty((m, r)), np.empty(m), np.empty((2, m, r, r))
        for some, poses in told.parts:
            T = poses.without
            errors[some] = (T @ poses.residual[..., None])[..., 0]
            R = poses.of_residuals(common[some], of_common)
            both = np.stack([poses.of_residuals(V[some], S), R])
            covariances[:, some] = T @ both @ np.swapaxes(T, 1, 2)
            surprise[some] = poses.surprise(R)
        root = told.beside.root
        own, shared = covariances
        return cls(errors, own, shared, surprise, root @ S @ root.T, told.H)

    def of_rows(self, own: Array, apart: Array) -> tuple[Array, Array, int]:
        """Rows of the prior without them: in the directions that all else tells, too.

        Args:
            own: The rows (c, p).
            apart: What the estimate is off by there (c,).

        Returns:
            Errors (c,) in units of the prior's own, their covariance (c, c), and its rank.
        """
        # Rows of the prior have errors of size one, and weights as `working` has them.
        size = 1 + WHITE_SHARE
        P = own @ self.H @ own.T / size
        V = np.eye(len(own)) / size
        left, U = np.linalg.eigh(np.eye(len(own)) - P)
        told = left > UNTOLD
        hidden = (U[:, told] / left[told]) @ U[:, told].T
        of_residual = V - P @ V - V @ P + own @ self.covariance @ own.T / size
        return hidden @ apart, size * hidden @ of_residual @ hidden, int(told.sum())


@dataclass(frozen=True, eq=False)
class _LeftOutVisits:
    """Visits by the mean of their pose and differences, each predicted without itself alone.

    Attributes:
        errors: Measured less predicted coordinates (m, k, rows) [mm].
        std: Their standard deviations (m, k, rows).
        surprise: Squared sizes (m,) over covariances: that of a visit, or where the others of its
            pose are known, whichever is larger.
        independent: As many independent coordinates tell as much, see `independent_coordinates`.
    """

    errors: Array
    std: Array
    surprise: Array
    independent: float

    @classmethod
    def of(
        cls, out: _LeftOutPoses, means: MarkerPositions, weights: Array, scaled: bool
    ) -> "_LeftOutVisits":
        """Of rows that are independent, see `SamePoses`.

        Args:
            out: These.
            means: The visits.
            weights: Weights (m,) of a robust loss.
            scaled: Whether the size of the errors was fitted.
        """
        same, C = means.same_poses, out.covariance_of_errors
        own = _by_marker(np.einsum("mrr->mr", C), means)
        std = np.sqrt(np.maximum(same.variances(own), 0.0))
        # A pose that a robust loss trusts less surprises all the same.
        surprise = out.surprise / weights
        for visits, each in same.surprise(out.common * weights[:, None, None], out.errors):
            surprise[visits] = each
        read = std.reshape(len(C), -1) > 0
        read &= means.rows_seen.reshape(read.shape)
        unit = np.divide(1.0, std.reshape(read.shape), out=np.zeros(read.shape), where=read)
        pairs = same.of_pairs(C)
        total = sum(alike(V * unit[i, :, None] * unit[j, None], scaled) for i, j, V in pairs)
        count = float(means.rows_seen.sum()) ** 2 / total if total > 0 else 0.0
        return cls(same.back(_by_marker(out.errors, means)), std, surprise, count)
