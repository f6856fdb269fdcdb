"""The error budget of a plan, before anything is measured."""

import numpy as np

from edtk.calibration.calibration_budget import uncertainty_of
from edtk.calibration.error_budget import error_budget
from edtk.calibration.planned_measurements import planned_measurements
from edtk.design.plan import Plan
from edtk.inference.least_squares import SingularPlanError, covariance
from edtk.model.error_budget import ErrorBudget
from edtk.study.study import Study
from edtk.study.study_model import payload_beside_load


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
    if not study.tasks or study.specification.simulation is None:
        return None
    try:
        cov = np.asarray(covariance(study.information(plan), study.model.parameters))
    except SingularPlanError:
        return None
    k = study.compliances
    data = planned_measurements(study, plan)
    uncertainty = uncertainty_of(study, k)
    repeats = np.repeat(plan.repeats, len(study.model.instruments))
    return error_budget(
        study.model,
        data,
        study.tasks,
        k,
        cov,
        uncertainty,
        repeats=repeats,
        payload=payload_beside_load(study),
    )
