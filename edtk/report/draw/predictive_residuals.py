"""Residuals of a posterior, and where new measurements would fall."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.whiten import whiten, whiten_columns
from edtk.report.draw.short_names import short_names
from edtk.report.palette import BLUE, ORANGE
from edtk.report.plain import plain
from edtk.system.typing import Array, Indices
from edtk.tables.coordinate_columns import coordinate_names

MOST_MEASUREMENTS = 200  # that are drawn
MOST_SAMPLES = 4000  # from which the bands are computed
MOST_PANELS = 24  # a picture of more would be metres high
FEW = 24  # measurements that all have a tick


@dataclass(frozen=True, eq=False)
class PredictiveResiduals:
    """Residuals of the posterior mean over the 95 % band of the posterior predictive, in sigma.

    The band is of new measurements about the posterior mean: scatter of the model plus noise.

    Attributes:
        shown: Measurements (m,) that are drawn, counted from 0.
        residual: Residuals (m, rows).
        low: Lower ends (m, rows) of the bands.
        high: Upper ends (m, rows) of the bands.
        names: What the rows are called.
    """

    shown: Indices
    residual: Array
    low: Array
    high: Array
    names: tuple[str, ...]

    @property
    def inside(self) -> float:
        """Share of the residuals that are inside their bands."""
        return float(np.mean((self.residual >= self.low) & (self.residual <= self.high)))

    @classmethod
    def of(cls, check: PosteriorCheck) -> "PredictiveResiduals":
        """Simulate new measurements; of many measurements some are shown, evenly spaced."""
        count = min(len(check.A), MOST_MEASUREMENTS)
        shown = np.unique(np.linspace(0, len(check.A) - 1, count).astype(int))
        A = check.A[shown]
        sigma = check.sigma[shown]
        mean = check.posterior.mean
        rng = np.random.default_rng(0)
        k = check.posterior.samples.reshape(-1, A.shape[2])
        chosen = rng.choice(len(k), size=min(MOST_SAMPLES, len(k)), replace=False)
        errors = _errors(check, chosen, A.shape[:2], rng)
        predicted = np.einsum("mrp,np->nmr", whiten_columns(A, sigma), k[chosen] - mean)
        low, high = np.quantile(predicted + errors, [0.025, 0.975], axis=0)
        names = check.coordinates or coordinate_names(A.shape[1])
        return cls(shown, whiten(check.measured[shown] - A @ mean, sigma), low, high, names)


def _errors(
    check: PosteriorCheck, chosen: Indices, shape: tuple[int, ...], rng: np.random.Generator
) -> Array:
    """Errors (n, m, rows) of new measurements in sigma, for chosen samples (n,) of the noise."""
    posterior = check.posterior
    samples = np.prod(posterior.noise.shape[:2])
    noise = posterior.noise.reshape(samples, len(posterior.noise_names))[chosen]
    unknown = dict(zip(posterior.noise_names, noise.T, strict=True))
    ratio = unknown.get("sigma_ratio", np.ones(len(chosen)))
    fixed_nu = np.inf if check.noise.nu is None else check.noise.nu
    nu = unknown.get("nu", np.full(len(chosen), fixed_nu))
    errors = rng.standard_normal((len(chosen), *shape))
    heavy = np.isfinite(nu)
    if heavy.any():
        # Student's t is a normal number over the root of a chi-square one over nu.
        degrees = nu[heavy][:, None, None]
        errors[heavy] /= np.sqrt(rng.chisquare(degrees, (heavy.sum(), *shape)) / degrees)
    return ratio[:, None, None] * errors


def predictive_residuals(found: PredictiveResiduals, axes: np.ndarray) -> None:
    """Draw residuals over their bands, a panel for each of the first measured coordinates."""
    m = len(found.shown)
    names = short_names([name.replace("rotation", "rot") for name in found.names])
    x = found.shown + 1
    width = max(1.5, 350 / m)
    size = 5 if m <= 60 else 3
    for row, ax in enumerate(axes):
        low = found.low[:, row]
        high = found.high[:, row]
        ax.vlines(x, low, high, color=BLUE, alpha=0.25, linewidth=width)
        ax.axhline(0, color="black", linewidth=0.6)
        ax.plot(x, found.residual[:, row], "o", color=ORANGE, markersize=size)
        ax.set_ylabel(f"{plain(names[row])}\n[sigma]", fontsize=9)
        ax.tick_params(labelsize=8)
    axes[-1].set_xlabel("measurement")
    some = np.unique(np.linspace(1, found.shown[-1] + 1, 12).astype(int))
    axes[-1].set_xticks(x if m <= FEW else some)
