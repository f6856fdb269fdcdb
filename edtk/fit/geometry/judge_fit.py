"""A fit of geometry and springs, judged: what it is worth, and each pose predicted without it."""

from dataclasses import dataclass

import numpy as np

from edtk.fit.geometry.fitted_geometry import (
    MM,
    FittedGeometry,
    GeometricFit,
    Loads,
    ToldBefore,
    TurnResiduals,
    loading_of,
    student_quantile,
)
from edtk.fit.geometry.least_squares_fit import WHITE_SHARE, PoseRows, known_before
from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.fit.least_squares import LeftOut, independent_coordinates
from edtk.fit.prior import Prior, PriorRows
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import Parameter
from edtk.measure.position_noise import PositionNoise
from edtk.system.typing import Array, Indices

# Of a direction of the prior, that its own rows leave: all else tells it a thousand times worse.
UNTOLD = 1e-6


def judge_fit(
    model: MeasuredModel,
    theta: Array,
    noise: PositionNoise,
    weighting: tuple[Array, Array],
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
    work = rows.working(common, means)
    V = noise.of_pose(rows.motion, rows.places, rows.worth(data), rows.differs(means))
    trust = rows.weights(weights)
    out = _LeftOutPoses.of(rows, V, work, trust)
    # Sizes that each joint has of its own may be those of one wrong pose, which they would hide.
    surprise = _LeftOutPoses.of(rows, common, work, trust).surprise[: len(means)]
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
    of_errors = out.covariance_of_errors[: len(means)]
    dof = fitted.dof(rows.motion[: len(means)], rows.places[: len(means)])
    half = np.sqrt(np.maximum(np.einsum("mrr->mr", of_errors), 0.0)) * student_quantile(dof)
    residual, left_out, left_out_half = parts = [
        _by_marker(part, means) for part in (rows.residual, out.errors, half)
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
        # A pose that a robust loss trusts less surprises all the same.
        surprise=surprise / weights,
        independent=independent_coordinates(
            of_errors,
            means.rows_seen.reshape(len(means), -1),
            noise.model_fit is not None,
        ),
        weights=weights,
        told_before=_told_before(out, prior, before, model, theta, float(np.median(dof))),
    )


def _by_marker(rows: Array, means: MarkerPositions) -> Array:
    """Rows of poses, and of what was known behind them, as (m, k, rows) [m, rad]; NaN unread."""
    shape = (len(means), len(means.markers), means.rows)
    blank = np.where(means.rows_seen, 0.0, np.nan)
    return np.asarray(rows[: len(means)].reshape(shape) / MM + blank)


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
    first = out.Q.shape[0] * out.Q.shape[1] - out.beside
    for row, i in enumerate(before.parameters):
        error, covariance, rank = out.of_rows(np.array([first + row]))
        if not rank:  # nothing else says anything of it
            continue
        size = before.rows[row, i]
        mean[i] = (before.values[row] - error[0]) / size * model.scales[i]
        # The row's own error, of size one, is a part of that of the difference.
        std[i] = np.sqrt(max(covariance[0, 0] - 1, 0.0)) / size * model.scales[i]
    rows = first + np.arange(len(before.parameters), len(before))
    error, covariance, rank = out.of_rows(rows)
    square = float(error @ np.linalg.pinv(covariance, rcond=1e-9, hermitian=True) @ error)
    own = out.Q.reshape(-1, p)[first : first + len(before)]
    return ToldBefore(prior, mean, std, square, rank, dof, float((own**2).sum()))


@dataclass(frozen=True, eq=False)
class _LeftOutPoses:
    """Poses as they are predicted without them.

    Attributes:
        errors: Measured less predicted coordinates (m, r) [mm].
        covariance_of_errors: Of those of each pose (m, r, r) [mm^2].
        surprise: Squared sizes (m,) of the errors over their covariances.
        covariance: Of the parameters (p, p), in their units.
        Q: Orthonormal columns (m, r, p) of the weighted rows.
        S: ``sum_b Q_b' V_b Q_b`` (p, p).
        z: Weighted residuals (m, r).
        beside: Number of the last rows of all that are no coordinates of poses.
    """

    errors: Array
    covariance_of_errors: Array
    surprise: Array
    covariance: Array
    Q: Array
    S: Array
    z: Array
    beside: int

    @classmethod
    def of(cls, rows: PoseRows, V: Array, work: Array, weights: Array) -> "_LeftOutPoses":
        """Of a fit with covariances V (m, r, r), weighted by others alike and by weights (m,)."""
        L = np.linalg.cholesky(work / weights[:, None, None])
        inverse_L = np.linalg.inv(L)
        X = inverse_L @ rows.design
        z = (inverse_L @ rows.residual[..., None])[..., 0]
        own = inverse_L @ (V / weights[:, None, None]) @ np.swapaxes(inverse_L, 1, 2)
        m, r = z.shape
        Q, R = np.linalg.qr(X.reshape(m * r, -1))
        Q = Q.reshape(m, r, -1)
        transposed = np.swapaxes(Q, 1, 2)
        h = np.einsum("mrp,mr->mp", Q, z)
        out = LeftOut.of(transposed @ Q, h, transposed @ own @ Q)
        # A pose that alone tells something leaves nothing to compare it with.
        told = np.eye(r) - Q @ out.alone @ transposed
        without = np.einsum("mrs,ms->mr", told, z) + np.einsum("mrp,mp->mr", Q, out.u)
        of_without = told @ own @ told + Q @ out.C @ transposed
        inverse = np.linalg.inv(R) if R.size else np.zeros((0, 0))
        return cls(
            errors=np.einsum("mrs,ms->mr", L, without),
            covariance_of_errors=L @ of_without @ np.swapaxes(L, 1, 2),
            surprise=_surprise(without, of_without),
            covariance=inverse @ out.S @ inverse.T,
            Q=Q,
            S=out.S,
            z=z,
            beside=rows.beside * r,
        )

    def of_rows(self, chosen: Indices) -> tuple[Array, Array, int]:
        """Rows of the prior without them: in the directions that all else tells, too.

        Args:
            chosen: Their indices among all rows.

        Returns:
            Errors (c,) in units of the prior's own, their covariance (c, c), and its rank.
        """
        own = self.Q.reshape(-1, self.Q.shape[-1])[chosen]
        P = own @ own.T
        # Rows of the prior have errors of size one, and weights as `working` has them.
        V = np.eye(len(chosen)) / (1 + WHITE_SHARE)
        left, U = np.linalg.eigh(np.eye(len(chosen)) - P)
        told = left > UNTOLD
        hidden = (U[:, told] / left[told]) @ U[:, told].T
        of_residual = V - P @ V - V @ P + own @ self.S @ own.T
        size = np.sqrt(1 + WHITE_SHARE)
        errors = size * hidden @ self.z.reshape(-1)[chosen]
        return errors, size**2 * hidden @ of_residual @ hidden, int(told.sum())


def _surprise(errors: Array, covariance: Array) -> Array:
    """``e' C^+ e`` (m,) of errors (m, r) with covariances (m, r, r), some of which are singular."""
    inverse = np.linalg.pinv(covariance, rcond=1e-9, hermitian=True)
    return np.asarray(np.einsum("mr,mrs,ms->m", errors, inverse, errors))
