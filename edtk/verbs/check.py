"""`edtk.check`: whether a plan is free of what stands in the cell, and what is seen of it."""

from typing import TYPE_CHECKING

from edtk.system.arguments import checked
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in, name_of

if TYPE_CHECKING:
    from edtk.cell.plan_check import PlanCheck


@checked
def check(study: StudyLike, plan: PlanLike) -> "PlanCheck":
    """Look at each pose of a plan in the cell of a study, and at the ways between them.

    With a [scene] something may touch, and with a line of sight, by [sight] or by normals of
    markers, something may be hidden; either is enough.

    The ways are those in the order of the plan's sheet, see `edtk.timetable`: the direct leg where
    that is proved free, else one by via poses.

    Args:
        study: A study with a table [scene], a line of sight, or both; or the path of its file.
        plan: A plan, or the path of its CSV file; of any origin.

    Returns:
        For each pose its clearance, which is the least distance of two bodies less the margin, and
        the names of these two; why markers are hidden, where the study has a line of sight; and for
        each way whether it is free.

    Raises:
        UserError: A file is not valid, or the study has neither.
    """
    from edtk.calibration.timetable import day_of
    from edtk.cell.plan_check import PlanCheck, Seen

    asked = as_study(study)
    if asked.cell is None and asked.sight is None:
        message = "expected this table, which says what stands around the robot, or [sight]"
        raise asked.error("scene", message)
    with errors_in(name_of(plan, "plan")):
        measured = as_plan(asked, plan)
    ways = () if asked.cell is None else day_of(asked, measured).ways
    seen = None if asked.sight is None else Seen(asked.sight, measured.q)
    return PlanCheck(asked.cell, measured.q, ways, seen)
