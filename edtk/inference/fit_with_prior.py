"""The estimate from measurements and prior together, where measurements alone give none."""

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.inference.least_squares import Estimate, Whitened
from edtk.inference.prior import Prior
from edtk.inference.whiten import RowNoise, whiten, whiten_columns
from edtk.system.typing import Array


def fit_with_prior(
    A: Array, measured: Array, sigma: RowNoise, parameters: tuple[str, ...], prior: Prior
) -> Estimate:
    """Fit compliances to measurements, with a Gaussian near the prior as further rows.

    With ``P = V w V'`` the precision of that Gaussian and h that times its mean, the rows
    ``sqrt(w) V' k = V' h / sqrt(w)`` have noise of size one. So the covariance is
    ``(A' A / sigma^2 + P)^-1``, found from rows, by QR.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise that broadcasts to (m, rows) [m, rad], or correlated noise.
        parameters: Names (p,).
        prior: Knowledge of the compliances; a flat one says nothing.

    Returns:
        The estimate, which may be negative, and its covariance.

    Raises:
        SingularPlanError: Prior and measurements together say nothing of a parameter.
    """
    P, h = prior.gaussian()
    known = np.diag(P) > 0
    unit = np.where(known, 1 / np.sqrt(np.where(known, np.diag(P), 1.0)), 1.0)
    w, V = np.linalg.eigh(P * np.outer(unit, unit))
    # A flat prior's eigenvalue is zero exactly, as P then has a row of zeros.
    root = np.sqrt(np.where(w > 0, w, 0.0))
    rows = root[:, None] * V.T / unit
    values = np.divide(V.T @ (unit * h), root, out=np.zeros_like(root), where=root > 0)
    p = A.shape[-1]
    seen = _in_sigma(A, measured, sigma)
    X = np.concatenate([seen[0].reshape(-1, p), rows])
    y = np.concatenate([seen[1].ravel(), values])
    whitened = Whitened.of(X[:, None], 1.0, parameters)
    return Estimate(whitened.solve(y[:, None]), whitened.covariance, parameters)


def _in_sigma(A: Array, measured: Array, sigma: RowNoise) -> tuple[Array, Array]:
    """Regressors (m, rows, p) and deflections (m, rows) in units of the noise."""
    if isinstance(sigma, CorrelatedNoise):
        return whiten_columns(A, sigma), whiten(measured, sigma)
    weight = 1 / np.broadcast_to(np.asarray(sigma, dtype=float), measured.shape)
    return A * weight[..., None], measured * weight
