"""From the compliances of some joints to those of all."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def all_compliances(model: ElastostaticModel, k: ArrayLike) -> Array:
    """Compliances (..., n) of all joints; those that are not unknown to the model are rigid.

    Args:
        model: Says which joints the compliances belong to.
        k: Compliances (..., p) of the unknown joints [rad/(N m)].
    """
    k = np.asarray(k, dtype=float)
    complete = np.zeros((*k.shape[:-1], model.robot.n))
    complete[..., model.joints] = k
    return complete
