"""The main result of a comparison."""

import criteria
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.report.run_unit import run_unit
from edtk.study.study_run import StudyRun


def verdict(run: StudyRun) -> str:
    """How good the largest plan for the main criterion is, in at most three sentences."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    best = plans_of(run.table, "optimised", main).dropna(subset=[main]).sort_values("experiments")
    if best.empty:
        return "No size allows a plan that identifies all parameters.\n"
    row = best.iloc[-1]
    size = row["experiments"]
    text = (
        f"With {size} experiment{'s' if size > 1 else ''} the plan optimised for {main} reaches "
        f"{main} = {factor * row[main]:.4g} ({unit}), an efficiency of "
        f"{100 * row[f'efficiency_{main}']:.1f} % against the bound over all feasible poses "
        "(searched, not proved)."
    )
    better = "" if criteria.get(main).sense == "min" else " (larger is better)"
    for kind, plans in other_plans(run.table).items():
        others = plans[plans["experiments"] == size]
        if len(others):
            ratio = float(others[main].iloc[0] / row[main])
            text += f" For the {kind} plan {main} is {ratio:.3f} times that value{better}."
    return text + "\n"
