"""The report of a calibration: verdict first, then tables and pictures, in one HTML file."""

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.inference.identification import Identification
from edtk.report.budget_section import budget_section
from edtk.report.calibration_facts import calibration_facts
from edtk.report.calibration_title import calibration_title
from edtk.report.calibration_verdict import calibration_verdict
from edtk.report.digits import digits
from edtk.report.draw.correlation import correlation
from edtk.report.draw.intervals import intervals
from edtk.report.draw.name_ticks import room_for
from edtk.report.draw.quantiles import quantiles
from edtk.report.draw.residuals import ResidualPanel, drawn_rows, residuals
from edtk.report.new_figure import new_figure
from edtk.report.noise_parts import noise_parts
from edtk.report.page import Page, paragraph, picture, section, table
from edtk.report.posterior_report import posterior_report
from edtk.report.residual_causes import residual_causes
from edtk.report.shown_probability import shown_probability
from edtk.report.task_section import task_section
from edtk.tables.coordinate_columns import coordinate_names

SHOWN = 8  # rows of the table of residuals
WIDTH = 4.4  # of a picture [inch]: letters can be read on a phone, and on a desk two have room
UNITLESS = ("parameter", "std [%]")  # columns that do not have the parameters' unit


def calibration_report(found: Calibration) -> str:
    """The text of `report.html`."""
    parts = [
        calibration_verdict(found),
        *([] if found.budget is None else [budget_section(found, found.budget)]),
        *([] if found.tasks is None else [task_section(found.tasks)]),
        section(
            "Compliances",
            _compliances(found),
            *([paragraph(f"{found.assumed.capitalize()}.")] if found.assumed else []),
            _intervals(found),
            *_interest(found),
        ),
        section(
            "Do the residuals fit the noise?",
            paragraph(_noise(found)),
            *residual_causes(found),
            *noise_parts(found),
            _residuals(found),
            _quantiles(found.fit),
            paragraph("The measurements that fit least:"),
            _worst(found),
        ),
        section("Which parameters depend on each other?", _correlation(found), _pairs(found)),
    ]
    if found.check is not None:
        parts.append(posterior_report(found.check))
    parts.append(calibration_facts(found))
    return Page(calibration_title(found.study), tuple(parts)).html()


def _compliances(found: Calibration) -> str:
    """A table with a row for each parameter."""
    fit = found.fit
    low, high = fit.interval
    model = found.study.model
    rows = []
    for i, name in enumerate(found.parameters):
        k = fit.k[i]
        std = fit.std[i]
        relative = f"{100 * std / k:.2g}" if k > 0 else "-"
        # Both ends have the digits of the larger.
        ends = f"{digits(low[i], std, high[i])} to {digits(high[i], std)}"
        rows.append([name, digits(k, std), f"{std:.1e}", relative, ends])
    header = ["parameter", "estimate", "std", "std [%]", "95 % interval"]
    units = set(model.units)
    if len(units) > 1:
        rows = [[*row, unit] for row, unit in zip(rows, model.units, strict=True)]
        return table([*header, "unit"], rows)
    unit = f"[{units.pop()}]"
    return table([name if name in UNITLESS else f"{name} {unit}" for name in header], rows)


def _interest(found: Calibration) -> list[str]:
    """What is of interest, where the study says so, and what is left open."""
    if not found.interest:
        return []
    rows = [
        [name, digits(value, std), f"{std:.1e}"] for name, (value, std) in found.interest.items()
    ]
    unit = f"[{found.asked.model.unit}]"
    parts = [table(["of interest", f"estimate {unit}", f"std {unit}"], rows)]
    if found.part is not None:
        rigid = ", ".join(found.part.rigid)
        parts.append(
            paragraph(
                f"The measurements do not tell {', '.join(found.part.open)} by themselves, and so "
                f"{rigid} counts as rigid here. What is of interest does not depend on that."
            )
        )
    return parts


def _noise(found: Calibration) -> str:
    """The noise, by chi-square."""
    fit = found.fit
    if not fit.dof:
        return (
            "No more coordinates than parameters were measured: no residuals remain to judge the "
            "noise by."
        )
    loss = " The fit has Huber's loss, by which outliers count less." if fit.robust else ""
    p = "" if fit.p_value is None else f" (p {shown_probability(fit.p_value)})"
    text = f"Chi-square is {fit.chi2:.4g} for {fit.dof} degrees of freedom{p}"
    if fit.known:
        return f"{text}: the residuals are {fit.scale:.3g} times the stated noise.{loss}"
    return f"{text}. The noise was estimated: it is {fit.scale:.3g} times the stated.{loss}"


def _worst(found: Calibration) -> str:
    """A table of the measurements that fit least."""
    fit = found.fit
    z = np.abs(fit.standardised)
    names = coordinate_names(z.shape[1])
    turn = found.data.turn
    rows = []
    for i in np.argsort(-z.max(axis=1), kind="stable")[:SHOWN]:
        j = int(z[i].argmax())
        positions = [f"{1e3 * r:+.4f}" for r in fit.residual[i, :3]]
        rotations = [f"{np.rad2deg(r):+.4f}" for r in fit.residual[i, 3:]]
        if turn is not None:
            turned = f"{np.rad2deg(fit.residual[i, 0]):+.4f}"
            positions, rotations = ([""], [turned]) if turn[i] else (positions, [""])
        name = names[j] if turn is None or not turn[i] else "rotation"
        largest = f"{z[i, j]:.2f} ({name})"
        leverage = f"{fit.leverage[i].max():.2f}"
        flag = "yes" if i in fit.outliers else "no"
        pose = found.data.pose[i] + 1
        rows.append([i + 1, pose, *positions, *rotations, largest, leverage, flag])
    units = [f"{axis} [{'mm' if j < 3 else 'deg'}]" for j, axis in enumerate(names)]
    units += ["rotation [deg]"] * (turn is not None)
    return table(["row", "pose", *units, "largest [sigma]", "leverage", "outlier"], rows, full=True)


def _intervals(found: Calibration) -> str:
    """The picture of the compliances."""
    figure = new_figure(WIDTH, 0.8 + 0.4 * len(found.fit.k))
    model = found.study.model
    intervals(found.fit, found.parameters, model.units, figure.add_subplot())
    caption = (
        "95 % intervals of the compliances, relative to the estimate; one that reaches to zero is "
        "written out."
    )
    return picture(figure, caption)


def _residuals(found: Calibration) -> str:
    """The picture of the residuals, those of rotations below those of positions."""
    fit = found.fit
    parts = ResidualPanel.of(fit, found.data.turn)
    figure = new_figure(WIDTH, 0.8 + 2.6 * len(parts))
    axes = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    residuals(fit, axes, parts)
    caption = (
        "Measured minus predicted, by measurement; grey: twice the noise; circles: flagged as "
        "outliers."
    )
    if len(fit.residual) > len(drawn_rows(fit.residual[:, :3])):
        caption += " Of so many, some are drawn, and those that fit least."
    return picture(figure, caption)


def _quantiles(fit: Identification) -> str:
    """The quantile plot."""
    figure = new_figure(WIDTH, 3.4)
    quantiles(fit, figure.add_subplot())
    caption = "Standardised residuals against the normal law: on the line where they follow it."
    return picture(figure, caption)


def _correlation(found: Calibration) -> str:
    """The picture of the correlations."""
    p = len(found.fit.k)
    names = found.parameters
    more = room_for(names)
    figure = new_figure(1.15 + 0.65 * p + more, 1.0 + 0.5 * p + more)
    correlation(found.fit.correlation, names, figure.add_subplot())
    return picture(figure, "Correlation of the estimates.")


def _pairs(found: Calibration) -> str:
    """A table of the pairs of parameters that depend on each other most."""
    names = found.parameters
    above = np.stack(np.triu_indices(len(names), 1), axis=1)
    size = -np.abs(found.fit.correlation[above[:, 0], above[:, 1]])
    chosen = above[np.argsort(size, kind="stable")[:SHOWN]]
    rows = [[f"{names[i]}, {names[j]}", f"{found.fit.correlation[i, j]:+.3f}"] for i, j in chosen]
    return table(["pair", "correlation"], rows) if rows else ""
