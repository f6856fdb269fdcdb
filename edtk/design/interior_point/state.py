"""How far each start of a descent has come."""

from dataclasses import dataclass

import numpy as np

from edtk.design.interior_point.barrier import LOWER
from edtk.design.interior_point.point import Point
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class State:
    """Primal and dual variables of the b starts that are on their way, and their barriers.

    Attributes:
        point: The place, with value, slacks and derivatives.
        z: Multipliers (b, k, c) of the slacks.
        mu: Weights (b,) of the barrier in the last step.
        bounds: Bounds (2, b) of the next weights.
        tried: How many lengths of the step from here were tried in vain (b,).
        done: Mask (b,) of the starts that have next to nothing left to gain.
    """

    point: Point
    z: Array
    mu: Array
    bounds: Array
    tried: Indices
    done: Mask

    @classmethod
    def first(cls, point: Point, barrier: float) -> "State":
        """Begin at those starts of a point that are strictly inside and of finite value.

        The multipliers are those of the central path, ``z = mu/s``.

        Args:
            point: All starts.
            barrier: Weight of all experiments together; each start gets its k-th part.
        """
        n, k = point.y.shape[:2]
        mu = np.full(n, barrier / k)
        with np.errstate(divide="ignore"):  # at starts on a constraint, which are left out below
            z = mu[:, None, None] / point.slack
        state = cls(
            point=point,
            z=z,
            mu=mu,
            bounds=np.stack([LOWER * mu, mu]),
            tried=np.zeros(n, dtype=int),
            done=np.zeros(n, dtype=bool),
        )
        return state._take(point.inside)

    def __len__(self) -> int:
        return len(self.mu)

    def going_on(self) -> "State":
        """The starts that are not done."""
        return self._take(np.flatnonzero(~self.done))

    def _take(self, chosen: Indices) -> "State":
        """The chosen starts; the state itself if all are chosen, which saves copies."""
        if len(chosen) == len(self):
            return self
        return State(
            point=self.point[chosen],
            z=self.z[chosen],
            mu=self.mu[chosen],
            bounds=self.bounds[:, chosen],
            tried=self.tried[chosen],
            done=self.done[chosen],
        )
