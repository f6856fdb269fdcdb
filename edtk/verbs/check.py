"""`edtk.check`: whether a plan is free of what stands in the cell."""

from typing import TYPE_CHECKING

from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in, name_of

if TYPE_CHECKING:
    from edtk.cell.plan_check import PlanCheck


def check(study: StudyLike, plan: PlanLike) -> "PlanCheck":
    """Look at each pose of a plan in the cell of a study.

    Args:
        study: A study with a table [scene], or the path of a study file.
        plan: A plan, or the path of its CSV file; of any origin.

    Returns:
        For each pose its clearance, which is the least distance of two bodies less the margin, and
        the names of these two.

    Raises:
        UserError: A file is not valid, or the study has no [scene].
    """
    from edtk.cell.plan_check import PlanCheck

    asked = as_study(study)
    if asked.cell is None:
        raise asked.error("scene", "expected the table that says what stands around the robot")
    with errors_in(name_of(plan, "plan")):
        poses = as_plan(asked, plan).q
    return PlanCheck(asked.cell, poses)
