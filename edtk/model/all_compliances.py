"""From the compliances of some joints to those of all."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def all_compliances(
    model: ElastostaticModel, k: ArrayLike, known: Mapping[int, float] | None = None
) -> Array:
    """Compliances (..., n) of all joints; those that are neither unknown nor known are rigid.

    Args:
        model: Says which joints the compliances belong to.
        k: Compliances (..., p) of the unknown joints [rad/(N m)].
        known: Compliances of other joints, by their indices [rad/(N m)]; none by default.
    """
    k = np.asarray(k, dtype=float)
    complete = np.zeros((*k.shape[:-1], model.robot.n))
    complete[..., model.joints] = k
    for j, compliance in (known or {}).items():
        complete[..., j] = compliance
    return complete
