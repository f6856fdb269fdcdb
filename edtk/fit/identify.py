"""Compliances from real measurements, by least squares or a robust fit, and what residuals say."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from edtk.fit.correlated_noise import RowNoise, whiten, whiten_columns
from edtk.fit.distributions import chi_square_quantile, chi_square_tail, student_quantile
from edtk.fit.fit_huber import NO_NOISE, fit_huber
from edtk.fit.least_squares import Estimate, Whitened
from edtk.fit.outliers import find_outliers, own_outliers
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

# Efficiency of the median absolute deviation, beside the standard deviation, for normal noise: its
# square has so much of the degrees of freedom.
MAD_EFFICIENCY = 0.37
# Of a residual's variance, below which the residual is not enlarged further.
LEAST_SHARE = 1e-9
# Degrees of freedom of a robust covariance, as a share of those of least squares with sigma
# estimated; 0.71 to 0.82 were simulated.
HUBER_CERTAINTY = 0.7
# Measured coordinates up to this many times the parameters are too few for a robust scale: a fit
# can run through p of N coordinates, and where these are half of them or more, the median absolute
# residual is next to zero, whatever the noise is. Then the corner shrinks with the scale, and the
# fit runs through them indeed.
INTERPOLATED = 2
# Standard deviations of residuals below this share of the noise's are rounding: the fit runs
# through the measurement whatever it is, and the residual has no size to be compared with.
RUN_THROUGH = 1e-7


@dataclass(frozen=True, eq=False)
class Identification(Presented):
    """Identified compliances. N = m rows is the number of measured coordinates.

    All statistics are those of the fit without the bound k >= 0, so that they obey their laws.
    Where that fit has negative compliances (`negative`), k alone is different: it is the
    least-squares (or robust) fit under the bound.

    Attributes:
        k: Estimates (p,) [rad/(N m)], not negative.
        unbounded: Estimates (p,) without the bound [rad/(N m)].
        negative: Mask (p,) of the parameters whose unbounded estimate is negative.
        covariance: Covariance (p, p) of `unbounded`: Eq. (13); times scale^2 where the noise is
            estimated; that of the M-estimator where it is robust.
        residual: dp - A k (m, rows) [m, rad].
        standardised: Residuals over ``sigma sqrt(1 - leverage)`` (m, rows), over scale too where it
            is estimated.
        leverage: Diagonal (m, rows) of the hat matrix ``Q Q'``; its sum is p.
        chi2: Sum of the squares of residual/sigma, with the given sigma.
        dof: Degrees of freedom N - p.
        p_value: Probability of so large a chi2 under the given sigma; None where that is not
            believed, or dof = 0.
        scale: Estimated noise over the given: sqrt(chi2/dof), or from the median absolute deviation
            if robust; NaN where dof = 0.
        covariance_dof: Degrees of freedom of the covariance, for intervals: inf where sigma is
            believed, dof where it is estimated, and 0.7 of it if robust, as then the residuals
            enter the covariance in any case.
        known: Whether the given sigma is believed.
        robust: Whether the loss is Huber's.
        outliers: Rows (measurements) that do not belong to the others, counted from 0, see
            `edtk.fit.outliers`.
        parameters: Names (p,).
        too_few_for_robust: Whether a robust fit was asked for, and this is that of least squares,
            as a robust scale needs more measured coordinates.
    """

    k: Array
    unbounded: Array
    negative: Mask
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
    outliers: Indices
    parameters: tuple[str, ...]
    too_few_for_robust: bool = False

    @classmethod
    def of_estimate(
        cls,
        found: Estimate,
        A: Array,
        measured: Array,
        sigma: RowNoise,
        known: bool,
        robust: bool = False,
    ) -> "Identification":
        """Describe measurements by an estimate that rests on prior knowledge, too.

        Residuals are larger than those of least squares, and leverages are ``x cov x'``, less than
        one; so there is no p-value, and outliers are not looked for.

        Args:
            found: Compliances and covariance.
            A: Regressors (m, rows, p) [m/(rad/(N m))].
            measured: Deflections (m, rows) [m, rad].
            sigma: Noise (m, rows) [m, rad], or correlated noise.
            known: Whether sigma is believed.
            robust: Whether errors are to have heavy tails in a posterior.
        """
        residual = measured - A @ found.k
        z = whiten(residual, sigma)
        X = whiten_columns(A, sigma)
        leverage = np.clip(np.einsum("mri,ij,mrj->mr", X, found.covariance, X), 0.0, 1.0)
        dof = max(measured.size - int(np.linalg.matrix_rank(X.reshape(-1, len(found.k)))), 0)
        square = float((z**2).sum())
        return cls(
            k=np.maximum(found.k, 0.0),
            unbounded=found.k,
            negative=found.k < 0,
            covariance=found.covariance,
            residual=residual,
            standardised=z / np.sqrt(np.maximum(1 - leverage, LEAST_SHARE)),
            leverage=leverage,
            chi2=square,
            dof=dof,
            p_value=None,
            scale=float(np.sqrt(square / dof)) if dof else np.nan,
            covariance_dof=np.inf,
            known=known,
            robust=robust,
            outliers=np.zeros(0, dtype=int),
            parameters=found.parameters,
        )

    def headline(self) -> str:
        """How many compliances, how uncertain the worst of them is, and how well the model fits."""
        if self.k.all():
            uncertain = f"standard deviations up to {100 * (self.std / self.k).max():.2g} %"
        else:
            uncertain = f"{int((self.k == 0).sum())} of them zero"
        return (
            f"{len(self.k)} compliances, {uncertain}, chi-square {self.chi2:.4g} of {self.dof} "
            f"degrees of freedom, {len(self.outliers)} outliers"
        )

    @property
    def std(self) -> Array:
        """Standard deviations (p,) [rad/(N m)]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations (p, p)."""
        return self.covariance / np.outer(self.std, self.std)

    @property
    def scale_dof(self) -> float:
        """Degrees of freedom of `scale`, as if its square were a chi-square over them."""
        return MAD_EFFICIENCY * self.dof if self.robust else self.dof

    @property
    def half_interval(self) -> Array:
        """Half the width (p,) of 95 % intervals about `unbounded`: std times Student's t."""
        return student_quantile(0.975, self.covariance_dof) * self.std

    @property
    def interval(self) -> Array:
        """Ends (2, p) of the 95 % intervals [rad/(N m)], without their negative parts.

        An interval reaches to its estimate k, which the bound of another compliance may have moved
        out of what it would be without.
        """
        half = self.half_interval
        # Compliances are not negative: cutting off what cannot be keeps the coverage.
        low, high = np.maximum(np.stack([self.unbounded - half, self.unbounded + half]), 0.0)
        return np.stack([np.minimum(low, self.k), np.maximum(high, self.k)])

    def to_frame(self) -> "pd.DataFrame":
        """One row a compliance: `parameter`, and `k`, `std`, `low_95`, `high_95` [rad/(N m)]."""
        import pandas as pd

        low, high = self.interval
        return pd.DataFrame(
            {
                "parameter": self.parameters,
                "k": self.k,
                "std": self.std,
                "low_95": low,
                "high_95": high,
            }
        )

    def accuracy(self, target: Array) -> tuple[float, tuple[float, float]]:
        """Expected error after compensation in a test pose, and how well that is known.

        ``rho0 = sqrt(trace(A0 cov A0'))``, Eq. (20). ``dof s^2 / sigma^2`` has the chi-square
        distribution, so that its 95 % interval is rho0 times the square roots of
        ``dof / chi2_0.975`` and ``dof / chi2_0.025``, with `covariance_dof` for dof (an
        approximation if robust). Where sigma is known so is rho0, and the interval has no width.

        Args:
            target: Regressor A0 (3, p) of the test pose [m/(rad/(N m))].

        Returns:
            rho0 and the ends of its interval [m].
        """
        value = float(np.sqrt(np.einsum("ri,ij,rj->", target, self.covariance, target)))
        if np.isinf(self.covariance_dof):
            return value, (value, value)
        quantiles = chi_square_quantile([0.975, 0.025], self.covariance_dof)
        low, high = value * np.sqrt(self.covariance_dof / quantiles)
        return value, (float(low), float(high))


class NothingLeftError(ValueError):
    """The residuals cannot tell the noise that was to be estimated from them."""


def identify(
    A: Array,
    measured: Array,
    sigma: RowNoise,
    parameters: tuple[str, ...],
    robust: bool = False,
    known: bool = True,
) -> Identification:
    """Identify compliances by weighted least squares, Eq. (6) and (9), or with Huber's loss.

    Where a robust fit is to estimate sigma from N <= 2p coordinates, which it cannot (see
    `INTERPOLATED`), least squares take its place, and `too_few_for_robust` of the result is set.
    Coverage of 95 % intervals, robust and with sigma estimated, in 1000 simulated calibrations of
    the KR 270 each (random poses, loads of its two studies):

    | p, m     | 2    | 3    | 4    | 5    | 6    | 8    | 10   | 12   |
    |----------|------|------|------|------|------|------|------|------|
    | 5        | 94.7 | 95.6 | 94.5 | 94.0 | 94.9 | 95.0 | 94.6 | 94.8 |
    | 6        | none | 95.5 | 95.0 | 94.8 | 94.0 | 95.7 | 95.3 | 95.2 |

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise; only its proportions count where
            `known` is false.
        parameters: Names (p,).
        robust: Huber's loss instead of squares, see `fit_huber`.
        known: Whether sigma is believed, or a common factor of it is estimated from the residuals.

    Raises:
        SingularPlanError: The measurements do not identify all parameters.
        NothingLeftError: Sigma is to be estimated, and there are no degrees of freedom or no
            residuals.
        SigmaTooSmallError: Robust, and no residual is as small as sigma says.
    """
    data = _Data(A, measured, Whitened.of(A, sigma, parameters), parameters)
    if not known and not data.dof:
        raise NothingLeftError(
            f"{measured.size} measured coordinates for {len(parameters)} parameters leave nothing "
            "to estimate sigma from"
        )
    fit = _least_squares(data, known)
    if not known and not _without_rounding(data.in_sigma(fit.residual), data.y).any():
        raise NothingLeftError(
            "the model fits the measurements exactly, which leaves nothing to estimate sigma from"
        )
    too_few = robust and not known and measured.size <= INTERPOLATED * len(parameters)
    if robust and data.dof and not too_few:
        return _robust(fit, data)
    z = _without_rounding(data.in_sigma(fit.residual), data.y)
    outliers = find_outliers(*data.whitened.deletable(z), data.dof, total=float((z**2).sum()))
    return replace(fit, outliers=data.own(outliers), too_few_for_robust=too_few)


@dataclass(frozen=True, eq=False)
class _Data:
    """Measurements with their factored regressors.

    Attributes:
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        whitened: The factors of A in units of the noise.
        parameters: Names (p,).
    """

    A: Array
    measured: Array
    whitened: Whitened
    parameters: tuple[str, ...]

    @property
    def dof(self) -> int:
        """Degrees of freedom N - p."""
        return self.measured.size - self.A.shape[-1]

    @property
    def y(self) -> Array:
        """Deflections (m, rows) in units of the noise."""
        return self.in_sigma(self.measured)

    def in_sigma(self, lengths: Array) -> Array:
        """Deflections or residuals (m, rows) in units of the noise."""
        return self.whitened.in_sigma(lengths)

    def own(self, outliers: Indices) -> Indices:
        """The outliers without rows that only hang together with one."""
        noise = self.whitened.correlated
        if noise is None:
            return outliers
        return own_outliers(self.A, self.measured, noise, self.parameters, outliers)


def _least_squares(data: _Data, known: bool) -> Identification:
    """The fit that Eq. (6) describes, before outliers are looked for."""
    whitened = data.whitened
    k = whitened.solve(data.measured)
    residual = data.measured - data.A @ k
    z = data.in_sigma(residual)
    square = float((z**2).sum())
    scale = float(np.sqrt(square / data.dof)) if data.dof else np.nan
    trusted = 1.0 if known else scale
    # Rounding makes leverages of determined coordinates larger than one by a hair.
    leverage = np.clip((whitened.Q**2).sum(axis=-1), 0.0, 1.0)
    return Identification(
        k=_bounded(k, data),
        unbounded=k,
        negative=k < 0,
        covariance=whitened.covariance * trusted**2,
        residual=residual,
        standardised=_standardised(z, leverage, trusted),
        leverage=leverage,
        chi2=square,
        dof=data.dof,
        p_value=float(chi_square_tail(square, data.dof)) if known and data.dof else None,
        scale=scale,
        covariance_dof=np.inf if known else float(data.dof),
        known=known,
        robust=False,
        outliers=np.zeros(0, dtype=int),
        parameters=data.parameters,
    )


def _bounded(k: Array, data: _Data) -> Array:
    """The least-squares estimate (p,) under k >= 0, given the one without that bound."""
    if not (k < 0).any():
        return k
    from scipy.optimize import nnls

    # |A k - dp|^2 differs from |R k - Q'dp|^2 by a constant: the small problem has the same
    # minimiser.
    whitened = data.whitened
    return nnls(whitened.R, whitened.project(data.measured))[0] / whitened.scale


def _robust(fit: Identification, data: _Data) -> Identification:
    """The fit with Huber's loss; it has no p-value, since it does not minimise chi-square."""
    whitened = data.whitened
    y = data.y
    start = fit.unbounded * whitened.scale
    found = fit_huber(whitened.Q, whitened.R, y, start, fit.known)
    if not fit.known and not found.scale > NO_NOISE * np.abs(y).max():
        raise NothingLeftError(
            "the model fits half of the measurements exactly, which leaves no estimate of sigma"
        )
    k = found.x / whitened.scale
    bounded = k
    if (k < 0).any():
        start = fit.k * whitened.scale
        above = fit_huber(whitened.Q, whitened.R, y, start, fit.known, least=0.0)
        bounded = above.x / whitened.scale
    residual = data.measured - data.A @ k
    z = data.in_sigma(residual)
    trusted = 1.0 if fit.known else found.scale
    scale_dof = np.inf if fit.known else MAD_EFFICIENCY * fit.dof
    outliers = find_outliers(*whitened.deletable(_without_rounding(z, y)), scale_dof, trusted)
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
        outliers=data.own(outliers),
    )


def _standardised(z: Array, leverage: Array, scale: float) -> Array:
    """``z / (scale sqrt(1 - leverage))``; zero where the fit runs through the measurement."""
    spread = scale * np.sqrt(1 - leverage)
    least = RUN_THROUGH * max(scale, np.finfo(float).tiny)
    return np.divide(z, spread, out=np.zeros_like(z), where=spread > least)


def _without_rounding(z: Array, y: Array) -> Array:
    """Residuals z, zero where they are lost in the rounding of y: rounding is not normal noise."""
    return np.where(np.abs(z) > NO_NOISE * np.abs(y).max(), z, 0.0)
