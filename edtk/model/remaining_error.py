"""The error that remains after a compensation with wrong compliances."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.all_compliances import all_compliances
from edtk.model.compensated_joints import compensated_joints
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium
from edtk.system.typing import Array


def remaining_error(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, believed: ArrayLike, true: ArrayLike
) -> Array:
    """Tool point under load minus the desired one, for a command from believed compliances.

    ``g(q + theta(q)) - g(q0)`` with ``q = q0 - believed * tau(q0)`` and the equilibrium theta of
    the true robot; to first order ``A0 (true - believed)``, of which Eq. (17) is the mean square.

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
    k = all_compliances(model, true)
    loaded = q + equilibrium(model.robot, q, wrench, k, loading=model.loading).theta
    reached = model.robot.forward(loaded)[..., :3, 3]
    desired = model.robot.forward(q0)[..., :3, 3]
    return np.asarray(reached - desired)
