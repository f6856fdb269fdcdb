"""Compliance compensation and its accuracy."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from edtk.model import ElastostaticModel

Array = NDArray[np.float64]


def compensated_joints(model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, k: ArrayLike) -> Array:
    """Eq. (15): ``q = q0 - J0^-1 K_C^-1 W``, the linear solution of Eq. (14).

    With ``K_C^-1 = J k_theta J'`` this is ``q0 - k_theta J' W``: the joints are turned back by what the load
    turns them, which also holds in singular poses and for any number of joints.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) [N, N m].
        k: Compliances (p,) of the model's unknown joints [rad/(N m)].

    Returns:
        Joint variables (..., n) to command.
    """
    q = np.array(q0, dtype=float)
    J = model.robot.jacobian(q)[..., model.joints]
    torque = np.einsum("...ij,...i->...j", J, np.broadcast_to(wrench, (*J.shape[:-2], 6)))
    q[..., model.joints] -= np.asarray(k, dtype=float) * torque
    return q


def compensation_accuracy(A: Array, cov: Array) -> Array:
    """Eq. (17): ``rho = sqrt(E(dk' A' A dk)) = sqrt(trace(A cov A'))``; Eq. (20) for the test pose's A0.

    Args:
        A: Regressors (..., rows, p) of the task poses.
        cov: Covariance (p, p) of the compliances.

    Returns:
        Root mean square position error (...) [m].
    """
    return np.sqrt(np.einsum("...ri,ij,...rj->...", A, cov, A))
