"""The worth of plans under all criteria, and what the linear model costs."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from criteria.criterion import printed
from edtk.calibration.planned import PlanBias
from edtk.design.exact.day import PosesByLoad
from edtk.report.draw.bars import name_ticks
from edtk.report.figures import BLUE, panels
from edtk.report.shown import expected_rho0
from edtk.report.tables import left_table, name_width, notebook_table, text_table
from edtk.report.views.calibration import budget_lines
from edtk.study.evaluate import Evaluation
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.calibration.evaluate_geometry import GeometryEvaluation
    from edtk.calibration.geometry_plan import GeometryPlan
    from edtk.calibration.geometry_question import GeometryQuestion


def criteria_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion.

    Args:
        rows: The answers of `Criterion.describe()`.
    """
    keys = ["name", "sense", "convex", "title", "formula"]
    shown = ({**row, "convex": "yes" if row["convex"] else "no"} for row in rows)
    return "\n".join(left_table(keys, ([row[key] for key in keys] for row in shown)))


def families_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion that needs parameters, with their names.

    Args:
        rows: The answers of `Criterion.describe()`, with the names as `parameters`.
    """
    keys = ["name", "sense", "title", "formula"]
    cells = ([*(row[key] for key in keys), ", ".join(row["parameters"])] for row in rows)
    lines = left_table([*keys, "parameters"], cells)
    return "\n".join(["With parameters, see `criterion` of a study:", *lines])


def evaluation_text(found: Evaluation) -> str:
    """A line for each criterion, and one for each standard deviation."""
    beside = " beside what the prior tells" if found.with_prior else ""
    expected = [] if found.expected is None else [str(found.expected)]
    expected += budget_lines(found.error_budget)
    head = f"{found.experiments} experiments{beside}"
    lines = [head, *criteria_lines(found), *expected, *deviation_lines(found)]
    if found.interest:
        lines.append("standard deviations of what is of interest")
        width = name_width(found.interest, 6)
        unit = found.units[-1]
        lines += [f"  {name:{width}}{std:.4g} {unit}" for name, std in found.interest.items()]
    return "\n".join(lines)


def geometry_evaluation_text(found: "GeometryEvaluation") -> str:
    """What is told, a line for each criterion, and one for each standard deviation."""
    question = found.question
    lines = [
        f"{found.experiments} visits of {len(found.poses.q)} poses"
        + (", beside what is known before" if found.with_prior else ""),
        *visits_by_load(found.poses),
        f"{found.rank} parameters can be told apart"
        + (f" of {question.model.p} that better poses would tell" if found.open else ""),
        *(f"open: {words}" for words in found.open),
        *(f"not told by feasible poses: {words}" for words in question.untold),
        *rho0_of_visits(found),
        *about(question),
    ]
    deviations = deviation_lines(found, (one.words for one in found.parameters))
    return "\n".join([*lines, *criteria_lines(found), *deviations])


def rho0_of_visits(found: "GeometryEvaluation | GeometryPlan") -> list[str]:
    """The error in the test poses, if nothing open moves it; it may be a criterion's value, too."""
    tasks = found.question.study.tasks
    if found.rho0 is None:
        return [f"no rho0: what is open moves {tasks.subject} {tasks.place}"] if tasks else []
    return [
        expected_rho0(1e3 * found.rho0, tasks),
        *([] if found.expected is None else [str(found.expected)]),
        *budget_lines(found.error_budget, of_visits=True),
        *(f"in the tasks taken as drawn: {words}" for words in found.question.as_drawn),
    ]


def about(question: "GeometryQuestion") -> list[str]:
    """What the criteria are about, where that is not all that is unknown."""
    table = question.study.specification.interest
    if table is None:
        return []
    names = " and ".join(table.parameters)
    return [f"criteria but rho0 and rho_max are about {names}; the rest is unknown too"]


def visits_by_load(poses: PosesByLoad) -> list[str]:
    """What loads the visits of each column; nothing where none is loaded."""
    if len(poses.wrenches) == 1:
        return []
    lines = []
    for i, (W, visits) in enumerate(zip(poses.wrenches, poses.visits.T, strict=True)):
        what = "without a load" if not W.any() else f"under {load_name(poses, i)}, {_wrench(W)}"
        count = visits.sum()
        lines.append(f"{count} visit{'' if count == 1 else 's'} {what}")
    both = int(((poses.visits > 0).sum(axis=1) > 1).sum())
    if both:
        lines.append(f"{both} of the poses are visited under more than one of them")
    return lines


def load_name(poses: PosesByLoad, load: int) -> str:
    """What a load is called in the table."""
    return "load" if len(poses.wrenches) == 2 else f"load {load}"


def _wrench(W: Array) -> str:
    """A wrench (6,) in words."""
    parts = [
        f"{letter} = ({', '.join(f'{x:g}' for x in part)}) {unit}"
        for letter, part, unit in (("F", W[:3], "N"), ("T", W[3:6], "N m"))
        if part.any()
    ]
    where = f" at ({', '.join(f'{x:g}' for x in 1e3 * W[6:])}) mm" if len(W) > 6 else ""
    return ", ".join(parts) + where


def criteria_lines(found: Evaluation) -> list[str]:
    """A header, and a line for each criterion."""
    return [f"  {line}" for line in left_table(*_criteria_rows(found))]


def _criteria_rows(found: Evaluation) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the criteria."""
    rows = [
        [
            found.labels.get(name, name),
            criteria.get(name).sense,
            _with_unit(found, name, value),
            criteria.get(name).formula,
        ]
        for name, value in found.criteria.items()
    ]
    return ["criterion", "sense", "value", "formula"], rows


def _with_unit(found: Evaluation, name: str, value: float) -> str:
    """A value in the unit of its criterion, or in that of the parameters."""
    return printed(criteria.get(name), value, found.units)


def deviation_lines(found: Evaluation, words: Iterable[str] | None = None) -> list[str]:
    """A header, and a line for each standard deviation.

    Args:
        found: The evaluation.
        words: What stands behind each; nothing by default.
    """
    width = name_width([*found.names, ""], 6)
    behind = [""] * len(found.names) if words is None else [f"  {one}" for one in words]
    rows = zip(found.names, found.std, found.units, behind, strict=True)
    lines = [f"  {name:{width}}{std:.4g} {unit}{more}" for name, std, unit, more in rows]
    return ["standard deviations", *lines]


def evaluation_notebook(found: Evaluation) -> str:
    """A row for each criterion, then a row for each standard deviation."""
    deviations = [
        [name, f"{std:.4g}", unit]
        for name, std, unit in zip(found.names, found.std, found.units, strict=True)
    ]
    notes = [] if found.expected is None else [str(found.expected)]
    notes += budget_lines(found.error_budget)
    first = notebook_table(found.headline(), *_criteria_rows(found), notes)
    second = notebook_table("standard deviations", ["parameter", "std", "unit"], deviations)
    return f"{first}\n{second}"


def evaluation_plot(found: Evaluation, ax: Any = None) -> Any:
    """Draw the standard deviations of the parameters as bars.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.4, 3.6))[0, 0]
    units = dict.fromkeys(found.units)
    names = found.names
    if len(units) > 1:
        names = tuple(f"{name}\n[{unit}]" for name, unit in zip(names, found.units, strict=True))
    ax.bar(range(len(names)), found.std, color=BLUE)
    name_ticks(ax, names)
    ax.set_xlabel("parameter")
    ax.set_ylabel(f"standard deviation [{' or '.join(units)}]")
    ax.set_title(f"Standard deviations after {found.experiments} experiments", fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    return ax


def plan_bias_text(found: PlanBias) -> str:
    """A line for each parameter, and the error in the test pose."""
    lines = [
        f"{found.experiments} experiments on the loaded equilibrium, identified with the linear "
        "model",
        text_table(*plan_bias_rows(found)),
        *plan_bias_notes(found),
    ]
    if found.rho0 is not None and found.rho0_bias is not None:
        both = float(np.hypot(found.rho0, found.rho0_bias))
        place = f"{found.poses} test poses" if found.poses > 1 else "test pose"
        lines.append(
            f"{place}: noise leaves rho0 = {1e3 * found.rho0:.4g} mm, the bias "
            f"{1e3 * found.rho0_bias:.4g} mm, both {1e3 * both:.4g} mm (root mean square)"
        )
    return "\n".join(lines)


def plan_bias_rows(found: PlanBias) -> tuple[list[str], list[list[str]]]:
    """Header and a row for each compliance."""
    b = found.bias
    rows = [
        [name, f"{true:.4g}", f"{bias:+.3g}", f"{std:.4g}", f"{in_std:+.3g}", f"{percent:+.3g}"]
        for name, true, bias, std, in_std, percent in zip(
            found.parameters, b.true, b.bias, b.std, b.in_std, b.percent, strict=True
        )
    ]
    return ["parameter", "true", "bias", "std", "bias/std", "bias [%]"], rows


def plan_bias_notes(found: PlanBias) -> list[str]:
    """The unit."""
    return [f"true, bias and std in {found.unit}"]


def plan_bias_plot(found: PlanBias, ax: Any = None) -> Any:
    """Draw the bias of each compliance in standard deviations; the grey band is one of them.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.4, 3.6))[0, 0]
    p = len(found.parameters)
    ax.axhspan(-1, 1, color="grey", alpha=0.15, linewidth=0)
    ax.axhline(0, color="black", linewidth=0.8)
    ax.bar(range(p), found.bias.in_std, color=BLUE)
    name_ticks(ax, found.parameters)
    ax.set_xlabel("parameter")
    ax.set_ylabel("bias [standard deviations]")
    ax.set_title(f"Bias of the linear model, {found.experiments} experiments", fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    return ax
