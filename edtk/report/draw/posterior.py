"""Samples of a posterior: clouds, chains, and where new measurements would fall."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.fit.correlated_noise import whiten, whiten_columns
from edtk.measure.pose_table import coordinate_names
from edtk.report.draw.bars import short_names
from edtk.report.figures import BLUE, ORANGE
from edtk.report.shown import plain
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWN_POINTS = 500  # points that are drawn evenly, and as many of the largest
NOISE_LABELS = {"sigma_ratio": "sigma ratio", "nu": "log10 nu"}
MOST_POINTS = 20_000  # of a cloud; more only make its contours slower
EDGES = (0.0005, 0.9995)  # quantiles that are shown
CLOUD = (0.865, 0.393)  # of the points inside two deviations and one of a plane normal
BINS = 30  # of a cloud, along each axis
MOST_STEPS = 1000  # that are drawn
MOST_MEASUREMENTS = 200  # that are drawn
MOST_SAMPLES = 4000  # from which the bands are computed
MOST_PANELS = 24  # a picture of more would be metres high
MOST_UNKNOWNS = 8  # of a corner, which has a panel for each pair
FEW_MEASUREMENTS = 24  # measurements that all have a tick


def thinned(sizes: Array) -> Indices:
    """Indices of all points, or of many some and the largest."""
    m = len(sizes)
    if m <= 2 * DRAWN_POINTS:
        return np.arange(m)
    largest = np.argpartition(-sizes, DRAWN_POINTS)[:DRAWN_POINTS]
    return np.union1d(np.linspace(0, m - 1, DRAWN_POINTS).astype(int), largest)


@dataclass(frozen=True, eq=False)
class LabelledSamples:
    """Parameters, and the unknowns of the noise.

    Attributes:
        labels: Names with units (d,).
        samples: Samples (steps, walkers, d), of equal weight; nu as its logarithm.
        reference: Values (d,) to compare with; NaN without one.
        some: Which of them these are, in words; empty where they are all.
    """

    labels: list[str]
    samples: Array
    reference: Array
    some: str = ""

    @classmethod
    def of(cls, check: PosteriorCheck) -> "LabelledSamples":
        """The samples of a posterior, parameters in powers of a thousand of their unit.

        Of very many parameters those are shown whose posterior is the least like the fit.
        """
        posterior = check.posterior.evenly()
        unlike = np.argsort(-np.abs(np.log(check.table["ratio"].to_numpy())), kind="stable")
        shown = np.sort(unlike[:MOST_UNKNOWNS])
        table = check.table.iloc[shown]
        size = np.maximum(np.abs(posterior.mean), posterior.std)[shown]
        power = 3 * np.floor(np.log10(size) / 3 + 1e-9)
        names = short_names(list(table["parameter"]))
        labels = [
            f"{plain(name)}\n[{_scaled(int(exponent), unit)}]"
            for name, exponent, unit in zip(names, power, table["unit"], strict=True)
        ]
        reference = table["reference"].to_numpy(dtype=float) / 10.0**power
        columns = [posterior.samples[..., shown] / 10.0**power]
        known = check.reference == "assumed truth"
        noise_reference = []
        for i, name in enumerate(posterior.noise_names):
            column = posterior.noise[..., i : i + 1]
            columns.append(np.log10(column) if name == "nu" else column)
            noise_reference.append(1.0 if known and name == "sigma_ratio" else np.nan)
            labels.append(NOISE_LABELS[name])
        samples = np.concatenate(columns, axis=-1)
        some = ""
        if len(shown) < len(check.table):
            some = f"the {len(shown)} of {len(check.table)} parameters that are least like the fit"
        return cls(labels, samples, np.array([*reference, *noise_reference]), some)


def _scaled(exponent: int, unit: str) -> str:
    """A power of ten of a unit."""
    return f"$10^{{{exponent}}}$ {unit}" if exponent else unit


def corner(shown: LabelledSamples, axes: np.ndarray) -> None:
    """Draw each unknown, and each pair of them with contours of 39 % and 86 %.

    Args:
        shown: The samples.
        axes: Axes (d, d); those above the diagonal stay empty.
    """
    d = len(shown.labels)
    points = shown.samples.reshape(-1, d)
    points = points[:: max(1, len(points) // MOST_POINTS)]
    for i in range(d):
        for j in range(d):
            if j > i:
                axes[i, j].set_axis_off()
            else:
                _panel(shown, points, i, j, axes[i, j])


def _panel(shown: LabelledSamples, points: Array, i: int, j: int, ax: "Axes") -> None:
    """Unknown i over unknown j, or one of them alone."""
    low, high = np.quantile(points[:, j], EDGES)
    ax.set_xlim(low, high)
    ax.locator_params(nbins=3)
    ax.tick_params(labelsize=7)
    if i == j:
        ax.hist(points[:, j], bins=50, range=(low, high), color=BLUE, alpha=0.6)
        ax.set_yticks([])
    else:
        _cloud(ax, points[:, j], points[:, i])
        ax.set_ylim(*np.quantile(points[:, i], EDGES))
        ax.axhline(shown.reference[i], color=ORANGE, linewidth=1)
    ax.axvline(shown.reference[j], color=ORANGE, linewidth=1)
    if i == len(shown.labels) - 1:
        ax.set_xlabel(shown.labels[j], fontsize=8)
    if j == 0 and i > 0:
        ax.set_ylabel(shown.labels[i], fontsize=8)
    elif j < i:
        ax.set_yticklabels([])


def _cloud(ax: "Axes", x: Array, y: Array) -> None:
    """Filled contours of the histogram at the heights that hold 39 % and 86 % of the points."""
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=BINS)
    smooth = np.pad(counts, 1)
    smooth = smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]
    smooth = (smooth[:, :-2] + 2 * smooth[:, 1:-1] + smooth[:, 2:]) / 16
    heights = np.sort(smooth.ravel())[::-1]
    mass = np.cumsum(heights) / heights.sum()
    levels = [heights[np.searchsorted(mass, share)] for share in CLOUD]
    middle = [0.5 * (edges[1:] + edges[:-1]) for edges in (x_edges, y_edges)]
    # Few samples may give both contours the same height, which matplotlib refuses.
    if levels[0] < levels[1] < smooth.max():
        filled = [*levels, smooth.max()]
        ax.contourf(*middle, smooth.T, levels=filled, colors=[BLUE, BLUE], alpha=0.35)
        ax.contour(*middle, smooth.T, levels=levels, colors=BLUE, linewidths=0.8)


def trace(shown: LabelledSamples, last_step: int, axes: np.ndarray) -> None:
    """Draw every walker against the steps after burn-in, and the ensemble's mean.

    Args:
        shown: The samples.
        last_step: Number of the last step.
        axes: Axes (d,), one for each unknown.
    """
    count = len(shown.samples)
    every = max(1, count // MOST_STEPS)
    steps = np.arange(count)[::every] + last_step - count
    for i, ax in enumerate(axes):
        walkers = shown.samples[::every, :, i]
        ax.plot(steps, walkers, color=BLUE, linewidth=0.3, alpha=0.25, rasterized=True)
        ax.plot(steps, walkers.mean(axis=1), color="black", linewidth=0.8)
        ax.axhline(shown.reference[i], color=ORANGE, linewidth=1)
        ax.set_ylabel(shown.labels[i], fontsize=8)
        ax.tick_params(labelsize=7)
        ax.margins(x=0)
    axes[-1].set_xlabel("step")


@dataclass(frozen=True, eq=False)
class PredictiveResiduals:
    """Residuals of the posterior mean over the 95 % band of the posterior predictive, in sigma.

    Residuals are NaN where nothing was measured. The band is of new measurements about the
    posterior mean: scatter of the model plus noise.

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
        inside = (self.residual >= self.low) & (self.residual <= self.high)
        return float(inside[np.isfinite(self.residual)].mean())

    @classmethod
    def of(cls, check: PosteriorCheck) -> "PredictiveResiduals":
        """Simulate new measurements; of many measurements some are shown, evenly spaced."""
        count = min(len(check.A), MOST_MEASUREMENTS)
        shown = np.unique(np.linspace(0, len(check.A) - 1, count).astype(int))
        A = check.A[shown]
        sigma = check.sigma[shown]
        mean = check.posterior.mean
        rng = np.random.default_rng(0)
        k = check.posterior.evenly().samples.reshape(-1, A.shape[2])
        chosen = rng.choice(len(k), size=min(MOST_SAMPLES, len(k)), replace=False)
        errors = _errors(check, chosen, A.shape[:2], rng)
        predicted = np.einsum("mrp,np->nmr", whiten_columns(A, sigma), k[chosen] - mean)
        low, high = np.quantile(predicted + errors, [0.025, 0.975], axis=0)
        names = check.coordinates or coordinate_names(A.shape[1])
        apart = check.measured[shown] - check.predicted[shown]
        return cls(shown, whiten(apart, sigma), low, high, names)


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
    axes[-1].set_xticks(x if m <= FEW_MEASUREMENTS else some)
