"""What accuracy to expect in each of several test poses, or along a path."""

import numpy as np

from edtk.inference.error_quantiles import error_quantiles
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.task_accuracy import TaskAccuracy
from edtk.model.tasks import Tasks
from edtk.system.typing import Array

BAND = (0.025, 0.975)  # between these probabilities lie 95 % of the errors


def task_accuracy(
    tasks: Tasks,
    cov: Array,
    before: Array | None = None,
    dof: float = np.inf,
    is_path: bool = False,
) -> TaskAccuracy:
    """Find the error to expect in each pose of the tasks.

    Args:
        tasks: The poses, with their tools and loads.
        cov: Covariance (p, p) of the compliances.
        before: Displacement (t,) in each without compensation [m]; None if it is not known.
        dof: Degrees of freedom of the covariance; inf where sigma is known.
        is_path: Whether the poses follow each other along a path.
    """
    harms = [task.harm(task.q) for task in tasks]
    points = np.array([task.point for task in tasks])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return TaskAccuracy(
        along=np.append(0.0, np.cumsum(steps)),
        weight=np.array([task.weight for task in tasks]),
        error=np.array([float(compensation_accuracy(A, cov)) for A in harms]),
        band=np.array([error_quantiles(A, cov, BAND, dof) for A in harms]),
        before=before,
        is_path=is_path,
    )
