"""The error budget of a plan, before anything is measured."""

from edtk.calibration.plan_propagation import plan_propagation
from edtk.design.plan import Plan
from edtk.model.error_budget import ErrorBudget
from edtk.study.study import Study


def plan_budget(study: Study, plan: Plan) -> ErrorBudget | None:
    """Propagate what is uncertain in a calibration by a plan to the study's task.

    The nonlinear model will be fitted where it matters, so that the part of the linear one is zero.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.

    Returns:
        The budget; None without a test pose or a [simulation], or if the plan leaves a compliance
        open.
    """
    propagation = plan_propagation(study, plan) if study.tasks else None
    return None if propagation is None else propagation.budget(study.tasks)
