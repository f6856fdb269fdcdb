"""How good a fit of geometry is: its covariance, and poses predicted without being fitted."""

from dataclasses import dataclass

import numpy as np

from edtk.fit.geometry.fitted_geometry import (
    MM,
    FittedGeometry,
    GeometricFit,
    Loads,
    TurnResiduals,
    loading_of,
    student_quantile,
)
from edtk.fit.geometry.least_squares_fit import PoseRows, working
from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.measure.geometric_model import GeometricModel
from edtk.measure.noise import PositionNoise
from edtk.measure.parameters import GeometricParameter
from edtk.system.typing import Array, Mask

OUTSIDE = 0.05  # share of coordinates outside 95 % bands
# With the density phi and the bound z of a normal number, ``2 (z phi(z))^2`` of the variance
# ``0.05 * 0.95`` of its being outside: the part that grows with the square of a correlation.
OF_SQUARE = 0.5525


def chance_of_outside(share: float, number: float) -> float:
    """Probability that of so many independent coordinates such a share or more is outside.

    It is the binomial tail ``I_0.05(x, n - x + 1)``, by the incomplete beta function for numbers
    that are no integers.

    Args:
        share: Share outside their 95 % bands.
        number: Number of independent coordinates.
    """
    from scipy.special import betainc

    count = share * number
    if count <= OUTSIDE * number:
        return 1.0
    return float(betainc(count, number - count + 1, OUTSIDE))


def independent_coordinates(covariance: Array, seen: Mask, scaled: bool) -> float:
    """As many independent coordinates have shares inside that vary as much.

    Whether a normal number is beyond its bounds is a sum of Hermite polynomials of even order, so
    that of two numbers with the correlation c the covariance is ``sum_k a_k^2 c^k``, k = 2, 4 ...;
    here it is bounded by that of order two and ``c^4`` for the rest. The number is that of all
    coordinates over the mean over them of the sums of these, as a share of their own variance
    (Rao and Scott 1981). Errors of different poses count as independent.

    Where the size of the errors was fitted to themselves, their mean square is what the bands say:
    the sum of all polynomials of order two, ``z^2 - 1``, is none, and that order drops out.

    Args:
        covariance: Of the coordinates of each pose (m, r, r).
        seen: Which of them (m, r) were measured.
        scaled: Whether the size of the errors was fitted.
    """
    variance = np.einsum("mrr->mr", covariance)
    root = np.sqrt(np.where(seen & (variance > 0), variance, np.inf))
    squares = (covariance / root[:, :, None] / root[:, None]) ** 2
    second = 0.0 if scaled else OF_SQUARE
    total = float((second * squares + (1 - OF_SQUARE) * squares**2).sum())
    return float(seen.sum()) ** 2 / total if total > 0 else 0.0


def judge_fit(
    model: GeometricModel,
    theta: Array,
    noise: PositionNoise,
    weighting: tuple[Array, Array],
    data: MarkerPositions,
    loads: Loads | None,
    beside: tuple[tuple[GeometricParameter, ...], Array, Array, Array | None],
) -> GeometricFit:
    """The fit with its covariance, and each pose as it is predicted without it.

    With weighted columns ``Q R`` and the rows Q_b of a pose, its residual left out is
    ``(I - Q_b Q_b')^-1 z_b``, which is exact where the model is linear: tests compare it with fits
    without the pose. Parameters have the covariance ``R^-1 S R^-T``, ``S = sum_b Q_b' V_b Q_b``, of
    any weighted least squares whose weights are not the inverse of V (Huber 1967).

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
    """
    common, weights = weighting
    means = data.means
    rows = PoseRows.of(model, theta, means, loading_of(model.compliances(theta), means, loads))
    work = working(common, means)
    V = noise.of_pose(rows.motion, data.worth, means.is_difference)
    out = _LeftOut.of(rows, V, work, weights)
    # Sizes that each joint has of its own may be those of one wrong pose, which they would hide.
    surprise = _LeftOut.of(rows, common, work, weights).surprise
    fitted = FittedGeometry(
        model=model,
        theta=theta,
        covariance=out.covariance,
        open_parameters=beside[0],
        shares=beside[1],
        noise=noise,
        placed=beside[2],
        placed_turns=beside[3],
    )
    spread = np.einsum("mrr->mr", out.covariance_of_errors)
    half = np.sqrt(np.maximum(spread, 0.0)) * student_quantile(fitted.dof(rows.motion))
    shape = (len(means), len(data.markers), means.rows)
    blank = np.where(means.rows_seen, 0.0, np.nan)
    residual = rows.residual.reshape(shape) / MM + blank
    left_out = out.errors.reshape(shape) / MM + blank
    left_out_half = half.reshape(shape) / MM + blank
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
        turns=TurnResiduals(*(part[..., 3:] for part in (residual, left_out, left_out_half)))
        if means.turns is not None
        else None,
        # A pose that a robust loss trusts less surprises all the same.
        surprise=surprise / weights,
        independent=independent_coordinates(
            out.covariance_of_errors,
            means.rows_seen.reshape(len(means), -1),
            noise.model_fit is not None,
        ),
        weights=weights,
    )


@dataclass(frozen=True, eq=False)
class _LeftOut:
    """Poses as they are predicted without them.

    Attributes:
        errors: Measured less predicted coordinates (m, r) [mm].
        covariance_of_errors: Of those of each pose (m, r, r) [mm^2].
        surprise: Squared sizes (m,) of the errors over their covariances.
        covariance: Of the parameters (p, p), in their units.
    """

    errors: Array
    covariance_of_errors: Array
    surprise: Array
    covariance: Array

    @classmethod
    def of(cls, rows: PoseRows, V: Array, work: Array, weights: Array) -> "_LeftOut":
        """Of a fit with covariances V (m, r, r), weighted by others alike and by weights (m,)."""
        L = np.linalg.cholesky(work / weights[:, None, None])
        inverse_L = np.linalg.inv(L)
        X = inverse_L @ rows.design
        z = (inverse_L @ rows.residual[..., None])[..., 0]
        own = inverse_L @ (V / weights[:, None, None]) @ np.swapaxes(inverse_L, 1, 2)
        m, r = z.shape
        Q, R = np.linalg.qr(X.reshape(m * r, -1))
        Q = Q.reshape(m, r, -1)
        S = np.einsum("mrp,mrs,msq->pq", Q, own, Q, optimize=True)
        inverse = np.linalg.inv(R) if R.size else np.zeros((0, 0))
        P = Q @ np.swapaxes(Q, 1, 2)
        of_residual = own - P @ own - own @ P + Q @ S @ np.swapaxes(Q, 1, 2)
        # A pose that alone tells something leaves nothing to compare it with.
        hidden = np.linalg.pinv(np.eye(r) - P, rcond=1e-9, hermitian=True)
        without = np.einsum("mrs,ms->mr", hidden, z)
        of_without = hidden @ of_residual @ hidden
        return cls(
            errors=np.einsum("mrs,ms->mr", L, without),
            covariance_of_errors=L @ of_without @ np.swapaxes(L, 1, 2),
            surprise=_surprise(without, of_without),
            covariance=inverse @ S @ inverse.T,
        )


def _surprise(errors: Array, covariance: Array) -> Array:
    """``e' C^+ e`` (m,) of errors (m, r) with covariances (m, r, r), some of which are singular."""
    inverse = np.linalg.pinv(covariance, rcond=1e-9, hermitian=True)
    return np.asarray(np.einsum("mr,mrs,ms->m", errors, inverse, errors))
