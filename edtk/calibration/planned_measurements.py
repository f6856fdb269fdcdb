"""The measurements that a plan will bring, without their values."""

import numpy as np

from edtk.design.plan import Plan
from edtk.inference.measurements import Measurements
from edtk.study.study import Study


def planned_measurements(study: Study, plan: Plan) -> Measurements:
    """Poses, loads and noise of a plan: a row for each pose.

    Repetitions count as one measurement of less noise, ``sigma / sqrt(repeats)``, so that very many
    are not expanded.

    Args:
        study: Says which rows are measured, and their noise.
        plan: The experiments.
    """
    poses = len(plan.q)
    sigma = study.sigma / np.sqrt(plan.repeats[:, None].astype(float))
    nothing = np.zeros((poses, len(study.sigma)))
    return Measurements(plan.q, plan.wrench, nothing, sigma, np.zeros((poses, 3)))
