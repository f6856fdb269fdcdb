"""The accuracy that a covariance of the compliances promises in each task of a study."""

import numpy as np

from edtk.inference.task_accuracy import task_accuracy
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.study import Study
from edtk.system.typing import Array


def accuracy_of_tasks(
    study: Study, cov: Array, k: Array | None = None, dof: float = np.inf
) -> TaskAccuracy | None:
    """Find the error to expect in each of several test poses.

    Args:
        study: The study.
        cov: Covariance (p, p) of the compliances.
        k: Identified compliances (p,); default to those of [simulation], as far as there are any.
        dof: Degrees of freedom of the covariance; inf where sigma is known.

    Returns:
        The errors; None for a single test pose, of which other lines tell, without one, and where
        the covariance leaves compliances open.
    """
    if len(study.tasks) < 2 or not np.isfinite(cov).all():
        return None
    if k is None and study.specification.simulation is not None:
        k = study.compliances
    before = None if k is None else _displacements(study, k)
    is_path = study.specification.task is not None
    return task_accuracy(study.tasks, cov, before, dof, is_path)


def _displacements(study: Study, k: Array) -> Array:
    """Displacement (t,) of the tool point by the load of each task, with the known joints [m]."""
    known = study.known
    tasks = study.tasks.with_unknown((*study.unknown, *known))
    every = np.concatenate([k, list(known.values())])
    return np.array([np.linalg.norm(task.regressor @ every) for task in tasks])
