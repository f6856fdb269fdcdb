"""The fit where repetitions of a pose share a part of their noise."""

from dataclasses import replace

import numpy as np

from edtk.inference.fit_equilibrium import LinearisedData
from edtk.inference.identification import Identification
from edtk.inference.identify import identify
from edtk.inference.lack_of_fit import LackOfFit
from edtk.system.typing import Array, Indices


def fit_common_noise(
    data: LinearisedData, sigma: Array, group: Indices, found: LackOfFit, fit: Identification
) -> tuple[LinearisedData, Identification]:
    """Weight the means of repetitions by their own variance, and fit again.

    With a variance s^2 of each repetition and t^2 of what n repetitions share, in units of sigma,
    the mean has the variance ``s^2/n + t^2`` and the deviations from it s^2. So rows whose mean is
    shrunk by ``f = s / sqrt(s^2 + n t^2)``, ``(x - (1 - f) mean(x)) / s``, have independent errors
    of the stated sigma: generalised least squares with both variances estimated.

    Args:
        data: The linear model of the measurements.
        sigma: Noise (m, rows) [m, rad].
        group: Number (m,) of each row's group of repetitions, from 0.
        found: The two standard deviations.
        fit: The fit for independent errors.

    Returns:
        The model of rows with independent errors, and the fit: residuals are those of the measured
        rows, and intervals have the degrees of freedom of the groups' means.
    """
    count = np.bincount(group)
    s = found.pure_error
    shrink = s / np.sqrt(s**2 + count * found.common**2)

    def independent(x: Array) -> Array:
        """Rows (m, rows, ...) with independent errors."""
        scale = sigma.reshape(*sigma.shape, *(1,) * (x.ndim - 2))
        whitened = x / scale
        sums = np.zeros((len(count), *x.shape[1:]))
        np.add.at(sums, group, whitened)
        mean = (sums.T / count).T
        less = ((1 - shrink) * mean.T).T
        return (whitened - less[group]) * scale / s

    seen = LinearisedData(independent(data.A), independent(data.measured))
    again = identify(seen.A, seen.measured, sigma, fit.parameters)
    refit = replace(
        again,
        residual=data.measured - data.A @ again.unbounded,
        chi2=fit.chi2,
        p_value=fit.p_value,
        scale=fit.scale,
        covariance_dof=float(found.dof[0]),
        known=fit.known,
        too_few_for_robust=fit.too_few_for_robust,
    )
    return seen, refit
