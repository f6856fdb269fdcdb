"""`edtk.evaluate`: a plan under every criterion."""

from edtk.study.evaluate import Evaluation
from edtk.study.evaluate import evaluate as evaluate_plan
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in, name_of


def evaluate(study: StudyLike, plan: PlanLike) -> Evaluation:
    """Score a plan under every criterion of a study.

    Args:
        study: A study, or the path of a study file.
        plan: A plan, or the path of its CSV file.

    Returns:
        Values of all criteria, standard deviations and covariance of the compliances, SI units.

    Raises:
        UserError: A file is not valid, or the plan cannot identify all parameters.
    """
    question = as_study(study)
    with errors_in(name_of(plan, "plan")):
        return evaluate_plan(question, as_plan(question, plan))
