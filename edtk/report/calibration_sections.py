"""Sections of a report of a calibration: facts, budget, noise, causes, and accuracy by task."""

from collections.abc import Mapping

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.findings.causes.family import NOISE, Cause
from edtk.findings.finding import leading_digit, row_names, shown_probability
from edtk.findings.noise import UNLIKELY_NOISE
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import LackOfFit
from edtk.measure.expected_error import ErrorBudget, TaskAccuracy
from edtk.report.draw.bars import error_budget
from edtk.report.draw.plans import task_errors
from edtk.report.figures import new_figure
from edtk.report.page import facts, paragraph, picture, section, table
from edtk.report.views.calibration import ADVICE, NOT_IN_IT
from edtk.study.study_model import describe_measured
from edtk.system.typing import Array, Indices
from edtk.version import __version__

BUDGET_SIZE = (4.4, 3.4)  # of the picture [inch]
CAPTION = (
    "Parts of the expected error. Their squares add up to that of the total, so that the largest "
    "part counts most."
)
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
TOOL_POINT = "the tool point"
MOST_ROWS = 60  # of a table that a person reads
TASK_SIZE = (6.8, 3.6)  # of the picture [inch]
Facts = list[tuple[str, str]]  # names with what there is to say of each; empty for nothing


def facts_section(found: Calibration, measured: Facts, evaluated: Facts) -> str:
    """The section that lets somebody else repeat a result.

    Args:
        found: The result.
        measured: What is in the file; texts that are empty do not count.
        evaluated: How it was evaluated, likewise.
    """
    study = found.asked
    name = f"{study.path.name}, " if study.path is not None else ""
    tables = {
        "Measurements": [
            ("File", found.path.name),
            ("SHA-256", found.origin.sha256),
            ("Last changed", found.origin.changed),
            *measured,
        ],
        "Evaluation": [
            ("Study", f"{name}SHA-256 begins with {study.digest}"),
            ("Robot", study.robot.name),
            *evaluated,
            ("Program", f"edtk {__version__}"),
        ],
    }
    parts = [facts(title, [row for row in rows if row[1]]) for title, rows in tables.items()]
    return section("What was measured, and how was it evaluated?", *parts)


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


def budget_section(
    found: Calibration,
    budget: ErrorBudget,
    noise: str,
    model: str,
    advice: Mapping[str, str] = ADVICE,
) -> str:
    """What error to expect in the task, by source.

    Args:
        found: The calibration.
        budget: The parts of the error.
        noise: What noise it is of, in words.
        model: What is known of the model, in words.
        advice: What makes each part smaller.
    """
    figure = new_figure(*BUDGET_SIZE)
    error_budget(budget, figure.add_subplot())
    assumed = {"noise": noise, "model": model, **_assumed(found, budget)}
    return section(
        "What makes up the expected error?",
        paragraph(_meaning(found, budget, advice)),
        picture(figure, CAPTION),
        _parts(budget, assumed, advice),
    )


def budget_of_springs(found: SpringCalibration, budget: ErrorBudget) -> str:
    """That of a calibration of springs by displacements."""
    return budget_section(found, budget, _noise(found), _model_of_budget(found))


def _meaning(found: Calibration, budget: ErrorBudget, advice: Mapping[str, str]) -> str:
    """The result in words."""
    tasks = found.study.tasks
    otherwise = "If nothing else was wrong, the" if found.verdict == "bad" else "The"
    subject = tasks.subject.removeprefix("the ")
    are = "are" if subject.endswith("s") else "is"
    rest = np.sqrt(max(budget.total**2 - budget.parts[budget.largest] ** 2, 0.0))
    return (
        f"{otherwise} {subject} {are} expected to be {1e3 * budget.total:.2g} mm off {tasks.place} "
        f"after compensation, and {1e3 * budget.uncompensated:.2g} mm without. All errors are root "
        f"mean squares. Without the largest part, {budget.largest.replace('_', ' ')}, "
        f"{1e3 * rest:.2g} mm would remain. To improve first: {advice[budget.largest]}."
        + (f" Not in it are {NOT_IN_IT}." if budget.absolute else "")
    )


def _parts(budget: ErrorBudget, assumed: Mapping[str, str], advice: Mapping[str, str]) -> str:
    """A table with a row for each part, the largest first."""
    order = sorted(budget.parts, key=lambda name: -budget.parts[name])
    rows = [
        [
            name.replace("_", " "),
            f"{1e3 * budget.parts[name]:.2g}",
            assumed[name],
            advice[name] if budget.parts[name] else "-",
        ]
        for name in order
    ]
    header = ["part", "error [mm]", "what it assumes", "what makes it smaller"]
    return table(header, rows, words=2)


def _assumed(found: Calibration, budget: ErrorBudget) -> dict[str, str]:
    """What each part by circumstances rests on, with the keys of the study's [uncertainty]."""
    given = found.study.specification.uncertainty
    load = f"{given.load_percent:g} % of its size (load_percent)"
    return {
        "load": f"{load} and {given.load_direction_deg:g} deg of direction (load_direction_deg)",
        "tool": f"{given.tool_mm:g} mm along each axis, marker included (tool_mm)",
        "rigid_joints": _rigid(budget),
        "known_joints": _known(budget),
        "drift": _stated(given.drift_mm, "drift_mm"),
        "repeatability": _stated(given.repeatability_mm, "repeatability_mm"),
    }


def _noise(found: SpringCalibration) -> str:
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


def _rigid(budget: ErrorBudget) -> str:
    """Joints that count as rigid, with the compliances that they may have."""
    rigid = [one.joint for one in budget.joints if one.joint.rigid]
    if not rigid:
        return "no joint counts as rigid"
    named = [f"{_micro(joint.std)} in {joint.name} ({joint.source})" for joint in rigid]
    return f"a compliance of about {', '.join(named)}"


def _known(budget: ErrorBudget) -> str:
    """Joints of known compliance, and how well it is known."""
    known = [one.joint for one in budget.joints if not one.joint.rigid]
    if not known:
        return "no joint counts as known"
    named = [
        f"{_micro(joint.compliance)} within {_micro(joint.std)} in {joint.name}" for joint in known
    ]
    return f"{', '.join(named)} (known_rad_per_Nm)"


def _micro(compliance: float) -> str:
    """A compliance as people read it."""
    return f"{1e6 * compliance:.2g} \N{MICRO SIGN}rad/(N m)"


def _stated(size_mm: float, key: str) -> str:
    """A size that is zero unless somebody states it."""
    return f"{size_mm:g} mm along each axis ({key})" if size_mm else f"none stated ({key} = 0)"


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
    return f"{factor * value:.3g}", leading_digit(factor * std) if np.isfinite(std) else "-"


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
    """Whether errors of joints or model, which visits tell, explain the residuals."""
    return found.noise is not None and found.fitted.common_noise


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


def task_table(found: TaskAccuracy) -> tuple[list[str], list[list[str]]]:
    """Header and rows, of very many poses some that are evenly spread, and the worst one.

    Lengths along the path stand there for a path, weights where they differ, displacements without
    compensation where compliances are known, and total errors where circumstances are.

    Args:
        found: The accuracy.
    """
    header = ["pose"]
    weighted = len(set(found.weight.tolist())) > 1
    if found.is_path:
        header.append("along the path [mm]")
    if weighted:
        header.append("weight")
    if found.before is not None:
        header.append("without compensation [mm]")
    by_noise = ["error [mm]", "95 % of the errors [mm]"]
    if found.total is not None:
        header.append("total error [mm]")
        by_noise = ["by noise [mm]", "95 % of those [mm]"]
    header += by_noise
    rows = []
    for i in shown_poses(found):
        row = [f"{i + 1}{' (worst)' if i == _marked(found) else ''}"]
        if found.is_path:
            row.append(f"{1e3 * found.along[i]:.0f}")
        if weighted:
            row.append(f"{found.weight[i]:g}")
        if found.before is not None:
            row.append(_millimetres(found.before[i]))
        if found.total is not None:
            row.append(_millimetres(found.total[i]))
        low, high = 1e3 * found.band[i]
        rows.append([*row, _millimetres(found.error[i]), f"{low:.2g} to {high:.2g}"])
    return header, rows


def _millimetres(length: float) -> str:
    """Three digits of a length, zeros at its end included."""
    return f"{1e3 * length:#.3g}".rstrip(".")


def shown_poses(found: TaskAccuracy) -> Indices:
    """Indices of the poses in the table, in their order."""
    count = len(found.error)
    if count <= MOST_ROWS:
        return np.arange(count)
    spread = np.linspace(0, count - 1, MOST_ROWS - 1).astype(int)
    return np.union1d(spread, _marked(found))


def _marked(found: TaskAccuracy) -> int:
    """The worst pose, by the total error where that is known."""
    return found.worst_of(found.error if found.total is None else found.total)


def task_sentence(found: TaskAccuracy, of: str = TOOL_POINT) -> str:
    """The mean and the worst, and how many poses the table shows.

    Args:
        found: The accuracy.
        of: Whose errors they are.
    """
    shown = len(shown_poses(found))
    count = len(found.error)
    some = "" if shown == count else f" The table shows {shown} of the {count} poses."
    weighted = ", weighted" if len(set(found.weight.tolist())) > 1 else ""
    noise = found.error
    over = f"over the {count} poses (root mean square{weighted})"
    if found.total is None:
        return (
            f"The error of {of} after compensation is "
            f"{_mean_and_worst(found, noise, over)}. It comes from the noise of the measurements "
            f"alone.{some}"
        )
    return (
        f"The total error of {of} after compensation is "
        f"{_mean_and_worst(found, found.total, over)}. The noise of the measurements alone makes "
        f"{_mean_and_worst(found, noise, 'of it')}.{some}"
    )


def _mean_and_worst(found: TaskAccuracy, errors: Array, over: str) -> str:
    """The mean of some errors (t,), and the worst with its pose."""
    worst = found.worst_of(errors)
    return (
        f"{1e3 * found.mean_of(errors):.3g} mm {over}, and {1e3 * errors[worst]:.3g} mm in the "
        f"worst of them, pose {worst + 1}"
    )


def task_section(found: TaskAccuracy) -> str:
    """What error to expect where along the path, or in which test pose."""
    figure = new_figure(*TASK_SIZE)
    label = "root mean square error" if found.total is None else "by noise alone"
    task_errors(found, label, {}, figure.add_subplot())
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    place = "along the path" if found.is_path else "in each test pose"
    caption = (
        f"Error to expect {place} after compensation, and the range in which 95 % of the errors "
        "by noise lie."
    )
    return section(
        f"What error to expect {place}?",
        paragraph(task_sentence(found)),
        picture(figure, caption),
        table(*task_table(found), full=True),
    )
