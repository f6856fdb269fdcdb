"""The report of a calibration: verdict first, then tables and pictures, in one HTML file."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import probplot

from edtk.calibration.diagnostics import Diagnostic
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.identification import Identification
from edtk.report.digits import digits
from edtk.report.figures import COLOURS
from edtk.report.html import Page, footer, heading, paragraph, picture, table, verdict
from edtk.report.posterior_report import posterior_part
from edtk.study.study import Study
from edtk.version import __version__

Array = NDArray[np.float64]
LEVELS = ("good", "warn", "bad")
SHOWN = 8  # rows of the table of residuals
AXES = ("x", "y", "z", "rotation x", "rotation y", "rotation z")


def identification_page(
    study: Study,
    fit: Identification,
    pose: NDArray[np.int_],
    name: str,
    diagnostics: tuple[Diagnostic, ...] = (),
    rho0_bias: float | None = None,
    check: PosteriorCheck | None = None,
) -> str:
    """The text of `report.html`.

    Args:
        study: The question, with its test pose where it has one.
        fit: What was identified from the measurements.
        pose: Number (m,) of the pose of each measurement, counted from 0.
        name: Name of the measurement file.
        diagnostics: What looks wrong, the worst first.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
        check: The posterior; None where it was not sampled.
    """
    page = Page(f"Calibration: {study.specification.title}") + _verdict(
        study, fit, diagnostics, rho0_bias
    )
    page = (
        page
        + heading("Compliances")
        + _compliances(study, fit)
        + picture(_intervals(study, fit), _INTERVALS)
    )
    page = page + heading("Do the residuals fit the noise?") + paragraph(_noise(fit))
    page = (
        page
        + picture(_residuals(fit), _RESIDUALS)
        + picture(_quantiles(fit), _QUANTILES)
        + _worst(fit, pose)
    )
    page = page + heading("Which parameters depend on each other?")
    page = page + picture(_correlation(study, fit), _CORRELATION)
    if check is not None:
        page = page + posterior_part(check)
    rows, poses = len(fit.residual), int(pose.max()) + 1
    note = (
        f"{name}: {rows} measurements in {poses} poses; robot {study.robot.name}; study {study.digest}; "
        f"edtk {__version__}."
    )
    return (page + footer(note)).html()


_INTERVALS = "Identified compliances with 95 % intervals, relative to the estimate."
_RESIDUALS = (
    "Measured minus predicted, by measurement; grey: twice what the noise makes of them; "
    "circles: flagged as outliers."
)
_QUANTILES = "Standardised residuals against the normal law: on the line where they follow it."
_CORRELATION = "Correlation of the estimates."


def verdict_level(diagnostics: tuple[Diagnostic, ...]) -> str:
    """Of a calibration with these doubts: "good", "warn" or "bad"."""
    return LEVELS[max((diagnostic.severity for diagnostic in diagnostics), default=0)]


def _verdict(
    study: Study, fit: Identification, diagnostics: tuple[Diagnostic, ...], rho0_bias: float | None
) -> str:
    """What accuracy to expect, and what is wrong, the most important first."""
    level = verdict_level(diagnostics)
    quality = {
        "good": "Good calibration.",
        "warn": "Usable calibration, with a warning.",
        "bad": "Do not use this calibration yet.",
    }[level]
    lines = [quality if level == "bad" else f"{quality} {_expected(study, fit, rho0_bias)}"]
    if level == "good":
        noise = (
            "the residuals fit the noise"
            if fit.known
            else "the noise was estimated and is not larger than stated"
        )
        lines.append(
            f"Nothing is wrong: {noise}, there are no outliers, all compliances are positive."
        )
    lines += [f"{_sentence(study, diagnostic.text)}." for diagnostic in diagnostics]
    if study.rigid and level != "bad":
        lines.append(f"{_sentence(study, study.rigid)}.")
    return verdict(level, lines)


def _sentence(study: Study, text: str) -> str:
    """The text with a capital letter, unless it begins with the name of a parameter."""
    return text if text.startswith(study.model.parameters) else f"{text[:1].upper()}{text[1:]}"


def _expected(study: Study, fit: Identification, rho0_bias: float | None) -> str:
    """The accuracy to expect, in one or two sentences."""
    if study.target is None:
        worst = int(np.argmax(fit.std / np.maximum(np.abs(fit.k), 1e-300)))
        share = 100 * fit.std[worst] / max(abs(fit.k[worst]), 1e-300)
        return f"The least certain compliance is {study.model.parameters[worst]}, to {share:.2g} %."
    value, (low, high) = fit.accuracy(study.target)
    text = f"Expect an error of {1e3 * value:.2g} mm (root mean square) in the test pose after compensation"
    text += "." if low == high else f", between {1e3 * low:.2g} and {1e3 * high:.2g} mm (95 %)."
    both = "" if rho0_bias is None else f"{1e3 * np.hypot(value, rho0_bias):.2g}"
    if both in ("", f"{1e3 * value:.2g}"):
        return text
    return f"{text} What the linear model leaves out makes it {both} mm."


def _compliances(study: Study, fit: Identification) -> str:
    """One row a parameter."""
    rows = []
    given = zip(
        study.model.parameters, fit.k, fit.unbounded, fit.std, fit.half_interval, strict=True
    )
    for name, k, unbounded, std, half in given:
        share = f"{100 * std / k:.2g} %" if k > 0 else "-"
        low, high = max(unbounded - half, 0.0), max(unbounded + half, 0.0)
        rows.append(
            [
                name,
                digits(k, std),
                f"{std:.1e}",
                share,
                f"{digits(low, std)} .. {digits(high, std)}",
            ]
        )
    return table(["parameter", study.model.unit, "std", "std, relative", "95 % interval"], rows)


def _noise(fit: Identification) -> str:
    """What chi-square says."""
    if not fit.dof:
        return "As many coordinates as parameters were measured: nothing is left to judge the noise by."
    how = "identified with Huber's loss, by which outliers count less; " if fit.robust else ""
    text = f"{how}chi-square = {fit.chi2:.4g} for {fit.dof} degrees of freedom; "
    text += f"noise is {fit.scale:.3g} times the stated"
    return text + (
        f", p = {fit.p_value:.2g}." if fit.p_value is not None else ", and was estimated."
    )


def _worst(fit: Identification, pose: NDArray[np.int_]) -> str:
    """The measurements that fit least."""
    z = np.abs(fit.standardised)
    rows = []
    for i in np.argsort(-z.max(axis=1), kind="stable")[:SHOWN]:
        flag, j = "outlier" if i in fit.outliers else "", int(z[i].argmax())
        shown = [f"{1e3 * r:+.4f}" for r in fit.residual[i, :3]] + [
            f"{np.rad2deg(r):+.4f}" for r in fit.residual[i, 3:]
        ]
        rows.append(
            [
                i + 1,
                pose[i] + 1,
                *shown,
                f"{z[i, j]:.2f} ({AXES[j]})",
                f"{fit.leverage[i].max():.2f}",
                flag,
            ]
        )
    units = [f"{axis} [{'mm' if j < 3 else 'deg'}]" for j, axis in enumerate(AXES[: z.shape[1]])]
    return table(["row", "pose", *units, "largest, standardised", "leverage", ""], rows)


def _intervals(study: Study, fit: Identification) -> Figure:
    """Relative 95 % intervals of the compliances."""
    figure = Figure(figsize=(6.4, 0.8 + 0.4 * len(fit.k)), layout="constrained")
    ax = figure.add_subplot()
    scale = np.where(fit.k > 0, fit.k, fit.std)
    half = 100 * fit.half_interval / scale
    at = np.arange(len(fit.k))
    ax.errorbar(np.zeros(len(at)), at, xerr=half, fmt="o", color=COLOURS[0], capsize=4)
    ax.set_yticks(at, study.model.parameters)
    ax.set_ylim(len(at) - 0.5, -0.5)
    ax.set_xlabel("deviation from the estimate [%]")
    ax.grid(axis="x", alpha=0.3)
    return figure


def _residuals(fit: Identification) -> Figure:
    """Residuals by measurement and coordinate: positions, and below them rotations where they are measured."""
    parts = fit.residual.shape[1] // 3
    figure = Figure(figsize=(6.4, 0.8 + 2.8 * parts), layout="constrained")
    axes = figure.subplots(parts, 1, sharex=True, squeeze=False)[:, 0]
    at, worst = 1 + np.arange(len(fit.residual)), np.abs(fit.standardised).argmax(axis=1)
    for part, (ax, factor, unit) in enumerate(
        zip(axes, (1e3, 180 / np.pi), ("mm", "deg"), strict=False)
    ):
        chosen = slice(3 * part, 3 * part + 3)
        residual, z = factor * fit.residual[:, chosen], fit.standardised[:, chosen]
        for j in range(3):
            ax.plot(
                at,
                residual[:, j],
                linestyle="",
                marker="osD"[j],
                markersize=4,
                color=COLOURS[j],
                label="xyz"[j],
            )
        band = 2 * float(np.median(np.abs(residual / np.where(z == 0, 1, z))))
        ax.axhspan(-band, band, color="grey", alpha=0.15, linewidth=0)
        here = fit.outliers[worst[fit.outliers] // 3 == part]
        if len(here):
            ax.plot(
                here + 1,
                residual[here, worst[here] - 3 * part],
                linestyle="",
                marker="o",
                markersize=12,
                fillstyle="none",
                color=COLOURS[1],
                label="outlier",
            )
        ax.set_ylabel(f"{'rotation ' * part}residual [{unit}]")
        ax.grid(alpha=0.3)
        ax.legend(ncols=4, fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes[-1].set_xlabel("measurement (row of the file)")
    return figure


def _quantiles(fit: Identification) -> Figure:
    """Normal quantile plot of the standardised residuals."""
    figure = Figure(figsize=(4.2, 3.8), layout="constrained")
    ax = figure.add_subplot()
    z = fit.standardised[np.isfinite(fit.standardised)]
    if len(z) > 1:
        expected, seen = probplot(z, fit=False)
        ax.plot(expected, seen, linestyle="", marker="o", markersize=3, color=COLOURS[0])
        ends = np.array([min(expected), max(expected)])
        ax.plot(ends, ends, color="black", linewidth=1, linestyle="--")
    ax.set(xlabel="normal quantile", ylabel="standardised residual")
    ax.grid(alpha=0.3)
    return figure


def _correlation(study: Study, fit: Identification) -> Figure:
    """Correlation matrix with its numbers."""
    p = len(fit.k)
    figure = Figure(figsize=(1.6 + 0.65 * p, 1.0 + 0.5 * p), layout="constrained")
    ax = figure.add_subplot()
    image = ax.imshow(fit.correlation, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for i in range(p):
        for j in range(p):
            value = fit.correlation[i, j]
            ax.text(
                j,
                i,
                f"{value:.2f}",
                ha="center",
                va="center",
                fontsize=8,
                color="white" if abs(value) > 0.6 else "black",
            )
    ax.set_xticks(range(p), study.model.parameters)
    ax.set_yticks(range(p), study.model.parameters)
    figure.colorbar(image, ax=ax)
    return figure
