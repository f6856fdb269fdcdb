"""What accuracy plans promise in the test pose, and around it."""

from edtk.report.comparison.cell import number
from edtk.report.markdown_table import markdown_table
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.study.comparison_table import ERRORS
from edtk.study.study_run import StudyRun


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
    of_best = "" if run.expected is None else f"Largest plan, {run.expected}. "
    text = (
        f"{of_best}{sampled} at 255 poses, the test pose among them; "
        "root mean square errors after compensation, by the noise of the measurements alone [um]:"
    )
    return f"{text}\n\n{markdown_table(header, rows)}"
