"""Identified compliances, with everything that the residuals say about them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.distributions import chi_square_quantile, student_quantile
from edtk.inference.least_squares import Estimate
from edtk.inference.whiten import RowNoise, whiten, whiten_columns
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

# Efficiency of the median absolute deviation, beside the standard deviation, for normal noise: its
# square has so much of the degrees of freedom.
MAD_EFFICIENCY = 0.37

# Of a residual's variance, below which the residual is not enlarged further.
LEAST_SHARE = 1e-9


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
            `edtk.inference.find_outliers`.
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
