"""Compliances from real measurements: least squares or robust, with what the residuals say about them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import chi2, t

from edtk.inference.huber import HuberFit, fit_huber
from edtk.inference.least_squares import Whitened
from edtk.inference.outliers import find_outliers

Array = NDArray[np.float64]
MAD_EFFICIENCY = (
    0.37  # of the median absolute deviation, beside the standard deviation, for normal noise
)
HUBER_CERTAINTY = 0.7  # of the covariance, beside that of least squares with sigma estimated; 0.71 to 0.82 simulated


class NothingLeftError(ValueError):
    """The residuals cannot tell the noise that was to be estimated from them."""


@dataclass(frozen=True, eq=False)
class Identification:
    """Identified compliances. N = m rows is the number of measured coordinates.

    All statistics are those of the fit without the bound k >= 0, so that they obey their laws; where that fit has
    negative compliances (`negative`), k alone is different: it is the least-squares (or robust) fit under the bound.

    Attributes:
        k: Estimates (p,) [rad/(N m)], not negative.
        unbounded: Estimates (p,) without the bound.
        negative: Mask (p,) of the parameters whose unbounded estimate is negative.
        covariance: Covariance (p, p) of `unbounded`: Eq. (13); times scale^2 where the noise is estimated; that of the
            M-estimator where it is robust.
        residual: dp - A k (m, rows) [m, rad].
        standardised: Residuals over ``sigma sqrt(1 - leverage)`` (m, rows), over scale too where it is estimated.
        leverage: Diagonal (m, rows) of the hat matrix ``Q Q'``; its sum is p.
        chi2: Sum of the squares of residual/sigma, with the given sigma.
        dof: Degrees of freedom N - p.
        p_value: Probability of so large a chi2 under the given sigma; None where that is not believed, or dof = 0.
        scale: Estimated noise over the given: sqrt(chi2/dof), or from the median absolute deviation if robust; NaN
            where dof = 0.
        covariance_dof: Degrees of freedom of the covariance, for intervals: inf where sigma is believed, dof where it
            is estimated, and 0.7 of it if robust, as then the residuals enter the covariance in any case.
        known: Whether the given sigma is believed.
        robust: Whether the loss is Huber's.
        outliers: Rows (measurements) that do not belong to the others, counted from 0, see `edtk.inference.outliers`.
    """

    k: Array
    unbounded: Array
    negative: NDArray[np.bool_]
    covariance: Array
    residual: Array
    standardised: Array
    leverage: Array
    chi2: float
    dof: int
    p_value: float | None
    scale: float
    covariance_dof: float
    known: bool
    robust: bool
    outliers: NDArray[np.int_]

    @property
    def std(self) -> Array:
        """Standard deviations (p,) [rad/(N m)]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations (p, p)."""
        return self.covariance / np.outer(self.std, self.std)

    @property
    def half_interval(self) -> Array:
        """Half the width (p,) of 95 % intervals about `unbounded`: std times t of `covariance_dof`."""
        return t.ppf(0.975, self.covariance_dof) * self.std

    def accuracy(self, target: Array) -> tuple[float, tuple[float, float]]:
        """rho0 = sqrt(trace(A0 cov A0')), Eq. (20), and its 95 % interval [m].

        ``dof s^2 / sigma^2`` has the chi-square distribution, so that the interval is rho0 times the square roots of
        ``dof / chi2_0.975`` and ``dof / chi2_0.025``, with `covariance_dof` for dof (an approximation if robust).
        Where sigma is known so is rho0, and the interval has no width.

        Args:
            target: A0 (3, p).
        """
        value = float(np.sqrt(np.einsum("ri,ij,rj->", target, self.covariance, target)))
        if np.isinf(self.covariance_dof):
            return value, (value, value)
        low, high = value * np.sqrt(
            self.covariance_dof / chi2.ppf([0.975, 0.025], self.covariance_dof)
        )
        return value, (float(low), float(high))


def identify(
    A: Array,
    measured: Array,
    sigma: Array,
    parameters: tuple[str, ...],
    robust: bool = False,
    known: bool = True,
) -> Identification:
    """Identify compliances by weighted least squares (Eq. 6, 9), or with Huber's loss.

    Args:
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad]; only its proportions count where `known` is false.
        parameters: Names (p,), for error messages.
        robust: Huber's loss instead of squares, see `edtk.inference.huber`.
        known: Whether sigma is believed, or a common factor of it is estimated from the residuals.

    Raises:
        SingularPlanError: The measurements do not identify all parameters; names parameters and directions.
        NothingLeftError: Sigma is to be estimated, and there are no degrees of freedom or no residuals.
        SigmaTooSmallError: Robust, and no residual is as small as sigma says.
    """
    whitened = Whitened.of(A, sigma, parameters)
    dof = measured.size - A.shape[-1]
    if not known and not dof:
        raise NothingLeftError(
            f"{measured.size} measured coordinates for {A.shape[-1]} parameters leave nothing to estimate sigma from"
        )
    fit = _least_squares(whitened, A, measured, dof, known)
    if (
        not known
        and not _without_rounding(fit.residual * whitened.weight, measured * whitened.weight).any()
    ):
        raise NothingLeftError(
            "the model fits the measurements exactly, which leaves nothing to estimate sigma from"
        )
    return _robust(fit, whitened, A, measured) if robust and dof else fit


def _least_squares(
    whitened: Whitened, A: Array, measured: Array, dof: int, known: bool
) -> Identification:
    """The fit that Eq. (6) describes."""
    k = whitened.solve(measured)
    negative = k < 0
    bounded = k
    if negative.any():
        # |A k - dp|^2 differs from |R k - Q'dp|^2 by a constant: the small problem has the same minimiser.
        bounded = nnls(whitened.R, whitened.project(measured))[0] / whitened.scale
    residual = measured - A @ k
    z = residual * whitened.weight
    square = float((z**2).sum())
    scale = float(np.sqrt(square / dof)) if dof else np.nan
    trusted = 1.0 if known else scale
    leverage = np.clip((whitened.Q**2).sum(axis=-1), 0.0, 1.0)
    return Identification(
        k=bounded,
        unbounded=k,
        negative=negative,
        covariance=whitened.covariance * trusted**2,
        residual=residual,
        standardised=_standardised(z, leverage, trusted),
        leverage=leverage,
        chi2=square,
        dof=dof,
        p_value=float(chi2.sf(square, dof)) if known and dof else None,
        scale=scale,
        covariance_dof=np.inf if known else float(dof),
        known=known,
        robust=False,
        outliers=find_outliers(whitened.Q, _without_rounding(z, measured * whitened.weight), dof),
    )


def _robust(fit: Identification, whitened: Whitened, A: Array, measured: Array) -> Identification:
    """The same with Huber's loss; p-values of chi2 are left out, since it is not minimised any more."""
    columns, y = whitened.Q @ whitened.R, measured * whitened.weight
    found: HuberFit = fit_huber(columns, y, fit.unbounded * whitened.scale, fit.known)
    if not fit.known and not found.scale > 1e-11 * np.abs(y).max():
        raise NothingLeftError(
            "the model fits half of the measurements exactly, which leaves no estimate of sigma"
        )
    k = found.x / whitened.scale
    bounded = k
    if (k < 0).any():
        bounded = (
            fit_huber(columns, y, fit.k * whitened.scale, fit.known, least=0.0).x / whitened.scale
        )
    residual = measured - A @ k
    z = residual * whitened.weight
    trusted = 1.0 if fit.known else found.scale
    of_scale = np.inf if fit.known else MAD_EFFICIENCY * fit.dof
    return replace(
        fit,
        k=bounded,
        unbounded=k,
        negative=k < 0,
        covariance=whitened.covariance * found.inflation,
        residual=residual,
        standardised=_standardised(z, fit.leverage, trusted),
        chi2=float((z**2).sum()),
        p_value=None,
        scale=found.scale,
        robust=True,
        covariance_dof=HUBER_CERTAINTY * fit.dof,
        outliers=find_outliers(whitened.Q, _without_rounding(z, y), of_scale, trusted),
    )


def _standardised(z: Array, leverage: Array, scale: float) -> Array:
    """``z / (scale sqrt(1 - leverage))``; zero where the fit runs through the measurement whatever it is."""
    spread = scale * np.sqrt(1 - leverage)
    return np.divide(
        z, spread, out=np.zeros_like(z), where=spread > 1e-7 * max(scale, np.finfo(float).tiny)
    )


def _without_rounding(z: Array, y: Array) -> Array:
    """Residuals z with those that are lost in the rounding of y set to zero: rounding is not normal noise."""
    return np.where(np.abs(z) > 1e-11 * np.abs(y).max(), z, 0.0)
