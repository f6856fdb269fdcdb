"""Nonlinear least squares on positions of markers."""

from dataclasses import dataclass

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.pose_rows import measured_less_seen
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.system.typing import Array

MM = 1e3
TOLERANCE = 1e-12
MOST = 200  # evaluations; ten are the rule, and positions that no robot has end nowhere


@dataclass(frozen=True, eq=False)
class LeastSquaresFit:
    """A minimum of the sum of squares.

    Attributes:
        theta: Parameters (p,) in SI units.
        cost: Half the sum of squares there.
        converged: Whether the search settled.
    """

    theta: Array
    cost: float
    converged: bool


def least_squares_fit(
    model: GeometricModel,
    theta: Array,
    means: MarkerPositions,
    torque: Array | None = None,
    whitening: Array | None = None,
    most: int = MOST,
) -> LeastSquaresFit:
    """Fit a model to measured positions by Levenberg-Marquardt, with the analytic Jacobian.

    Parameters are in units in which they are of order one, and residuals in millimetres or in units
    of the noise.

    Args:
        model: What is fitted.
        theta: Where to begin (p,), in SI units.
        means: The positions, a visit a pose.
        torque: Loads (m, n) of the joints [N m].
        whitening: Matrices (m, 3k, 3k) that make the errors of a pose independent and of size one
            [1/mm]; rows of markers that were not seen are zero. None for equal weights.
        most: Evaluations at most.
    """
    if not model.p:
        return LeastSquaresFit(theta, 0.0, True)
    from scipy.optimize import least_squares

    scales = model.scales

    def weighted(rows: Array) -> Array:
        """Rows (m, k, rows, ...) in units of the noise, one beneath the other."""
        m, k = means.seen.shape
        rows = rows * means.seen.reshape(m, k, *(1,) * (rows.ndim - 2))
        flat = MM * rows.reshape(m, means.rows * k, -1)
        flat = flat if whitening is None else whitening @ flat
        return flat.reshape(m * means.rows * k, *rows.shape[3:])

    def residual(u: Array) -> Array:
        there = model.see(u * scales, means.q, torque, derivatives=False)
        return weighted(-measured_less_seen(means, there))

    def jacobian(u: Array) -> Array:
        J = model.see(u * scales, means.q, torque).jacobian
        assert J is not None
        return weighted(J * scales)

    enough = means.seen.size * means.rows >= model.p
    found = least_squares(
        residual,
        theta / scales,
        jacobian,
        method="lm" if enough else "trf",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=most,
    )
    return LeastSquaresFit(found.x * scales, float(found.cost), bool(found.status > 0))
