"""Pictures of a sampled posterior."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.figures import COLOURS, save

Array = NDArray[np.float64]

BLUE, ORANGE = COLOURS[:2]
MOST_POINTS = 20_000  # of a cloud; more only make its contours slower
MOST_SHOWN = 200  # measurements whose residuals are drawn


def draw_figures(check: PosteriorCheck, folder: Path) -> None:
    """Write corner.png, trace.png and residuals.png."""
    save(corner(check), folder / "corner.png")
    save(trace(check), folder / "trace.png")
    save(residuals(check), folder / "residuals.png")


def parameters(check: PosteriorCheck) -> tuple[list[str], Array, Array]:
    """Labels with units, samples (steps, walkers, d) and reference (d,) as a person reads them; nu as its logarithm."""
    posterior, truth = check.posterior, check.table["reference"].to_numpy(dtype=float)
    power = 3 * np.floor(np.log10(posterior.mean) / 3 + 1e-9)
    exponents = [int(e) for e in power]
    named = zip(check.table["parameter"], exponents, check.table["unit"], strict=True)
    labels = [f"{name}\n[$10^{{{e}}}$ {unit}]" for name, e, unit in named]
    names = {"sigma_ratio": "sigma ratio", "nu": "log10 nu"}
    pairs = zip(posterior.noise_names, _columns(posterior.noise), strict=True)
    extra = [np.log10(x) if name == "nu" else x for name, x in pairs]
    samples = np.concatenate(
        [posterior.samples / 10.0**power, *(x[..., None] for x in extra)], axis=-1
    )
    known = check.reference == "assumed truth"
    noise = (1.0 if known and name == "sigma_ratio" else np.nan for name in posterior.noise_names)
    truths = [*(truth / 10.0**power), *noise]
    return labels + [names[n] for n in posterior.noise_names], samples, np.array(truths)


def corner(check: PosteriorCheck) -> Figure:
    """Histograms and pairwise clouds with contours of 39 % and 86 %, one and two deviations of a plane normal."""
    labels, samples, truth = parameters(check)
    d = len(labels)
    flat = samples.reshape(-1, d)
    flat = flat[:: max(1, len(flat) // MOST_POINTS)]
    figure = Figure(
        figsize=(1.6 + 1.55 * d, 1.6 + 1.55 * d),
        layout=ConstrainedLayoutEngine(hspace=0.02, wspace=0.02),
    )
    axes = figure.subplots(d, d, sharex="col", squeeze=False)
    for i in range(d):
        for j in range(d):
            ax: Axes = axes[i, j]
            if j > i:
                ax.set_axis_off()
                continue
            low, high = np.quantile(flat[:, j], [0.0005, 0.9995])
            ax.set_xlim(low, high)
            ax.locator_params(nbins=3)
            ax.tick_params(labelsize=7)
            if i == j:
                ax.hist(flat[:, j], bins=50, range=(low, high), color=BLUE, alpha=0.6)
                ax.set_yticks([])
            else:
                _cloud(ax, flat[:, j], flat[:, i])
                ax.set_ylim(*np.quantile(flat[:, i], [0.0005, 0.9995]))
                ax.axhline(truth[i], color=ORANGE, linewidth=1)
            ax.axvline(truth[j], color=ORANGE, linewidth=1)
            if i == d - 1:
                ax.set_xlabel(labels[j], fontsize=8)
            if j == 0 and i > 0:
                ax.set_ylabel(labels[i], fontsize=8)
            elif j < i:
                ax.set_yticklabels([])
    figure.suptitle(
        f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}", fontsize=11
    )
    return figure


def trace(check: PosteriorCheck) -> Figure:
    """Every walker against the steps after burn-in, and the ensemble's mean."""
    labels, samples, truth = parameters(check)
    d = len(labels)
    figure = Figure(figsize=(9.0, 0.8 + 1.3 * d), layout="constrained")
    axes = figure.subplots(d, 1, sharex=True, squeeze=False)[:, 0]
    every = max(1, len(samples) // 1000)
    steps = np.arange(len(samples))[::every] + check.posterior.steps - len(samples)
    for ax, label, x, true in zip(axes, labels, _columns(samples), truth, strict=True):
        ax.plot(steps, x[::every], color=BLUE, linewidth=0.3, alpha=0.25)
        ax.plot(steps, x[::every].mean(axis=1), color="black", linewidth=0.8)
        ax.axhline(true, color=ORANGE, linewidth=1)
        ax.set_ylabel(label, fontsize=8)
        ax.tick_params(labelsize=7)
        ax.margins(x=0)
    axes[-1].set_xlabel("step")
    figure.suptitle(
        f"Walkers (blue), their mean (black) and {check.reference} (orange)", fontsize=11
    )
    return figure


def residuals(check: PosteriorCheck) -> Figure:
    """Residuals of the posterior mean in units of sigma, over the 95 % band of the posterior predictive.

    The band is of new measurements about the posterior mean: scatter of the model plus noise. Of many measurements
    MOST_SHOWN are shown, evenly spaced.
    """
    posterior, rng = check.posterior, np.random.default_rng(0)
    shown = np.unique(np.linspace(0, len(check.A) - 1, min(len(check.A), MOST_SHOWN)).astype(int))
    A, sigma = check.A[shown], check.sigma[shown]
    m, rows, p = A.shape
    k = posterior.samples.reshape(-1, p)
    chosen = rng.choice(len(k), size=min(4000, len(k)), replace=False)
    noise = posterior.noise.reshape(len(k), -1)[chosen]
    named = dict(zip(posterior.noise_names, noise.T, strict=True))
    s = named.get("sigma_ratio", np.ones(len(chosen)))
    nu = named.get("nu", np.full(len(chosen), np.inf if check.noise.nu is None else check.noise.nu))
    errors = rng.standard_normal((len(chosen), m, rows))
    heavy = np.isfinite(nu)
    if heavy.any():
        shape = (heavy.sum(), m, rows)
        degrees = nu[heavy][:, None, None]
        errors[heavy] /= np.sqrt(rng.chisquare(degrees, shape) / degrees)
    predicted = np.einsum("mrp,np->nmr", A / sigma[..., None], k[chosen] - posterior.mean)
    low, high = np.quantile(predicted + s[:, None, None] * errors, [0.025, 0.975], axis=0)
    found = (check.measured[shown] - A @ posterior.mean) / sigma
    figure = Figure(figsize=(9.0, 1.0 + 1.7 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    x = shown + 1
    for r, (ax, name) in enumerate(
        zip(axes, ("x", "y", "z", "rot x", "rot y", "rot z"), strict=False)
    ):
        ax.vlines(x, low[:, r], high[:, r], color=BLUE, alpha=0.25, linewidth=max(1.5, 350 / m))
        ax.axhline(0, color="black", linewidth=0.6)
        ax.plot(x, found[:, r], "o", color=ORANGE, markersize=5 if m <= 60 else 3)
        ax.set_ylabel(f"{name}  [sigma]", fontsize=9)
        ax.tick_params(labelsize=8)
    axes[-1].set_xlabel("measurement")
    axes[-1].set_xticks(x if m <= 24 else np.unique(np.linspace(1, len(check.A), 12).astype(int)))
    inside = np.mean((found >= low) & (found <= high))
    figure.suptitle(
        f"Residuals, and where 95 % of new measurements would fall: {100 * inside:.0f} % are inside",
        fontsize=11,
    )
    return figure


def _columns(x: Array) -> Array:
    return np.moveaxis(x, -1, 0)


def _cloud(ax: Axes, x: Array, y: Array) -> None:
    """Filled contours of the histogram at the heights that hold 39 % and 86 % of the points."""
    counts, xs, ys = np.histogram2d(x, y, bins=30)
    smooth = np.pad(counts, 1)
    smooth = smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]
    smooth = (smooth[:, :-2] + 2 * smooth[:, 1:-1] + smooth[:, 2:]) / 16
    heights = np.sort(smooth.ravel())[::-1]
    mass = np.cumsum(heights) / heights.sum()
    levels = [heights[np.searchsorted(mass, level)] for level in (0.865, 0.393)]
    middle = [0.5 * (edges[1:] + edges[:-1]) for edges in (xs, ys)]
    if levels[0] < levels[1] < smooth.max():
        ax.contourf(
            *middle, smooth.T, levels=[*levels, smooth.max()], colors=[BLUE, BLUE], alpha=0.35
        )
        ax.contour(*middle, smooth.T, levels=levels, colors=BLUE, linewidths=0.8)
