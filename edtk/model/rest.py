"""Where a robot is at rest, before and under its load."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium
from edtk.model.loading import Loading
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Rest:
    """Joints between which a displacement is measured.

    Attributes:
        start: Joint variables (..., n) where a displacement begins: the commanded ones, or those
            of a robot that bends under its own weights [rad or m].
        end: Joint variables (..., n) under the load, at rest [rad or m].
    """

    start: Array
    end: Array

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        q: ArrayLike,
        wrench: ArrayLike,
        k: ArrayLike,
        signed: bool = False,
    ) -> "Rest":
        """Bring a robot to rest.

        Args:
            model: The robot, its load point and weights.
            q: Commanded joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the load point [N, N m].
            k: Compliances (..., n) or (n,) of all joints [rad/(N m)].
            signed: Allow negative compliances, see `equilibrium`.

        Raises:
            NoEquilibriumError: A pose buckles.
        """
        q = np.asarray(q, dtype=float)
        end = q + equilibrium(model.robot, q, wrench, k, signed, model.loading).theta
        if model.own_weights is None:
            return cls(np.broadcast_to(q, end.shape), end)
        own = Loading(weights=model.own_weights)
        before = equilibrium(model.robot, q, np.zeros(6), k, signed, own).theta
        return cls(np.broadcast_to(q + before, end.shape), end)
