"""The linear model of the deflection, one column after the other."""

from collections.abc import Collection

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.physics import Weight, weight_torque
from edtk.system.typing import Array


def regressors(
    chain: Chain, unknown: list[int], q: Array, wrench: Array, weights: Collection[Weight] = ()
) -> Array:
    """Regressors (k, 6, p), Eq. (4): each column of the Jacobian times its torque ``J_j' W``.

    Args:
        chain: The robot with its tool.
        unknown: Indices (p,) of the joints whose compliances are the parameters.
        q: Poses (k, n) [rad or m].
        wrench: Loads (k, 6) [N, N m].
        weights: What loads the joints besides the wrench.
    """
    columns = chain.jacobian(q)[:, :, unknown]
    torque = np.einsum("krp,kr->kp", columns, wrench)
    if weights:
        torque = torque + weight_torque(chain, weights, q)[:, unknown]
    return np.asarray(columns * torque[:, None])
