"""The main result of a comparison."""

from typing import TYPE_CHECKING

import criteria
from edtk.model.joint_margin import joints_on_limits, on_limits_in_words
from edtk.report.comparison.cell import number
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.report.run_unit import run_unit
from edtk.report.text.error_budget import assumed_joints
from edtk.report.text.study_run import budget_of_run
from edtk.study.study_run import StudyRun

if TYPE_CHECKING:
    import pandas as pd


def verdict(run: StudyRun) -> str:
    """Which plan to measure, what to expect of it, and what to do with it."""
    main = run.study.main_criterion
    best = plans_of(run.table, "optimised", main).dropna(subset=[main]).sort_values("experiments")
    if best.empty:
        return "No size allows a plan that identifies all parameters.\n"
    row = best.iloc[-1]
    file = f"plans/{row['plan']}.csv"
    sentences = [*_promise(run, row, file), *_others(run, row), *_on_limits(run, row)]
    return f"""{" ".join(sentences)}
{_total(run)}
Write the sheet for the day in the lab, and read it when it is filled in, as far as it is:

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
    reached = f"{main} = {value} ({unit})"
    if main == "rho0":
        reached = (
            f"rho0 = {value} {unit}: the error to expect {run.study.tasks.place} after "
            "compensation (root mean square, by the noise of the measurements alone)"
        )
    text = f"**Measure the {size} experiment{plural} of `{file}`.** They reach {reached}."
    efficiency = f"an efficiency of {100 * row[f'efficiency_{main}']:.1f} %"
    bound = run.bound(size)
    if bound is None:
        return [text, f"They have {efficiency}."]
    limit = f"{number(factor * bound.value)} {'' if unit == 'SI' else unit}".strip()
    told = "searched over all feasible poses, not proved"
    return [text, f"No plan of {size} is better than {limit} ({told}): this one has {efficiency}."]


def _total(run: StudyRun) -> str:
    """What the plan leaves in all, of which the noise is a part; empty if unknown."""
    budget = budget_of_run(run)
    if budget is None:
        return ""
    joints = "".join(f"; {line}" for line in assumed_joints(budget))
    return (
        f"\nExpect a **total error of {1e3 * budget.total:.2g} mm** {run.study.tasks.place} after "
        f"compensation, and {1e3 * budget.uncompensated:.2g} mm without. What is measured makes "
        f"{1e3 * budget.measured:.2g} mm of it{joints}.\n"
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
            found.append(f"For the {kind} plan {main} is {ratio:.3f} times that value{better}.")
    return found


def _on_limits(run: StudyRun, row: "pd.Series") -> list[str]:
    """Which joints stand on their limits in the plan."""
    plans = [case.plan for case in run.cases if case.name == row["plan"]]
    if not plans or plans[0] is None:
        return []
    found = joints_on_limits(run.study.robot, plans[0].q, frozenset(run.study.fixed))
    words = on_limits_in_words(found)
    return [f"Joints stand {words}."] if words else []
