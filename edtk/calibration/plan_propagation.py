"""How what is uncertain moves the estimates of a planned calibration."""

import numpy as np

from edtk.calibration.calibration_budget import uncertainty_of
from edtk.calibration.planned_measurements import planned_measurements
from edtk.calibration.propagation import Propagation
from edtk.design.plan import Plan
from edtk.inference.least_squares import SingularPlanError, covariance
from edtk.study.study import Study
from edtk.study.study_model import payload_beside_load


def plan_propagation(study: Study, plan: Plan) -> Propagation | None:
    """Propagate the circumstances of a calibration by a plan to its estimates.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.

    Returns:
        The shifts of the estimates; None without a [simulation], or if the plan leaves a compliance
        open.
    """
    if study.specification.simulation is None:
        return None
    try:
        cov = np.asarray(covariance(study.information(plan), study.model.parameters))
    except SingularPlanError:
        return None
    k = study.compliances
    return Propagation.of(
        study.model,
        planned_measurements(study, plan),
        k,
        cov,
        uncertainty_of(study),
        np.repeat(plan.repeats, len(study.model.instruments)),
        payload=payload_beside_load(study),
    )
