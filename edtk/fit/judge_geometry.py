"""A fit of geometry and springs, judged: what it is worth, and each pose predicted without it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.fit.distributions import student_quantile
from edtk.fit.fitted_geometry import (
    FittedGeometry,
    GeometricFit,
    ToldBefore,
    TurnResiduals,
    loading_of,
)
from edtk.fit.least_squares import ALONE, alike
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import WHITE_SHARE, PoseRows, known_before
from edtk.fit.prior import Prior, PriorRows
from edtk.fit.same_poses import SINGULAR, Groups, SamePoses, blocks_of, surprise_of
from edtk.measure.equilibrium import Loads
from edtk.measure.few_columns import Beside, sandwich
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import Parameter
from edtk.measure.position_noise import PositionNoise
from edtk.measure.whitening import Precision, Scatter, diagonal_blocks
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

IN_CACHE = 1_000_000  # numbers of a matrix for each of some poses
# Of a direction of the prior, that its own rows leave: all else tells it a thousand times worse.
UNTOLD = 1e-6


def judge_fit(
    model: MeasuredModel,
    theta: Array,
    noise: PositionNoise,
    weighting: tuple[PositionNoise, Array],
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
        weighting: The same with one size of the model's error for all joints, by which the fit
            weighted the poses, and weights (m,) of a robust loss.
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
    work = rows.working(rows.errors(common), means).over(trust)
    told = _Told.of(rows, work)
    # Sizes that each joint has of its own may be those of one wrong pose, which they would hide.
    out = _LeftOutPoses.of(told, *(PoseErrors.of(rows, one, trust) for one in (noise, common)))
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
    own = rows.motion[: len(means)], rows.places[: len(means)]
    dof = fitted.dof(*own, means.wrench, means.is_difference)
    half = _by_marker(out.std * student_quantile(0.975, dof), means)
    residual = means.same_poses.back(_by_marker(rows.residual, means))
    every = (residual, _by_marker(out.errors, means), half)
    residual, left_out, left_out_half = parts = [
        part / MM + np.where(means.rows_seen, 0.0, np.nan) for part in every
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
        surprise=out.surprise,
        independent=out.independent(means.rows_seen, noise.model_fit is not None),
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
    told = _Told(Beside.of(rows.columns.independent(), V), rows.residual, V, means.same_poses)
    errors = np.zeros_like(rows.residual)
    for poses in told.parts:
        errors[poses.group.members] = poses.left_out
    return np.where(means.rows_seen, _by_marker(errors, means) / MM, np.nan)[..., :3]


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
class PoseErrors:
    """Covariances of rows, of which those of one pose have the changes of its visits in common.

    Attributes:
        apart: What errs in each row by itself (m, r, r).
        change: Standard deviations (m, r) of what each visit errs by besides, under a load; no rows
            where there is nothing.
        trust: Weights (m,) of a robust loss, over which all covariances are.
    """

    apart: Scatter
    change: Array
    trust: Array

    @classmethod
    def of(cls, rows: PoseRows, noise: PositionNoise, trust: Array) -> "PoseErrors":
        """Of a noise."""
        still = noise.without_changes
        change = np.outer(rows.same.changed, np.sqrt(noise.of_changes(rows.residual.shape[1])))
        return cls(rows.errors(still).over(trust), change if change.any() else change[:0], trust)

    def roots(self, group: Groups) -> Array:
        """What changes of the visits make of the rows of their pose (G, s, s, r)."""
        if not len(self.change):
            return np.zeros((*group.members.shape, 0, self.apart.together.shape[1]))
        found = group.roots(self.change[group.members])
        return np.asarray(found / np.sqrt(self.trust[group.members])[..., None, None])

    def times(self, group: Groups, columns: Array) -> Array:
        """Covariances of the rows of some poses times columns (G, s r, c)."""
        G, s = group.members.shape
        C = columns.reshape(G, s, -1, columns.shape[-1])
        own = self.apart[group.members.ravel()].times(C.reshape(G * s, *C.shape[2:]))
        U = self.roots(group)
        shared = np.einsum("gair,gbir,gbrc->garc", U, U, C, optimize=True)
        return np.asarray((own.reshape(C.shape) + shared).reshape(columns.shape))

    def dense(self, group: Groups) -> Array:
        """Covariances (G, s r, s r) of the rows of some poses."""
        G, s = group.members.shape
        own = self.apart[group.members.ravel()].dense
        V = blocks_of(own.reshape(G, s, *own.shape[1:]))
        U = self.roots(group)
        by_row = np.einsum("gair,gbir->rgab", U, U)
        r = np.arange(len(by_row))
        V.reshape(G, s, len(r), s, len(r))[:, :, r, :, r] += by_row
        return V


@dataclass(frozen=True, eq=False)
class _Told:
    """What the weighted rows of all poses tell of the parameters.

    Attributes:
        beside: Columns X of all blocks and weights W, with C (p, p), ``C C' = H = (X' W X)^-1``.
        residual: Residuals (m, r).
        work: The covariances that W are the inverse of.
        same: Of which visits the first blocks are; any others are of no pose.
    """

    beside: Beside
    residual: Array
    work: Scatter
    same: SamePoses

    @classmethod
    def of(cls, rows: PoseRows, work: Scatter) -> "_Told":
        """Of rows with weights that are not those of their errors."""
        return cls(Beside.of(rows.columns, work), rows.residual, work, rows.same)

    @cached_property
    def H(self) -> Array:
        """``(X' W X)^-1`` (p, p)."""
        return np.asarray(self.beside.root @ self.beside.root.T)

    def sandwich(self, V: PoseErrors) -> Array:
        """``C' X' W V W X C`` (p, p) of the errors' covariances V."""
        root = self.beside.root
        S = root.T @ sandwich(self.beside.design, self.beside.weights, V.apart) @ root
        for poses in self.parts if len(V.change) else ():
            U = V.roots(poses.group)
            G, s, _, r = U.shape
            Y = poses.weighted(poses.columns).reshape(G, s, r, -1)
            Z = np.einsum("gair,garp->girp", U, Y).reshape(-1, Y.shape[-1])
            S = S + Z.T @ Z
        return np.asarray(S)

    @property
    def parts(self) -> Iterator["_SomePoses"]:
        """Poses, so many at once that their matrices stay in a core's cache."""
        r = self.residual.shape[1]
        for every in self.same.every:
            step = max(1, IN_CACHE // (r * every.members.shape[1]) ** 2)
            for first in range(0, len(every.members), step):
                yield self._some(every[first : first + step])

    def _some(self, group: Groups) -> "_SomePoses":
        """Some of the poses, of as many visits each."""
        visits = group.members.ravel()
        shape = (len(group.members), group.members.shape[1] * self.residual.shape[1])
        columns = self.beside.design[visits].combined(self.beside.root)
        columns = columns.reshape(*shape, columns.shape[-1])
        fitted = columns @ np.swapaxes(columns, 1, 2)
        own = self.work[visits].dense
        work = blocks_of(own.reshape(*group.members.shape, *own.shape[1:]))
        residual, weights = self.residual[visits].reshape(shape), self.beside.weights[visits]
        return _SomePoses(group, residual, weights, work, columns, fitted)


@dataclass(frozen=True, eq=False)
class _SomePoses:
    """Some of the poses, of s visits with r rows each, as independent rows.

    Attributes:
        group: Their visits.
        residual: Residuals (G, s r).
        weights: W, of one visit after another.
        work: ``W^-1`` (G, s r, s r).
        columns: ``X C`` (G, s r, p), orthonormal beside the weights of all.
        fitted: ``F = X H X'`` (G, s r, s r).
    """

    group: Groups
    residual: Array
    weights: Precision
    work: Array
    columns: Array
    fitted: Array

    def weighted(self, columns: Array) -> Array:
        """``W C`` (G, s r, c) of columns C."""
        each = columns.reshape(self.group.members.size, -1, columns.shape[-1])
        return self.weights.times(each).reshape(columns.shape)

    def of_residuals(self, V: PoseErrors, S: Array) -> Array:
        """Covariances (G, s r, s r) of the residuals, ``V - V W F - F W V + X C S C' X'``.

        Args:
            V: Covariances of the errors.
            S: The `sandwich` of all poses.
        """
        crossed = V.times(self.group, self.weighted(self.fitted))
        spread = self.columns @ S @ np.swapaxes(self.columns, 1, 2)
        return V.dense(self.group) - crossed - np.swapaxes(crossed, 1, 2) + spread

    @property
    def left_out(self) -> Array:
        """Errors (G, s, r) of the visits of poses that are left out."""
        rows = (self.without @ self.residual[..., None]).reshape(*self.group.members.shape, -1)
        return self.group.back_to_visits(rows)

    @cached_property
    def without(self) -> Array:
        """T (G, s r, s r), ``T r`` the residuals r of a fit without the pose, see `_LeftOutPoses`.

        A pose that alone tells something leaves nothing to compare it with: its residual is zero
        there.
        """
        left = self.work - self.fitted
        try:
            np.linalg.cholesky(left - ALONE * self.work)
        except np.linalg.LinAlgError:
            root = np.linalg.inv(np.linalg.cholesky(self.work))
            values, vectors = eigenpairs(root @ left @ np.swapaxes(root, 1, 2))
            told = values > ALONE
            inverse = np.divide(told, values, out=np.zeros_like(values), where=told)
            both = np.swapaxes(root, 1, 2) @ vectors
            return np.asarray(self.work @ (both * inverse[:, None]) @ np.swapaxes(both, 1, 2))
        return np.asarray(self.work @ np.linalg.inv(left))

    def surprise(self, R: Array, trust: Array) -> Array:
        """Squared sizes (G, s) of errors of visits left out, see `surprise_of`.

        A pose that a robust loss trusts less surprises all the same.

        Args:
            R: Covariances (G, s r, s r) of the residuals.
            trust: Weights (m,) of such a loss.
        """
        own = trust[self.group.members]
        if own.shape[1] == 1:
            return self._alone(R)[:, None] / own
        root = np.repeat(np.sqrt(own), R.shape[1] // own.shape[1], axis=1)
        both = self.without * root[:, :, None]
        C = both @ R @ np.swapaxes(both, 1, 2)
        return surprise_of(self.group.of_visits(C), self.left_out)

    def _alone(self, R: Array) -> Array:
        """Squared sizes (G,) of errors left out, over covariances of which some are singular.

        Errors left out are sums of the residuals that can be undone, so that these have the same.
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
    """Poses as they are predicted without them, with all their visits.

    With weights W of the blocks and ``F_b = X_b H X_b'``, the residual r of a pose b becomes
    ``e = T r``, ``T = W^-1 (W^-1 - F_b)^-1``, where the fit is made without it: exactly so where
    the model is linear. The covariance of e is that of r on both sides of T.

    Attributes:
        errors: Measured less predicted coordinates (m, r) of the visits [mm].
        of_visits: Their covariances (G, s r, s r) of the visits (G, s) of some poses [mm^2].
        surprise: Squared sizes (m,) of the errors over covariances, with one size of the model's
            error for all joints: that of a visit, or where the others of its pose are known,
            whichever is larger.
        covariance: Of the parameters (p, p), in their units: ``H S H`` (Huber 1967).
        H: ``(X' W X)^-1`` (p, p).
    """

    errors: Array
    of_visits: list[tuple[Indices, Array]]
    surprise: Array
    covariance: Array
    H: Array

    @classmethod
    def of(cls, told: _Told, V: PoseErrors, common: PoseErrors) -> "_LeftOutPoses":
        """Of poses whose errors have covariances V, and surprise beside others."""
        S, of_common = told.sandwich(V), told.sandwich(common)
        m, r = len(told.same.pose), told.residual.shape[1]
        errors, surprise, covariances = np.empty((m, r)), np.empty(m), []
        for poses in told.parts:
            group, T = poses.group, poses.without
            errors[group.members] = poses.left_out
            own = T @ poses.of_residuals(V, S) @ np.swapaxes(T, 1, 2)
            covariances.append((group.members, group.of_visits(own)))
            R = poses.of_residuals(common, of_common)
            surprise[group.members] = poses.surprise(R, common.trust)
        root = told.beside.root
        return cls(errors, covariances, surprise, root @ S @ root.T, told.H)

    @cached_property
    def std(self) -> Array:
        """Standard deviations (m, r) of the errors of visits."""
        found = np.zeros_like(self.errors)
        for visits, V in self.of_visits:
            variances = np.einsum("grr->gr", V).reshape(*visits.shape, -1)
            found[visits] = np.sqrt(np.maximum(variances, 0.0))
        return found

    def independent(self, seen: Mask, scaled: bool) -> float:
        """As many independent coordinates tell as much, see `independent_coordinates`.

        Args:
            seen: Which coordinates of the visits (m, k, rows) were read.
            scaled: Whether the size of the errors was fitted.
        """
        read = (self.std > 0) & seen.reshape(self.std.shape)
        unit = np.divide(1.0, self.std, out=np.zeros(read.shape), where=read)
        total = 0.0
        for visits, V in self.of_visits:
            own = unit[visits].reshape(len(visits), -1)
            total += alike(V * own[:, :, None] * own[:, None], scaled)
        return float(seen.sum()) ** 2 / total if total > 0 else 0.0

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
        left, U = eigenpairs(np.eye(len(own)) - P)
        told = left > UNTOLD
        hidden = (U[:, told] / left[told]) @ U[:, told].T
        of_residual = V - P @ V - V @ P + own @ self.covariance @ own.T / size
        return hidden @ apart, size * hidden @ of_residual @ hidden, int(told.sum())
