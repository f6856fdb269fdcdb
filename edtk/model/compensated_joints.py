"""Commands that carry a loaded tool to where it should be."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def compensated_joints(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, k: ArrayLike
) -> Array:
    """Find the command whose loaded tool pose is that of q0: ``q = q0 - k * tau(q0)``.

    ``tau(q0) = J(q0)' W`` are the joint torques. The command is exact, and no linearisation. A
    commanded q comes to rest at ``q + theta`` with ``theta = k * tau(q + theta)``
    (`edtk.model.equilibrium`). Asking that the loaded joints be q0, ``q + theta = q0``, turns this
    equation into ``theta = k * tau(q0)``, which has its unknown on one side only. As only joints
    deform, loaded joints q0 carry the tool to ``g(q0)``, position and orientation. A robot with six
    joints in a regular pose has no other command nearby that does so; with more joints, or in a
    singular pose, this command keeps the desired joints too.

    Eq. (15), ``q = q0 - J0^-1 K_C^-1 W``, is the same command under the assumption of Eq. (1), that
    all compliance is in the joints: ``K_C^-1 = J0 k J0'`` cancels the inverse. Its linear solution
    of Eq. (14) is thus exact for springs that are loaded in the *desired* pose. Eq. (14) solved to
    the end, and Eq. (15) for the position alone with a pseudo-inverse, are off by the second order
    of the load. Eq. (15) also needs K_C and J0 in q0, not in the command.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) in the desired pose [N, N m].
        k: Compliances (..., p) or (p,) of the model's unknown joints [rad/(N m)]; the others are
            rigid.

    Returns:
        Joint variables (..., n) to command [rad or m].
    """
    q0 = np.asarray(q0, dtype=float)
    W = np.asarray(wrench, dtype=float)
    k = np.asarray(k, dtype=float)
    if model.is_plain:
        J = model.robot.jacobian(q0)[..., model.joints]
        turn = k * (np.swapaxes(J, -1, -2) @ W[..., None])[..., 0]
    else:
        torque = model.torque_of(model.frames(q0), W)[model.joints]
        turn = k * np.moveaxis(torque, 0, -1)
    q = np.array(np.broadcast_to(q0, (*turn.shape[:-1], model.robot.n)))
    q[..., model.joints] -= turn
    return q
