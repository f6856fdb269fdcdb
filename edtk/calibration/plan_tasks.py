"""The accuracy that a plan promises in each of several test poses."""

from dataclasses import replace

import numpy as np

from edtk.calibration.plan_propagation import plan_propagation
from edtk.design.plan import Plan
from edtk.inference.least_squares import SingularPlanError
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.accuracy_of_tasks import accuracy_of_tasks
from edtk.study.plan_covariance import plan_covariance
from edtk.study.study import Study


def plan_tasks(study: Study, plan: Plan) -> TaskAccuracy | None:
    """Find the errors to expect in each test pose, with the total where compliances are assumed.

    Args:
        study: The study.
        plan: All experiments.

    Returns:
        The errors; None for a single test pose, without one, and if the plan leaves a compliance
        open.
    """
    if len(study.tasks) < 2:
        return None
    try:
        found = accuracy_of_tasks(study, plan_covariance(study, study.information(plan)))
    except SingularPlanError:
        return None
    propagation = None if found is None else plan_propagation(study, plan)
    if found is None or propagation is None:
        return found
    return replace(found, total=propagation.totals(study.tasks, np.zeros(len(study.tasks))))
