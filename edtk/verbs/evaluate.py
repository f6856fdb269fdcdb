"""What a plan is worth: under every criterion, by the linear model, and in the cell.

`edtk.evaluate`, `edtk.bias` and `edtk.check`.
"""

from typing import TYPE_CHECKING

from edtk.calibration.planned import PlanBias, plan_bias
from edtk.study.evaluate import Evaluation
from edtk.system.arguments import checked
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in, name_of
from edtk.verbs.of_kinds import OfGeometry, of_study

if TYPE_CHECKING:
    from edtk.cell.plan_check import PlanCheck

NOT_LINEAR = (
    "geometry and springs are fitted where the loads bring the robot to rest, and by no linear "
    "model that could be biased; what joints do that count as rigid is in the error budget of a "
    "plan; expected a study without [parameters]"
)


@checked
def evaluate(study: StudyLike, plan: PlanLike) -> Evaluation:
    """Score a plan under every criterion of a study.

    Args:
        study: A study, or the path of a study file.
        plan: A plan, or the path of its CSV file.

    Returns:
        Values of all criteria, standard deviations and covariance of the compliances, SI units. For
        a study with [parameters] a `GeometryEvaluation`: those of its parameters in their own
        units, with the rank and what the plan leaves open in words.

    Raises:
        UserError: A file is not valid, or the plan cannot identify all compliances.
    """
    return of_study(study).evaluate(plan)


@checked
def bias(study: StudyLike, plan: PlanLike) -> PlanBias:
    """Tell how wrong the linear model makes the compliances that a plan identifies.

    The robot of the study's [simulation] comes to rest under each load of the plan; the linear
    model, Eq. (2), is fitted to its deflections.

    Args:
        study: A study, or the path of a study file; it must have a [simulation].
        plan: A plan, or the path of its CSV file.

    Returns:
        The bias of each compliance, in SI units, in standard deviations and in per cent.

    Raises:
        UserError: A file is not valid, the plan leaves parameters open, or a pose buckles; or the
            study has [parameters], which no linear model is fitted to.
    """
    question = as_study(study)
    if isinstance(of_study(question), OfGeometry):
        raise question.error("parameters", NOT_LINEAR)
    where = name_of(plan, "plan")
    with errors_in(where):
        return plan_bias(question, as_plan(question, plan), where)


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
