"""`edtk.bias`: the cost of identifying with the linear model."""

from edtk.calibration.planned import PlanBias, plan_bias
from edtk.system.arguments import checked
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in, name_of
from edtk.verbs.of_kinds import OfGeometry, of_study

NOT_LINEAR = (
    "geometry and springs are fitted where the loads bring the robot to rest, and by no linear "
    "model that could be biased; what joints do that count as rigid is in the error budget of a "
    "plan; expected a study without [parameters]"
)


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
