"""Compliance compensation and its accuracy."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium

Array = NDArray[np.float64]


def compensated_joints(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, k: ArrayLike
) -> Array:
    """The command ``q = q0 - k * tau(q0)``, ``tau(q0) = J(q0)' W``, whose loaded tool pose is that of q0.

    It is exact, and no linearisation. A commanded q comes to rest at ``q + theta`` with ``theta = k * tau(q + theta)``
    (`edtk.model.equilibrium`). Asking that the loaded joints be q0, ``q + theta = q0``, turns this equation into
    ``theta = k * tau(q0)``, which has its unknown on one side only. As only joints deform, loaded joints q0 carry the
    tool to ``g(q0)``, position and orientation. A robot with six joints in a regular pose has no other command nearby
    that does so; with more joints, or in a singular pose, this one keeps the desired joints too.

    Eq. (15), ``q = q0 - J0^-1 K_C^-1 W``, is the same command under the assumption of Eq. (1), that all compliance is
    in the joints: ``K_C^-1 = J0 k J0'`` cancels the inverse. Its linear solution of Eq. (14) is thus exact for springs
    that are loaded in the *desired* pose, while Eq. (14) solved to the end, or Eq. (15) for the position alone with
    a pseudo-inverse, are off by the second order of the load. It also needs K_C and J0 in q0, not in the command.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) in the desired pose [N, N m].
        k: Compliances (..., p) or (p,) of the model's unknown joints [rad/(N m)]; the others are rigid.

    Returns:
        Joint variables (..., n) to command.
    """
    q0, W, k = (
        np.asarray(q0, dtype=float),
        np.asarray(wrench, dtype=float),
        np.asarray(k, dtype=float),
    )
    J = model.robot.jacobian(q0)[..., model.joints]
    turn = k * (np.swapaxes(J, -1, -2) @ W[..., None])[..., 0]
    q = np.array(np.broadcast_to(q0, (*turn.shape[:-1], model.robot.n)))
    q[..., model.joints] -= turn
    return q


def all_compliances(model: ElastostaticModel, k: ArrayLike) -> Array:
    """Compliances (..., n) of all joints from those (..., p) of the unknown ones; the others are rigid."""
    k = np.asarray(k, dtype=float)
    whole = np.zeros((*k.shape[:-1], model.robot.n))
    whole[..., model.joints] = k
    return whole


def remaining_error(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, believed: ArrayLike, true: ArrayLike
) -> Array:
    """Tool point under load minus the desired one, when the command rests on other compliances than the true ones.

    ``g(q + theta(q)) - g(q0)`` with ``q = q0 - believed * tau(q0)`` and the equilibrium theta of the true robot; to
    first order ``A0 (true - believed)``, the error of which Eq. (17) is the mean square.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) [N, N m].
        believed: Compliances (..., p) that the controller uses [rad/(N m)].
        true: Compliances (..., p) of the robot [rad/(N m)].

    Returns:
        Error (..., 3) [m].

    Raises:
        NoEquilibriumError: A pose buckles under the load.
    """
    q = compensated_joints(model, q0, wrench, believed)
    loaded = q + equilibrium(model.robot, q, wrench, all_compliances(model, true)).theta
    return np.asarray(model.robot.forward(loaded)[..., :3, 3] - model.robot.forward(q0)[..., :3, 3])


def compensation_accuracy(A: Array, cov: Array) -> Array:
    """Eq. (17): ``rho = sqrt(E(dk' A' A dk)) = sqrt(trace(A cov A'))``; Eq. (20) for the test pose's A0.

    Args:
        A: Regressors (..., rows, p) of the task poses.
        cov: Covariance (p, p) of the compliances.

    Returns:
        Root mean square position error (...) [m].
    """
    return np.sqrt(np.einsum("...ri,ij,...rj->...", A, cov, A))
