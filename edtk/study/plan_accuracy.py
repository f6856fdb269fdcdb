"""The accuracy that a plan promises in the task of its study."""

import numpy as np

from edtk.design.plan import Plan
from edtk.inference.least_squares import SingularPlanError, covariance
from edtk.model.expected_error import ExpectedError, expected_error
from edtk.study.study import Study


def plan_accuracy(study: Study, plan: Plan) -> ExpectedError | None:
    """Find the errors to expect in the test pose and around it.

    Args:
        study: The study, whose design space needs no candidates for this.
        plan: All experiments.

    Returns:
        The errors; None without a test pose, or if the plan leaves a parameter open.
    """
    if not study.tasks:
        return None
    try:
        cov = covariance(study.information(plan), study.model.parameters)
    except SingularPlanError:
        return None
    return expected_error(study.tasks, np.asarray(cov))
