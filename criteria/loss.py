"""The loss of a criterion: how many times as many experiments a design needs as the best one."""

from dataclasses import dataclass

import numpy as np

from criteria.criterion import Criterion
from criteria.curvature import Curvature
from criteria.linalg.typing import Array


@dataclass(frozen=True, eq=False)
class Loss:
    """``f(M) = (cost(M) / best)^(1/d)`` of a smooth criterion of degree d, of degree one itself.

    Attributes:
        criterion: The criterion.
        best: Its least cost.
    """

    criterion: Criterion
    best: float

    def log(self, M: Array) -> float:
        """``log f`` at M (p, p); inf where M is singular."""
        return float(np.log(self.criterion.cost(M) / self.best)) / self.criterion.degree

    def slope(self, M: Array) -> Array:
        """Minus the gradient (p, p) of ``log f`` at a regular M (p, p)."""
        cost, G = self.criterion.cost_and_gradient(M)
        return np.asarray(-G / (self.criterion.degree * cost))

    def curvature(self, R: Array) -> Curvature | None:
        """The derivatives of ``log f`` at a root R (p, p) of the covariance, if they are known."""
        found = self.criterion.curvature(R)
        return None if found is None else found.power(1 / self.criterion.degree)
