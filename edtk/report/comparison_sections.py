"""Sections of the comparison report."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.design.exact.day import PosesByLoad
from edtk.measure.expected_error import TaskAccuracy
from edtk.report.calibration_sections import TOOL_POINT, task_sentence, task_table
from edtk.report.shown import other_plans, plans_of, run_unit, shown_unit
from edtk.report.tables import markdown_table, number, percent
from edtk.report.views.calibration import assumed_besides
from edtk.report.views.evaluation import about
from edtk.report.views.study import budget_of_run
from edtk.robots.workspace import joints_on_limits, on_limits_in_words
from edtk.study.plan_study import day_costs
from edtk.study.schema import describe_noise
from edtk.study.study import Study
from edtk.study.study_model import other_springs
from edtk.study.study_run import ERRORS, StudyRun
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

WORTH = 0.01  # relative loss that fewer distinct poses are worth
PICTURE = "tasks.png"
SOLVERS = {"NEWTON": "Newton", "CLARABEL": "Clarabel"}  # as people write them


def relative_loss(name: str, best: float, values: Any) -> Any:
    """Loss of values (a number or a series) of a criterion, as a share of the best plan's cost."""
    return values / best - 1 if criteria.get(name).sense == "min" else best / values - 1


def all_values(run: StudyRun) -> str:
    """A table of plans (rows) and criteria (columns); a plan that does not exist has its reason."""
    names = list(run.study.specification.criteria)
    rows = []
    for _, row in run.table.sort_values("experiments", kind="stable").iterrows():
        cells = [number(shown_unit(name)[0] * row[name]) for name in names]
        if row["reason"]:
            cells = [row["reason"], *[""] * (len(names) - 1)]
        rows.append([row["plan"], *cells])
    header = [
        "plan",
        *(f"{each.label} ({each.sense})" for each in map(run.designs.criterion, names)),
    ]
    return markdown_table(header, rows)


def around_the_task(run: StudyRun) -> str:
    """A sentence on the best plan, and a table of ours, the published and the random plans."""
    main = run.study.main_criterion
    kinds = {
        f"optimised for {main}": plans_of(run.table, "optimised", main),
        **other_plans(run.table),
    }
    rows = [
        [row["experiments"], kind, *(number(1e6 * row[name]) for name in ERRORS)]
        for kind, plans in kinds.items()
        for _, row in plans.dropna(subset=[*ERRORS]).sort_values("experiments").iterrows()
    ]
    if not rows:
        return "No plan identifies all parameters.\n"
    header = ["experiments", "plan", "in the test pose", "root mean square around it", "largest"]
    sampled = "The neighbourhood is sampled"
    if len(run.study.tasks) > 1:
        header[2:4] = ["in the test poses", "root mean square around them"]
        sampled = "Each neighbourhood is sampled"
    size = "" if run.expected is None else f" within {np.rad2deg(run.expected.within):.3g} deg"
    text = (
        "Root mean square errors after compensation, by the noise of the measurements alone [um]. "
        f"{sampled} at 255 poses{size}, the test pose among them:"
    )
    return f"{text}\n\n{markdown_table(header, rows)}"


def by_size(run: StudyRun) -> str:
    """A table of our plan, its efficiency, the bound, and plans that were not optimised."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    others = other_plans(run.table)
    rows = []
    for _, row in plans_of(run.table, "optimised", main).sort_values("experiments").iterrows():
        bound = run.bound(row["experiments"])
        cells = [
            number(factor * row[main]),
            "-" if row["reason"] else percent(row[f"efficiency_{main}"]),
            "-" if bound is None else number(factor * bound.value),
        ]
        for plans in others.values():
            other = plans[plans["experiments"] == row["experiments"]]
            cells.append(number(factor * other[main].iloc[0]) if len(other) else "-")
        rows.append([row["experiments"], *cells])
    header = ["experiments", f"optimised for {main}", "efficiency", "bound", *others]
    text = f"{main} [{unit}], and the bound over {over(run)}:"
    return f"{text}\n\n{markdown_table(header, rows)}"


@dataclass(frozen=True, eq=False)
class Efficiencies:
    """Efficiencies of plans (k) under criteria (c), against the bounds over all poses.

    Attributes:
        size: Number of experiments of the plans.
        names: Criteria (c,).
        plans: Names of the plans (k,), in words.
        values: Efficiencies (k, c).
        reason: Why no plan exists, or "".
    """

    size: int
    names: list[str]
    plans: list[str]
    values: Array
    reason: str

    @classmethod
    def of(cls, run: StudyRun, size: int) -> "Efficiencies":
        """The efficiencies of a run's plans of one size."""
        specification = run.study.specification
        names = [name for name in specification.criteria if f"efficiency_{name}" in run.table]
        optimised = specification.optimise
        ours = {f"optimised for {n}": plans_of(run.table, "optimised", n) for n in optimised}
        plans = []
        values = []
        for label, group in (ours | other_plans(run.table)).items():
            for _, row in group[group["experiments"] == size].iterrows():
                if not row["reason"]:
                    plans.append(label)
                    values.append([float(row[f"efficiency_{name}"]) for name in names])
        reason = ""
        if not plans:
            main = plans_of(run.table, "optimised", run.study.main_criterion, size)
            reason = str(main["reason"].iloc[0])
        return cls(size, names, plans, np.array(values), reason)

    @property
    def picture(self) -> str:
        """Name of the file with the heat map."""
        return f"efficiency_m{self.size}.png"


def efficiencies(found: Efficiencies) -> str:
    """A heading, the heat map, and a table; or the reason why no plan exists."""
    heading = f"### {found.size} experiment{'s' if found.size > 1 else ''}\n"
    if not found.plans:
        return f"{heading}\nNo plan: {found.reason}.\n"
    cells = [
        [plan, *map(percent, row)] for plan, row in zip(found.plans, found.values, strict=True)
    ]
    image = f"![Efficiencies of plans of {found.size} experiments]({found.picture})"
    return f"{heading}\n{image}\n\n{markdown_table(['plan', *found.names], cells)}"


def fewer_poses(run: StudyRun) -> str:
    """A table of the loss by the number of distinct poses, and the number that suffices."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    asked = run.table[run.table["kind"] == "distinct"]
    some = asked[asked[main].notna()]
    if some.empty:
        reasons = ", or ".join(map(str, asked["reason"].unique()))
        none = f"No plan of fewer distinct poses was found: {reasons}.\n"
        return "No size allows fewer distinct poses.\n" if asked.empty else none
    numbers = sorted(some["distinct_at_most"].unique())
    rows = []
    advice = []
    for m in sorted(some["experiments"].unique()):
        values = _values(run, some[some["experiments"] == m], m)
        losses = relative_loss(main, values.iloc[-1], values)
        enough = int(losses.index[losses < WORTH][0])
        advice.append(f"{enough} for m = {m}")
        cells = [
            f"{number(factor * values[k])} ({100 * losses[k]:+.2f} %)" if k in values else ""
            for k in numbers
        ]
        rows.append([m, *cells, number(factor * values.iloc[-1]), enough])
    text = (
        f"{main} [{unit}] of m experiments in at most k distinct poses, each measured as often as "
        "is best, and the loss against any number of poses. "
        f"Enough for a loss below {100 * WORTH:.0f} %: {', '.join(advice)}.\n"
    )
    header = ["experiments", *(f"k = {k}" for k in numbers), "any", "recommended k"]
    return f"{text}\n{markdown_table(header, rows)}"


def _values(run: StudyRun, some: "pd.DataFrame", m: int) -> "pd.Series":
    """The main criterion of m experiments by the number of distinct poses, any number last.

    A plan of fewer poses is one of at most more poses, too: it counts where it is better.
    """
    import pandas as pd

    main = run.study.main_criterion
    plans = pd.concat([some, plans_of(run.table, "optimised", main, m)])
    values = plans.set_index("distinct_at_most")[main].sort_index()
    return values.cummin() if criteria.get(main).sense == "min" else values.cummax()


def in_each_task(found: TaskAccuracy, of: str = TOOL_POINT) -> str:
    """A picture, a sentence and a table of the largest plan for the main criterion.

    Args:
        found: The accuracy that this plan promises.
        of: Whose errors they are.
    """
    place = "along the path" if found.is_path else "in each test pose"
    header, rows = task_table(found)
    return (
        f"![Error to expect {place}]({PICTURE})\n\n"
        f"The largest plan. {task_sentence(found, of)}\n\n{markdown_table(header, rows)}"
    )


def loss_of_others(run: StudyRun) -> str:
    """How much worse than the plan for the main criterion the other plans are, size by size."""
    main = run.study.main_criterion
    sizes = sorted(run.study.specification.sizes)
    others = [name for name in run.study.specification.optimise if name != main]
    ours = {f"optimised for {name}": plans_of(run.table, "optimised", name) for name in others}
    classical_name = dict(zip(ours, others, strict=True))
    rows = []
    classical = []
    for label, plans in (ours | other_plans(run.table)).items():
        if not plans["experiments"].isin(sizes).any():
            continue
        losses = [_loss(run, plans, size) for size in sizes]
        name = classical_name.get(label)
        rows.append([label, *("-" if math.isnan(x) else f"{100 * x:+.1f} %" for x in losses)])
        if name:
            known = zip(losses, sizes, strict=True)
            classical += [(loss, name, size) for loss, size in known if not math.isnan(loss)]
    if not rows:
        return "There are no other plans.\n"
    text = (
        f"Cost in {main} of each plan, relative to the plan of the same size that was optimised "
        f"for {main}."
    )
    if classical:
        least, cheapest, small = min(classical)
        most, costliest, large = max(classical)
        text += (
            f" A plan that is optimised for another criterion costs between {100 * least:.0f} % "
            f"({cheapest}, {small} experiments) and {100 * most:.0f} % ({costliest}, {large} "
            "experiments)."
        )
    return f"{text}\n\n{markdown_table(['plan', *(f'm = {m}' for m in sizes)], rows)}"


def _loss(run: StudyRun, plans: "pd.DataFrame", size: int) -> float:
    """The loss of a plan in the main criterion; NaN without a plan that identifies everything."""
    main = run.study.main_criterion
    found = plans[plans["experiments"] == size]
    if found.empty:
        return math.nan
    best = plans_of(run.table, "optimised", main, size)[main].iloc[0]
    return float(relative_loss(main, best, found[main].iloc[0]))


def relaxation_table(run: StudyRun) -> str:
    """Value and both bounds of every relaxation, for one experiment's worth of weight."""
    rows = []
    for relaxed in run.relaxations.values():
        factor, unit = run_unit(run, relaxed.criterion.name)
        sharing = relaxed.space.sharing
        plural = "" if sharing == 1 else "s"
        among = f", {sharing} experiment{plural}" if sharing else ""
        values = (relaxed.value, relaxed.proved_bound.value, relaxed.best_bound.value)
        gaps = (relaxed.gap, relaxed.best_bound.gap_to(relaxed.cost))
        rows.append(
            [
                relaxed.criterion.label + among,
                *(f"{factor * value:.6g}" for value in values),
                unit,
                *(f"{gap:.1e}" for gap in gaps),
                len(relaxed.x),
                SOLVERS.get(relaxed.solver, relaxed.solver),
            ]
        )
    header = ["criterion", "value", "bound, proved", "bound, searched", "unit", "gap, proved"]
    return markdown_table([*header, "gap, searched", "poses", "solver"], rows)


def setting_of_geometry(designs: GeometryDesigns) -> str:
    """What is unknown, what a visit measures under which loads, and what bounds the plans."""
    question = designs.question
    study = designs.study
    specification = study.specification
    told = f"{question.model.p} parameters can be told apart"
    if question.model.p < question.structural.p:
        told += f" of {question.structural.p} that any poses would tell"
    markers = len(question.model.markers)
    kind = "pose" if question.model.rows == "pose" else "position"
    parts = [
        f"unknown {_unknown(study)}: {told}",
        *about(question),
        _loads(designs),
        f"measured: {kind}s of {markers} marker{'' if markers == 1 else 's'}",
        f"{describe_noise(specification)}{margin_in_words(study)}",
        *budget_of_costs(study),
    ]
    untold = "".join(f"\n- Not told by feasible poses: {words}.\n" for words in question.untold)
    return f"{'; '.join(parts)}.\n{untold}"


def margin_in_words(study: Study) -> str:
    """How far plans stay away from limits, as the end of a list; empty for no margin."""
    joints = study.specification.joints
    given = ((joints.margin_deg, "deg"), (joints.margin_mm, "mm"))
    margins = " and ".join(f"{margin:g} {unit}" for margin, unit in given if margin)
    return f"; plans stay {margins} away from the limits of the joints" if margins else ""


def _unknown(study: Study) -> str:
    """The groups of parameters."""
    asked = study.specification.parameters
    assert asked is not None
    geometry = "geometry" if asked.geometry == "all" else f"geometry ({', '.join(asked.geometry)})"
    springs = ", ".join(study.specification.joints.unknown)
    others = ", ".join(one.name.removeprefix("k_") for one in other_springs(study))
    groups = {
        geometry: bool(asked.geometry),
        "base": asked.base,
        "tool": asked.tool,
        f"compliances of {springs}": bool(springs),
        f"springs {others}": bool(others),
    }
    return ", ".join(name for name, wanted in groups.items() if wanted)


def _loads(designs: GeometryDesigns) -> str:
    """What visits may be loaded with."""
    if designs.question.chooses_forces:
        return f"visits with {designs.study.specification.describe_load()}"
    if len(designs.question.wrenches) == 1:
        return "visits without a load"
    return f"visits without a load, or with {designs.study.specification.describe_load()}"


def budget_of_costs(study: Study) -> list[str]:
    """What the budget of a day limits."""
    costs = study.specification.costs
    if costs is None or costs.budget is None:
        return []
    limit = f"{costs.budget:g} {costs.unit}".rstrip()
    return [f"optimised plans cost {limit} at most, which bounds and random plans do not heed"]


def verdict(run: StudyRun) -> str:
    """Which plan to measure, what to expect of it, and what to do with it."""
    main = run.study.main_criterion
    best = plans_of(run.table, "optimised", main).dropna(subset=[main]).sort_values("experiments")
    if best.empty:
        return "No size allows a plan that identifies all parameters.\n"
    row = best.iloc[-1]
    file = f"plans/{row['plan']}.csv"
    sentences = [*_promise(run, row, file), *_others(run, row), *_in_cell(run, row)]
    sentences += [*_seen(run, row), *_on_limits(run, row)]
    return f"""{" ".join(sentences)}
{_total(run)}
Write the sheet for the day in the lab; identify when it is filled in, or as far as it is:

    edtk template STUDY.toml {file} --out day1.csv
    edtk identify STUDY.toml day1.csv --out day1
"""


def _promise(run: StudyRun, row: "pd.Series", file: str) -> list[str]:
    """What the plan promises, and what no plan of its size can."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    size = row["experiments"]
    plural = "s" if size > 1 else ""
    value = f"{factor * row[main]:.4g}"
    reached = f"{main} = {value} {unit}".rstrip()
    if main == "rho0":
        reached = (
            f"rho0 = {value} {unit}: the error to expect {run.study.tasks.place} after "
            "compensation (root mean square, by the noise of the measurements alone)"
        )
    text = f"**Measure the {size} experiment{plural} of `{file}`.** They reach {reached}."
    efficiency = f"an efficiency of {100 * row[f'efficiency_{main}']:.1f} %"
    bound = run.bound(size)
    if bound is None and run.cut:
        return [text, "The time was too short for a bound on all plans."]
    if bound is None:
        return [text, f"They have {efficiency}."]
    limit = f"{number(factor * bound.value)} {'' if unit == 'SI' else unit}".strip()
    told = f"searched over {over(run)}, not proved"
    return [text, f"No plan of {size} is better than {limit} ({told}): this one has {efficiency}."]


def _total(run: StudyRun) -> str:
    """What the plan leaves in all, of which the noise is a part; empty if unknown."""
    budget = budget_of_run(run)
    if budget is None:
        return ""
    assumed = assumed_besides(budget, isinstance(run.designs, GeometryDesigns))
    besides = f". {assumed}" if assumed else ""
    return (
        f"\nExpect a **total error of {1e3 * budget.total:.2g} mm** {run.study.tasks.place} after "
        f"compensation, and {1e3 * budget.uncompensated:.2g} mm without. The measurements, with "
        f"their load and tool, make {1e3 * budget.measured:.2g} mm of it{besides}.\n"
    )


def _others(run: StudyRun, row: "pd.Series") -> list[str]:
    """How plans compare that were not optimised."""
    main = run.study.main_criterion
    better = "" if criteria.get(main).sense == "min" else " (larger is better)"
    found = []
    for kind, plans in other_plans(run.table).items():
        others = plans[plans["experiments"] == row["experiments"]]
        if len(others):
            ratio = float(others[main].iloc[0] / row[main])
            found.append(f"{main} of the {kind} plan is {ratio:.3f} times as large{better}.")
    return found


def over(run: StudyRun) -> str:
    """Which poses the bounds of a run are over."""
    return "all feasible poses" if run.study.cell is None else "all free poses, with the cell"


def _in_cell(run: StudyRun, row: "pd.Series") -> list[str]:
    """How free the plan is, and what the bound is without the cell."""
    found = next((case.found for case in run.cases if case.name == row["plan"]), None)
    check = None if found is None else found.in_cell
    if found is None or check is None or not check.clearance.pairs:
        return []
    first, second = check.clearance.names(check.nearest) or ("", "")
    room = 1e3 * float(check.clearance.least[check.nearest])
    beyond = found.certified
    return [
        f"In the cell {check.headline()}: {first} and {second} come nearest, in row "
        f"{check.nearest + 1}, {room:.1f} mm beyond the margin. Beside all poses, whether they are "
        f"free or not, the efficiency is {100 * beyond.efficiency:.1f} %."
    ]


def _seen(run: StudyRun, row: "pd.Series") -> list[str]:
    """How many markers are read, and what hides the others in which row."""
    found = next((case.found for case in run.cases if case.name == row["plan"]), None)
    seen = None if found is None else found.seen
    if seen is None:
        return []
    hiding = "; ".join(seen.hiding())
    rows = f" Hidden are, by row of the plan: {hiding}." if hiding else ""
    return [f"Seen: {seen.headline()}.{rows}"]


def _on_limits(run: StudyRun, row: "pd.Series") -> list[str]:
    """Which joints stand on their limits in the plan."""
    plans = [case.plan for case in run.cases if case.name == row["plan"]]
    if not plans or plans[0] is None:
        return []
    found = joints_on_limits(run.study.robot, plans[0].q, frozenset(run.study.fixed))
    words = on_limits_in_words(found)
    return [f"Joints stand {words}."] if words else []


def visits_by_load(run: StudyRun, designs: GeometryDesigns) -> str:
    """A table with a plan a row: its poses, its visits under each load, and its costs.

    It is empty where visits have no load and cost nothing that somebody told.
    """
    wrenches = designs.question.wrenches
    costs = day_costs(run.study)
    if len(wrenches) == 1 and costs is None:
        return ""
    loads = ["loaded"] if len(wrenches) == 2 else [f"load {i}" for i in range(1, len(wrenches))]
    header = ["plan", "poses", "without a load", *loads]
    if costs is not None:
        header += ["load changes", f"costs [{costs.unit}]" if costs.unit else "costs"]
    rows = []
    for case in run.cases:
        if case.plan is None:
            continue
        poses = PosesByLoad.of(case.plan, wrenches, run.study.robot)
        visits = poses.visits.sum(axis=0)
        row = [case.name, len(poses.q), *(visits.tolist()[: len(wrenches)])]
        if costs is not None:
            changes = costs.changes_of(poses.wrenches[visits > 0])
            row += [changes, f"{costs.total(poses.wrenches, visits):g}"]
        rows.append(row)
    return f"## Visits by load\n\n{markdown_table(header, rows)}"
