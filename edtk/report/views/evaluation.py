"""The worth of plans under all criteria, and what the linear model costs."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

import criteria
from edtk.calibration.planned import PlanBias
from edtk.report.draw.names import name_ticks
from edtk.report.figures import BLUE, panels
from edtk.report.shown import shown_value
from edtk.report.tables import name_width, notebook_table
from edtk.report.views.calibration import budget_lines
from edtk.study.evaluate import Evaluation


def criteria_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion.

    Args:
        rows: The answers of `Criterion.describe()`.
    """
    described = list(rows)
    first = name_width((row["name"] for row in described), 6)
    title = name_width((row["title"] for row in described), 32)
    lines = [f"{'name':{first}}{'sense':6}{'convex':8}{'title':{title}}formula"]
    for row in described:
        convex = "yes" if row["convex"] else "no"
        name = f"{row['name']:{first}}{row['sense']:6}{convex:8}"
        lines.append(f"{name}{row['title']:{title}}{row['formula']}")
    return "\n".join(lines)


def families_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion that needs parameters, with their names.

    Args:
        rows: The answers of `Criterion.describe()`, with the names as `parameters`.
    """
    described = [{**row, "parameters": ", ".join(row["parameters"])} for row in rows]
    first = name_width((row["name"] for row in described), 6)
    title = name_width((row["title"] for row in described), 32)
    formula = name_width((row["formula"] for row in described), 24)
    lines = [f"{'name':{first}}{'sense':6}{'title':{title}}{'formula':{formula}}parameters"]
    for row in described:
        name = f"{row['name']:{first}}{row['sense']:6}{row['title']:{title}}"
        lines.append(f"{name}{row['formula']:{formula}}{row['parameters']}")
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


def criteria_lines(found: Evaluation) -> list[str]:
    """A line for each criterion."""
    labels = [found.labels.get(name, name) for name in found.criteria]
    width = name_width([*labels, ""], 6)
    lines = []
    for label, (name, value) in zip(labels, found.criteria.items(), strict=True):
        criterion = criteria.get(name)
        factor, unit = criterion.shown
        shown = f"{factor * value:.6g} {unit}"
        lines.append(f"  {label:{width}}{criterion.sense:5}{shown:18}{criterion.formula}")
    return lines


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
    values = [
        [
            found.labels.get(name, name),
            shown_value(name, value, 6),
            criteria.get(name).sense,
            criteria.get(name).formula,
        ]
        for name, value in found.criteria.items()
    ]
    deviations = [
        [name, f"{std:.4g}", unit]
        for name, std, unit in zip(found.names, found.std, found.units, strict=True)
    ]
    notes = [] if found.expected is None else [str(found.expected)]
    notes += budget_lines(found.error_budget)
    header = ["criterion", "value", "sense", "formula"]
    first = notebook_table(found.headline(), header, values, notes)
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
    b = found.bias
    width = name_width(found.parameters, 7)
    lines = [
        f"{found.experiments} experiments on the loaded equilibrium, identified with the linear "
        "model",
        f"{'param':{width}}{'true':>11} {'bias':>11} {'std':>10} {'bias/std':>10} {'bias %':>9}",
    ]
    rows = zip(found.parameters, b.true, b.bias, b.std, b.in_std, b.percent, strict=True)
    for name, true, bias, std, in_std, percent in rows:
        lines.append(
            f"{name:{width}}{true:11.4g} {bias:+11.3g} {std:10.4g} {in_std:+10.4g} {percent:+9.4g}"
        )
    lines.append(f"compliances in {found.unit}")
    if found.rho0 is not None and found.rho0_bias is not None:
        both = float(np.hypot(found.rho0, found.rho0_bias))
        place = f"{found.poses} test poses" if found.poses > 1 else "test pose"
        lines.append(
            f"{place}: noise leaves rho0 = {1e3 * found.rho0:.4g} mm, the bias "
            f"{1e3 * found.rho0_bias:.4g} mm, both {1e3 * both:.4g} mm (root mean square)"
        )
    return "\n".join(lines)


def plan_bias_notebook(found: PlanBias) -> str:
    """A row for each compliance."""
    rows = [
        [name, f"{true:.4g}", f"{bias:+.3g}", f"{std:.3g}", f"{in_std:+.3g}"]
        for name, true, bias, std, in_std in zip(
            found.parameters,
            found.bias.true,
            found.bias.bias,
            found.bias.std,
            found.bias.in_std,
            strict=True,
        )
    ]
    header = ["parameter", f"true [{found.unit}]", "bias", "std", "bias/std"]
    return notebook_table(found.headline(), header, rows)


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
