"""The report of a calibration: verdict first, then tables and pictures, in one HTML file."""

from pathlib import Path

import numpy as np

from criteria.linalg.inverse import TINY
from edtk.calibration.calibration import Calibration, Extension
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.findings.finding import Finding, shown_probability
from edtk.fit.identify import Identification
from edtk.measure.cells import csv_text
from edtk.measure.pose_table import coordinate_names
from edtk.report.calibration_sections import (
    budget_of_springs,
    evaluated_facts,
    facts_section,
    measured_facts,
    noise_parts,
    residual_causes,
    task_section,
)
from edtk.report.draw.bars import correlation, intervals
from edtk.report.draw.names import room_for
from edtk.report.draw.residuals import ResidualPanel, drawn_rows, quantiles, residuals
from edtk.report.figures import new_figure
from edtk.report.geometry_report import (
    ROWS_SHOWN,
    evaluated_geometry,
    geometry_sections,
    measured_positions,
)
from edtk.report.page import (
    PICTURE_WIDTH,
    QUALITY,
    Page,
    paragraph,
    picture,
    section,
    sentence,
    table,
    verdict,
)
from edtk.report.posterior_report import posterior_report
from edtk.report.show.page import page_html
from edtk.report.show.plate import PAGE, poses_section
from edtk.report.show.stage import stage_of_calibration
from edtk.report.shown import digits, left_out_sentence
from edtk.report.views.calibration import (
    EXTENDED,
    models_sentences,
    models_table,
    of_the_total,
    total_expected,
)
from edtk.study.study import Study
from edtk.study.study_toml import toml_in
from edtk.system.files import Content
from edtk.system.parsing import json_text

WORD = "Calibration"
# Words for the parts of an error budget.
PARTS = {
    "noise": "the noise of the measurements",
    "model": "what the model leaves out",
    "load": "an uncertain load",
    "tool": "an uncertain tool point",
    "rigid_joints": "joints that count as rigid",
    "known_joints": "joints that count as known",
    "drift": "drift between unloaded and loaded readings",
    "repeatability": "the robot's repeatability",
}
UNITLESS = ("parameter", "std [%]")  # columns that do not have the parameters' unit
NAMES = ("k.json", "residuals.csv", "report.html", PAGE)
MANY_RESIDUALS = 30_000  # residuals from which their file is to be small:
FEW_DIGITS = 6  # a residual is a difference, of which no reading has more digits
DIGITS = 10


def calibration_title(study: Study) -> str:
    """The study's title, which says that it is of a calibration."""
    title = study.specification.title
    return title if title.startswith(WORD) else f"{WORD}: {title}"


def calibration_verdict(found: SpringCalibration) -> str:
    """The box at the top of the report, the most important line first."""
    harmful = [d for d in found.findings if d.kind == "do_not_compensate"]
    others = [d for d in found.findings if d.kind != "do_not_compensate"]
    level = found.verdict
    if harmful:
        lines = [_sentence(found, harmful[0])]
    elif level == "bad":
        lines = [QUALITY[level], *_untold(found)]
    else:
        lines = [f"{QUALITY[level]} {_expected(found)}".strip(), *_parts(found), *_facts(found)]
    lines += [_sentence(found, one) for one in others]
    lines += [sentence(f"the study: {warning}") for warning in found.study.warnings]
    return verdict(level, lines)


def _sentence(found: SpringCalibration, one: Finding) -> str:
    """The words of a finding as a sentence, which may begin with the name of a parameter."""
    return sentence(one.words.replace("+-", "\N{PLUS-MINUS SIGN}"), found.parameters)


def _expected(found: SpringCalibration) -> str:
    """The accuracy to expect, in one sentence."""
    fit = found.fit
    if found.budget is None:
        k = np.maximum(np.abs(fit.k), TINY)
        worst = int(np.argmax(fit.std / k))
        share = f"{100 * fit.std[worst] / k[worst]:.2g} %"
        return f"The least certain compliance is {found.parameters[worst]}, to {share}."
    return total_expected(found.budget, found.study.tasks)


def _parts(found: SpringCalibration) -> list[str]:
    """The largest part of the error, what is assumed, and what the noise makes of it."""
    budget = found.budget
    if budget is None or found.expected is None or found.study.target is None:
        return []
    largest = budget.largest
    low, high = found.fitted.noise_fit.accuracy(found.study.target)[1]
    interval = "" if low == high else f" (95 %: {1e3 * low:.2g} to {1e3 * high:.2g} mm)"
    noise = f"{1e3 * budget.noise:.2g} mm{interval}"
    poses = "pose" if found.expected.poses == 1 else "poses"
    around = (
        f"within {np.rad2deg(found.expected.within):.3g} deg of the test {poses} it makes "
        f"{1e3 * found.expected.mean:.2g} mm on average, and {1e3 * found.expected.largest:.2g} mm "
        "at most"
    )
    first = f"The largest part is {PARTS[largest]}, with {1e3 * budget.parts[largest]:.2g} mm"
    if largest == "noise":
        return [
            f"The largest part is {PARTS[largest]}, with {noise}; {around}.",
            *of_the_total(budget),
        ]
    rest = f". The noise alone makes {noise}; {around}."
    return [*of_the_total(budget), f"{first}{rest}"]


def _untold(found: SpringCalibration) -> list[str]:
    """Joints that the loads turn, and that are not fitted: what does not fit may be theirs."""
    joints = () if found.budget is None else found.budget.joints
    return [
        f"Joint {one.joint.name} counts as {'rigid' if one.joint.rigid else 'known'}, and the "
        "loads turn it: if nothing else explains the misfit, list it in joints.unknown."
        for one in joints
        if one.told < one.joint.std
    ]


def _facts(found: SpringCalibration) -> list[str]:
    """What is in order; nothing where a finding says otherwise."""
    noted = {one.kind for one in found.findings}
    if noted - {"gains_little"}:
        return []
    noise = "the noise was estimated and is not larger than stated"
    if found.fit.known:
        noise = "the residuals fit the noise"
    facts = f"{noise}, there are no outliers, and all compliances are positive."
    if noted or (found.budget and found.budget.rigid_joints) or found.study.warnings:
        return [f"{facts[0].upper()}{facts[1:]}"]
    return [f"Nothing is wrong: {facts}"]


def calibration_report(found: Calibration) -> str:
    """The text of `report.html`."""
    if isinstance(found, GeometricCalibration):
        sections = geometry_sections(found)
        facts = measured_positions(found), evaluated_geometry(found)
    else:
        assert isinstance(found, SpringCalibration)
        sections = _sections(found)
        facts = measured_facts(found), evaluated_facts(found)
    parts = [
        *sections,
        poses_section(stage_of_calibration(found)),
        *extension_section(found.extension),
        *([] if found.check is None else [posterior_report(found.check)]),
        facts_section(found, *facts),
    ]
    return Page(calibration_title(found.study), tuple(parts)).html()


def _sections(found: SpringCalibration) -> list[str]:
    """What a report says of compliances, the verdict first."""
    return [
        calibration_verdict(found),
        *([] if found.budget is None else [budget_of_springs(found, found.budget)]),
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
            *_left_out(found),
            *residual_causes(found),
            *noise_parts(found),
            _residuals(found),
            _quantiles(found.fit),
            paragraph("The measurements that fit least:"),
            _worst(found),
        ),
        section("Which parameters depend on each other?", _correlation(found), _pairs(found)),
    ]


def _compliances(found: SpringCalibration) -> str:
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
        return table([*header, "unit"], rows, full=True)
    unit = f"[{units.pop()}]"
    named = [name if name in UNITLESS else f"{name} {unit}" for name in header]
    return table(named, rows, full=True)


def _interest(found: SpringCalibration) -> list[str]:
    """What is of interest, where the study says so, and what is left open."""
    rows = [
        [name, digits(value, std), f"{std:.1e}"] for name, (value, std) in found.interest.items()
    ]
    unit = f"[{found.asked.model.unit}]"
    parts = [table(["of interest", f"estimate {unit}", f"std {unit}"], rows)] if rows else []
    if found.part is not None:
        rigid = ", ".join(found.part.rigid)
        text = (
            f"The measurements do not tell {', '.join(found.part.open)} by themselves, and so "
            f"{rigid} counts as rigid here: {'; '.join(found.part.words)}."
        )
        more = " What is of interest does not depend on that."
        parts.append(paragraph(f"{text}{more if rows else ''}"))
    return parts


def _noise(found: SpringCalibration) -> str:
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


def _left_out(found: SpringCalibration) -> list[str]:
    """How well poses are predicted by the others."""
    out = found.fitted.left_out
    if out is None or not np.isfinite(out.rms):
        return []
    sentence = left_out_sentence(out.share_with_model)
    return [paragraph(f"{sentence} The error is {1e3 * out.rms:.3g} mm (root mean square).")]


def _worst(found: SpringCalibration) -> str:
    """A table of the measurements that fit least."""
    fit = found.fit
    z = np.abs(fit.standardised)
    names = coordinate_names(z.shape[1])
    turn = found.data.turn
    rows = []
    for i in np.argsort(-z.max(axis=1), kind="stable")[:ROWS_SHOWN]:
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


def _intervals(found: SpringCalibration) -> str:
    """The picture of the compliances."""
    figure = new_figure(PICTURE_WIDTH, 0.8 + 0.4 * len(found.fit.k))
    model = found.study.model
    intervals(found.fit, found.parameters, model.units, figure.add_subplot())
    caption = (
        "95 % intervals of the compliances, relative to the estimate; one that reaches to zero is "
        "written out."
    )
    return picture(figure, caption)


def _residuals(found: SpringCalibration) -> str:
    """The picture of the residuals, those of rotations below those of positions."""
    fit = found.fit
    parts = ResidualPanel.of(fit, found.data.turn)
    figure = new_figure(PICTURE_WIDTH, 0.8 + 2.6 * len(parts))
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
    figure = new_figure(PICTURE_WIDTH, 3.4)
    quantiles(fit, figure.add_subplot())
    caption = "Standardised residuals against the normal law: on the line where they follow it."
    return picture(figure, caption)


def _correlation(found: SpringCalibration) -> str:
    """The picture of the correlations."""
    p = len(found.fit.k)
    names = found.parameters
    more = room_for(names)
    figure = new_figure(1.15 + 0.65 * p + more, 1.0 + 0.5 * p + more)
    correlation(found.fit.correlation, names, figure.add_subplot())
    return picture(figure, "Correlation of the estimates.")


def _pairs(found: SpringCalibration) -> str:
    """A table of the pairs of parameters that depend on each other most."""
    names = found.parameters
    above = np.stack(np.triu_indices(len(names), 1), axis=1)
    size = -np.abs(found.fit.correlation[above[:, 0], above[:, 1]])
    chosen = above[np.argsort(size, kind="stable")[:ROWS_SHOWN]]
    rows = [[f"{names[i]}, {names[j]}", f"{found.fit.correlation[i, j]:+.3f}"] for i, j in chosen]
    return table(["pair", "correlation"], rows) if rows else ""


def extension_section(found: Extension | None) -> list[str]:
    """A section of a report; none likewise."""
    if found is None:
        return []
    weighed = f"{found.tried} models were weighed: those that count, the likeliest first."
    header, rows = models_table(found)
    lines = [paragraph(f"{line[0].upper()}{line[1:]}.") for line in models_sentences(found)]
    return [
        section("Which model does the sheet need?", paragraph(weighed), table(header, rows), *lines)
    ]


def calibration_files(found: Calibration, folder: Path) -> dict[Path, Content]:
    """The contents of `k.json`, `residuals.csv`, `report.html` and `poses.html`, by path.

    Args:
        found: The result.
        folder: Folder of the files.
    """
    residuals = found.residuals()
    contents = (
        json_text(found.to_dict()) + "\n",
        csv_text(residuals, FEW_DIGITS if len(residuals) > MANY_RESIDUALS else DIGITS),
        calibration_report(found),
        page_html(stage_of_calibration(found)),
    )
    files = {folder / name: content for name, content in zip(NAMES, contents, strict=True)}
    return files | extension_files(found, folder)


def extension_files(found: Calibration, folder: Path) -> dict[Path, Content]:
    """The study of the chosen model, which `compensate` and `predict` need; none if it is given."""
    if found.extension is None or not found.extension.chosen.pieces:
        return {}
    return {folder / EXTENDED: toml_in(found.extension.study, folder)}
