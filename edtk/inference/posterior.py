"""Samples of the compliances, with what they say and how far they can be trusted."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.convergence import std_error
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Posterior(Presented):
    """The sampled posterior of the compliances.

    Attributes:
        samples: Kept samples (steps, walkers, p), burn-in removed [rad/(N m)].
        tau: Integrated autocorrelation times (p,), in steps.
        steps: Length of the whole chain.
        r_hat: Split-chain potential scale reductions (p,).
        noise_tau: Integrated autocorrelation times (e,) of the logarithms of what is unknown of the
            noise, in steps.
        noise: Samples of what is unknown of the noise (steps, walkers, e), by `noise_names`.
        noise_names: "sigma_ratio", "nu", both or neither.
        parameters: Names (p,) of the compliances; empty where nobody gave names.
    """

    samples: Array
    tau: Array
    steps: int
    r_hat: Array
    noise_tau: Array
    noise: Array
    noise_names: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()

    def headline(self) -> str:
        """How many compliances, and how long and how good the chain is."""
        steps, walkers, p = self.samples.shape
        return (
            f"{p} compliances, {steps} steps of {walkers} walkers, at least "
            f"{self.effective.min():.0f} effective samples, R-hat up to {self.r_hat.max():.4f}"
        )

    @property
    def mean(self) -> Array:
        """Posterior means (p,) [rad/(N m)]."""
        return self.samples.mean(axis=(0, 1))

    @property
    def std(self) -> Array:
        """Posterior standard deviations (p,) [rad/(N m)]."""
        return self.samples.std(axis=(0, 1))

    @property
    def covariance(self) -> Array:
        """Posterior covariance (p, p)."""
        return np.atleast_2d(np.cov(self.samples.reshape(-1, self.samples.shape[-1]).T, ddof=0))

    @property
    def effective(self) -> Array:
        """Effective number of independent samples (p,)."""
        return np.prod(self.samples.shape[:2]) / self.tau

    @property
    def std_error(self) -> Array:
        """Monte-Carlo standard error (p,) of `std` [rad/(N m)]."""
        return self.std * std_error(self.samples)

    def interval(self, level: float = 0.95) -> Array:
        """Ends (2, p) of the central intervals that hold the compliances with that probability."""
        return np.quantile(self.samples, [(1 - level) / 2, (1 + level) / 2], axis=(0, 1))

    def to_frame(self) -> "pd.DataFrame":
        """One row a compliance, SI units.

        Columns: `parameter`, `mean`, `std`, `low_95`, `high_95`, `std_error`, `tau_steps`, `r_hat`
        and `effective_samples`.
        """
        import pandas as pd

        low, high = self.interval()
        numbered = tuple(str(i + 1) for i in range(self.samples.shape[-1]))
        return pd.DataFrame(
            {
                "parameter": self.parameters or numbered,
                "mean": self.mean,
                "std": self.std,
                "low_95": low,
                "high_95": high,
                "std_error": self.std_error,
                "tau_steps": self.tau,
                "r_hat": self.r_hat,
                "effective_samples": self.effective,
            }
        )
