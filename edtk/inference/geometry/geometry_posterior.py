"""The posterior of geometry and springs, sampled or by Laplace's approximation with a check."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.inference.geometry.geometry_density import GeometryDensity
from edtk.inference.run_chain import run_chain
from edtk.inference.sample_posterior import SamplingOptions
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

MOST_SAMPLED = 12  # parameters, up to which a chain converges in minutes
DRAWS = 2000  # of the normal approximation, that are checked
TRUSTED = 0.5  # share of these draws that have to be effective
LAPLACE = "Laplace"
EMCEE = "emcee"


@dataclass(frozen=True, eq=False)
class GeometryPosterior(Presented):
    """What is known of the parameters, with the sizes of the errors as they were fitted.

    Attributes:
        method: "emcee", or "Laplace" where there are too many parameters for a chain.
        parameters: Names (p,).
        units: Their units (p,).
        identified: Estimates (p,) of the fit.
        std_fit: Their standard deviations.
        samples: Draws (s, p), in the units.
        weights: Weights (s,) of the draws, of sum one: those of a chain are equal. Those of
            Laplace's approximation are the nonlinear density over the normal one, so that what is
            said below is of the nonlinear density.
        effective: Effective number of draws, of all parameters or of the worst.
        std_laplace: Standard deviations (p,) of the normal approximation.
        steps: Length of the chain, or number of draws.
        walkers: Of the chain; one without.
    """

    method: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    identified: Array
    std_fit: Array
    samples: Array
    weights: Array
    effective: float
    std_laplace: Array
    steps: int
    walkers: int

    def headline(self) -> str:
        """How it was computed, and how far it can be trusted."""
        return f"{len(self.parameters)} parameters, {self.quality}"

    @property
    def trusted(self) -> bool:
        """Whether the draws tell of the nonlinear density."""
        return self.method == EMCEE or self.effective >= TRUSTED * len(self.samples)

    @property
    def quality(self) -> str:
        """How it was computed, and the check, in words."""
        if self.method == EMCEE:
            return (
                f"sampled by emcee: {self.walkers} walkers, {self.steps} steps, at least "
                f"{self.effective:.0f} effective samples"
            )
        share = 100 * self.effective / len(self.samples)
        text = (
            f"Laplace's approximation, checked by {self.steps} draws weighted with the nonlinear "
            f"density: {share:.0f} % are effective"
        )
        return text if self.trusted else f"{text}, too few to trust it"

    @property
    def mean(self) -> Array:
        """Posterior means (p,)."""
        return np.asarray(self.weights @ self.samples)

    @property
    def std(self) -> Array:
        """Posterior standard deviations (p,)."""
        return np.asarray(np.sqrt(self.weights @ (self.samples - self.mean) ** 2))

    def interval(self, level: float = 0.95) -> Array:
        """Ends (2, p) of the central intervals that hold the parameters with that probability."""
        ends = np.array([(1 - level) / 2, (1 + level) / 2])
        found = np.empty((2, len(self.parameters)))
        for i, values in enumerate(self.samples.T):
            order = np.argsort(values)
            below = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
            found[:, i] = np.interp(ends, below, values[order])
        return found

    def to_frame(self) -> "pd.DataFrame":
        """One row a parameter, in its unit.

        Columns: `parameter`, `unit`, `reference` (the estimate of the fit), `mean`, `low_95`,
        `high_95`, `std_posterior`, `std_fit`, `ratio`, `effective_samples`.
        """
        import pandas as pd

        low, high = self.interval()
        return pd.DataFrame(
            {
                "parameter": self.parameters,
                "unit": self.units,
                "reference": self.identified,
                "mean": self.mean,
                "low_95": low,
                "high_95": high,
                "std_posterior": self.std,
                "std_fit": self.std_fit,
                "ratio": self.std / self.std_fit,
                "effective_samples": self.effective,
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data, in the units of the parameters."""
        return {
            "method": self.method,
            "parameters": self.to_frame().to_dict(orient="records"),
            "steps": self.steps,
            "walkers": self.walkers,
            "effective_share": self.effective / len(self.samples),
            "trusted": self.trusted,
        }


def geometry_posterior(
    density: GeometryDensity,
    fitted: tuple[Array, Array],
    rng: np.random.Generator,
    options: SamplingOptions,
) -> GeometryPosterior:
    """Sample the density by emcee, or where it has many parameters by Laplace's approximation.

    Draws of the normal approximation have the weights ``density / normal``. Were it wrong, few of
    them would have most of the weight: their effective number ``1 / sum w^2`` (Kong 1992) is the
    check.

    Args:
        density: What is known.
        fitted: Estimates and standard deviations (p,) of the fit.
        rng: Source of randomness.
        options: How accurately a chain is sampled.

    Raises:
        UnconvergedError: The chain does not converge.
    """
    parameters = density.model.parameters
    p = len(parameters)
    seed = int(rng.integers(2**31))
    common = {
        "parameters": tuple(one.name for one in parameters),
        "units": tuple(one.unit for one in parameters),
        "identified": fitted[0],
        "std_fit": fitted[1],
        "std_laplace": np.linalg.norm(density.root, axis=1),
    }
    if p <= MOST_SAMPLED:
        walkers = max(options.walkers, 4 * p)
        start = rng.standard_normal((walkers, p))
        chain = run_chain(density, start, seed, options.demand, progress=options.progress)
        samples = chain.samples.reshape(-1, p)
        return GeometryPosterior(
            method=EMCEE,
            samples=samples,
            weights=np.full(len(samples), 1 / len(samples)),
            effective=float(len(samples) / chain.tau.max()),
            steps=chain.steps,
            walkers=walkers,
            **common,
        )
    x = rng.standard_normal((DRAWS, p))
    log_weights = density.log_density(x) + 0.5 * (x**2).sum(axis=1)
    weights = np.exp(log_weights - log_weights.max())
    weights = weights / weights.sum()
    return GeometryPosterior(
        method=LAPLACE,
        samples=density.parameters(x),
        weights=weights,
        effective=float(1 / (weights**2).sum()),
        steps=DRAWS,
        walkers=1,
        **common,
    )
