"""`edtk.evaluate`: a plan under every criterion."""

from edtk.study.evaluate import Evaluation
from edtk.system.arguments import checked
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study


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
