"""The report of a calibration of springs: verdict first, then tables and pictures."""

import numpy as np

from criteria.linalg.inverse import TINY
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.findings.causes.family import NOISE, Cause
from edtk.findings.causes.wrong_pose import FITS
from edtk.findings.finding import Finding, leading_digit, row_names, shown_probability
from edtk.findings.noise import UNLIKELY_NOISE
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.identify import Identification
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import LackOfFit
from edtk.measure.pose_table import coordinate_names
from edtk.report.calibration_sections import (
    ROWS_SHOWN,
    Facts,
    budget_section,
    task_section,
    verdict_box,
)
from edtk.report.draw.bars import correlation, intervals, room_for
from edtk.report.draw.residuals import ResidualPanel, drawn_rows, quantiles, residuals
from edtk.report.figures import new_figure
from edtk.report.page import (
    PICTURE_WIDTH,
    QUALITY,
    paragraph,
    picture,
    section,
    sentence,
    table,
)
from edtk.report.shown import digits, left_out_sentence
from edtk.report.views.calibration import (
    of_the_total,
    total_expected,
)
from edtk.study.study_model import describe_measured
from edtk.system.typing import Array

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
NOISES = ("part of the noise", "estimate", "std", "unit", "root mean square of a coordinate [mm]")
EITHER = (
    "These measurements cannot tell which of the causes it is, as both make nearly the same "
    "residuals in these poses. Other poses can: edtk plan --detect names one."
)
CAUSES_HEADER = (
    "what explains the residuals",
    "size",
    "std",
    "unit",
    "joint",
    "rows",
    "share of the misfit [%]",
    "p",
)


def spring_sections(found: SpringCalibration) -> list[str]:
    """What a report says of compliances, the verdict first."""
    return [
        spring_verdict(found),
        *_budget(found),
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


def spring_verdict(found: SpringCalibration) -> str:
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
    return verdict_box(found, lines, [_sentence(found, one) for one in others])


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


def measured_facts(found: SpringCalibration) -> Facts:
    """The noise, the load and the tool."""
    data = found.data
    poses = int(data.pose.max()) + 1
    coordinates = data.deflection.shape[1]
    tool = found.study.specification.tool
    place = found.study.robot.tool_is_from
    payload = found.study.specification.payload
    turned = f", turned by {_vector(tool.rpy_deg)} deg (rpy)" if any(tool.rpy_deg) else ""
    return [
        ("Rows", _rows(len(data), poses, coordinates)),
        ("Stated noise", _stated_noise(data)),
        ("Estimated noise", _estimated_noise(found)),
        ("Load", _load(data.wrench)),
        ("Tool", f"{_vector(tool.position_mm)} mm from the {place}{turned}"),
        ("Marker", _marker(found)),
        ("Payload", "" if payload is None else payload.describe()),
        ("Displacements", "from the nominal robot" if found.study.is_absolute else ""),
    ]


def evaluated_facts(found: SpringCalibration) -> Facts:
    """The options."""
    plan = found.fitted.plan
    known = found.study.specification.joints.known_in_words("\N{PLUS-MINUS SIGN}")
    return [
        ("Model", _model(found)),
        ("Fit", _fit(found)),
        ("Noise", "as stated" if found.fit.known else "estimated (sigma unknown)"),
        ("Repetitions", "noise that they share is estimated" if found.fitted.common_noise else ""),
        ("Plan", "none given" if plan is None else f"{plan.experiments} experiments, compared"),
        ("Sheet", "taken as it is, even if columns look misread" if found.fitted.how.as_is else ""),
        ("Known", known),
        ("Posterior", "sampled" if found.check is not None else "not sampled"),
    ]


def _model(found: SpringCalibration) -> str:
    """The model that was fitted, and why."""
    tenth = "moves a compliance by more than a tenth of its standard deviation"
    if found.fitted.nonlinear:
        return f"the loaded equilibrium, as it {tenth}"
    if found.fitted.how.linear:
        return "linear, as asked for"
    return f"linear; the loaded equilibrium is fitted where it {tenth}"


def _fit(found: SpringCalibration) -> str:
    """The loss."""
    if found.fit.robust:
        return "robust: Huber's loss, by which outliers count less"
    if found.fit.too_few_for_robust:
        return "least squares, as there are too few coordinates for the robust fit asked for"
    return "weighted least squares"


def _stated_noise(data: Measurements) -> str:
    """The stated sigma of positions and of rotations, and whether errors are correlated."""
    sigma = data.sigma
    turns = np.rad2deg(sigma[~data.lengths])
    parts = []
    if data.lengths.any():
        parts.append(f"{_range(1e3 * sigma[data.lengths])} mm for each coordinate")
    if len(turns):
        parts.append(f"{_range(turns)} deg for each rotation")
    text = ", ".join(parts)
    if data.tracker is not None:
        text = f"{text}, correlated within a visit as the study's [noise] states"
    elif data.covariance is not None:
        text = f"{text}, correlated within a row as the sheet states"
    return text


def _estimated_noise(found: SpringCalibration) -> str:
    """The sigma by the residuals."""
    if not np.isfinite(found.sigma_hat):
        return "unknown: as many coordinates as parameters were measured"
    times = f"{found.fit.scale:.3g} times the stated"
    return f"{1e3 * found.sigma_hat:.3g} mm, {times}, from {found.fit.dof} degrees of freedom"


def _rows(count: int, poses: int, coordinates: int) -> str:
    """How much was measured."""
    several = f"{count} measurement{'s' * (count > 1)} in {poses} pose{'s' * (poses > 1)}"
    return f"{several}, {coordinates} coordinate{'s' * (coordinates > 1)} each"


def _load(wrench: Array) -> str:
    """The load, where it is one, or the sizes of several."""
    # Sorting a million equal loads takes seconds.
    different = wrench[:1] if (wrench == wrench[0]).all() else np.unique(wrench, axis=0)
    if len(different) == 1:
        force = f"F = {_vector(different[0, :3])} N"
        return f"{force}, T = {_vector(different[0, 3:])} N m" if different[0, 3:].any() else force
    forces = np.linalg.norm(different[:, :3], axis=1)
    return f"{len(different)} different ones, with forces of {_range(forces)} N"


def _marker(found: SpringCalibration) -> str:
    """The instruments of the study, or how far markers are from the tool point; empty for none."""
    model = found.study.model
    if model.sensors:
        names = ", ".join(sensor.name for sensor in model.whole_instruments)
        return f"{describe_measured(found.study)}: {names}"
    marker = found.data.marker
    if not marker.any():
        return ""
    lengths = 1e3 * np.linalg.norm(np.unique(marker, axis=0), axis=1)
    return f"{len(lengths)} in the tool frame, {_range(lengths)} mm from the tool point"


def _range(values: Array) -> str:
    """One number, or the least and the largest."""
    low = f"{values.min():.4g}"
    high = f"{values.max():.4g}"
    return low if low == high else f"{low} to {high}"


def _vector(values: Array | tuple[float, ...]) -> str:
    """A vector as a person writes it."""
    return f"({', '.join(f'{value:g}' for value in values)})"


def _budget(found: SpringCalibration) -> list[str]:
    """What makes up the error in the test poses; nothing without any."""
    if found.budget is None:
        return []
    return [budget_section(found, found.budget, _noise_of_budget(found), _model_of_budget(found))]


def _noise_of_budget(found: SpringCalibration) -> str:
    """The noise that the standard deviations are of."""
    stated = 1e3 * float(np.sqrt(np.mean(found.data.sigma[found.data.lengths] ** 2)))
    shared = ", and what repetitions share" if found.fitted.common_noise else ""
    if found.fit.known:
        return f"{stated:.3g} mm for each coordinate, as stated{shared}"
    return f"{1e3 * found.sigma_hat:.3g} mm for each coordinate, as estimated{shared}"


def _model_of_budget(found: SpringCalibration) -> str:
    """The model, and how far it is trusted."""
    error = found.fitted.model_error
    if error is not None:
        across, held, turn = error.to_dict().values()
        if not across + held + turn:
            return "the sheet shows no springs across the joints, friction or stiffness by pose"
        return (
            f"of what the springs do, the sheet shows {across:.2g} % across the joints, {held:.2g} "
            f"% held by friction and {turn:.2g} % by pose that the model lacks"
        )
    if found.fitted.nonlinear:
        return "the loaded equilibrium was fitted: nothing is left"
    if found.rho0_bias is None:
        return "what the linear model leaves is not known"
    return "what the linear model leaves, to the first order"


def noise_parts(found: SpringCalibration) -> list[str]:
    """A sentence on what moves together and a table of three errors; nothing if none is told."""
    noise = found.noise
    if noise is None:
        return []
    return [paragraph(_together(noise)), table(list(NOISES), _noise_rows(found, noise), full=True)]


def _together(noise: NoiseEstimate) -> str:
    """Whether markers of a visit move together."""
    strata = noise.strata
    moved = strata.visits if noise.revisited else strata.poses
    numbers = (
        f"F = {noise.F:.3g} for {moved.dof} degrees of freedom, p {shown_probability(noise.p)}"
    )
    if noise.moves:
        return f"Measurements of a visit are off together, as if joints had moved ({numbers})."
    return f"Measurements of a visit are not off together by more than chance ({numbers})."


def _noise_rows(found: SpringCalibration, noise: NoiseEstimate) -> list[list[str]]:
    """Tracker, repeatability, and what remains."""
    sigma = 1e3 * float(np.sqrt(np.mean(found.data.own_sigma[found.data.lengths] ** 2)))
    unit = "deg" if any(one.kind == "revolute" for one in found.study.robot.joints) else "mm"
    sizes = (noise.tracker, noise.by_joints, noise.by_model)
    coordinate = [f"{sigma * size:.2g}" for size in sizes]
    cells = [
        ["tracker, as a share of the stated", *_number(noise, 0, noise.tracker, 1.0), "1"],
        ["repeatability of each joint", *_number(noise, 1, noise.joints, 1.0), unit],
        ["discrepancy of the model", *_number(noise, 2, noise.discrepancy, 1e3), "mm"],
    ]
    told = zip(cells, coordinate, noise.told, strict=True)
    return [[*row, size if known else "-"] for row, size, known in told]


def _number(noise: NoiseEstimate, i: int, value: float, factor: float) -> tuple[str, str]:
    """An estimate and its standard deviation; dashes where nothing tells them."""
    if not noise.told[i]:
        return "not told apart", "-"
    std = noise.std[i]
    shown = np.format_float_positional(factor * value, 3, False, False, trim="-")
    return shown, leading_digit(factor * std) if np.isfinite(std) else "-"


def residual_causes(found: SpringCalibration) -> list[str]:
    """Sentences on lack of fit and causes, and a table of the causes, as pieces of HTML."""
    test = found.lack_of_fit
    parts = [] if test is None else [paragraph(_repetitions(found, test))]
    if found.fit.robust:
        parts.append(paragraph("Causes are not looked for, as the fit is robust."))
    elif found.causes:
        rows = [_row(cause) for cause in found.causes]
        for row in rows[1:]:
            row[0] = f"or {row[0]}"
        parts.append(table(CAUSES_HEADER, rows, full=True))
        if len(rows) > 1:
            parts.append(paragraph(EITHER))
    elif found.fit.p_value is not None and found.fit.p_value < UNLIKELY_NOISE and not _told(found):
        text = "None of the faults that are known explains the residuals: load, tool, measuring "
        more = (
            "frame, drift, units, columns, a wrong pose, the zero of one joint, links of another "
            "length, friction, backlash or stiffness by sign of torque."
        )
        parts.append(paragraph(text + more))
    return parts


def _told(found: SpringCalibration) -> bool:
    """Whether errors of joints or model, which visits tell, or outliers explain the residuals."""
    set_aside = (one.data["p_rest"] for one in found.findings if one.kind == "outliers")
    others_fit = any(p is not None and p > FITS for p in set_aside)
    return others_fit or (found.noise is not None and found.fitted.common_noise)


def _repetitions(found: SpringCalibration, test: LackOfFit) -> str:
    """Whether repetitions agree among themselves better than with the model."""
    numbers = f"F = {test.F:.3g} for {test.dof[0]} and {test.dof[1]} degrees of freedom"
    numbers = f"{numbers}, p {shown_probability(test.p)}"
    who = "Repetitions of a pose"
    if found.noise is not None:
        who = "Visits of a pose" if found.noise.revisited else "Markers of a visit"
    if not test.seen:
        return f"{who} agree with the model as well as with each other ({numbers})."
    if found.noise is not None:
        return f"{who} agree with each other better than with the model ({numbers})."
    sigma = 1e3 * float(found.data.sigma[found.data.lengths].mean())
    used = ", which all standard deviations take into account" if found.fitted.common_noise else ""
    return (
        f"{who} agree with each other better than with the model ({numbers}): they "
        f"scatter by {test.pure_error * sigma:.2g} mm, and share {test.common * sigma:.2g} mm "
        f"that the model does not explain{used}."
    )


def _row(cause: Cause) -> list[str]:
    """One cause in cells."""
    return [
        "noise of another size" if cause.cause == NOISE else cause.cause.replace("_", " "),
        f"{cause.size:.3g}",
        "-" if cause.std is None else leading_digit(cause.std),
        cause.unit or "-",
        cause.joint or "-",
        row_names(cause.rows).partition(" ")[2] if cause.rows else "all",
        f"{100 * cause.explained:.3g}",
        shown_probability(cause.p, 1).removeprefix("= "),
    ]
