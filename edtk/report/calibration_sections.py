"""Sections of a report of any calibration: facts, budget, accuracy by task, models of a sheet."""

from collections.abc import Mapping

import numpy as np

from edtk.calibration.calibration import Calibration, Extension
from edtk.measure.expected_error import ErrorBudget, TaskAccuracy
from edtk.report.draw.bars import error_budget
from edtk.report.draw.plans import task_errors
from edtk.report.figures import new_figure
from edtk.report.page import facts, paragraph, picture, section, sentence, table, verdict
from edtk.report.views.calibration import ADVICE, NOT_IN_IT, models_sentences, models_table
from edtk.system.typing import Array, Indices
from edtk.version import __version__

BUDGET_SIZE = (4.4, 3.4)  # of the picture [inch]
CAPTION = (
    "Parts of the expected error. Their squares add up to that of the total, so that the largest "
    "part counts most."
)
TOOL_POINT = "the tool point"
ROWS_SHOWN = 8  # of a table of what fits least
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


def verdict_box(found: Calibration, promise: list[str], said: list[str]) -> str:
    """The box at the top of a report, the most important line first.

    Args:
        found: The calibration.
        promise: What it is worth.
        said: What was found, a sentence each.
    """
    warnings = [sentence(f"the study: {warning}") for warning in found.study.warnings]
    return verdict(found.verdict, [*promise, *said, *warnings])


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
