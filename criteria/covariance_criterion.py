"""Criteria that depend on the covariance alone."""

from abc import abstractmethod

import numpy as np

from criteria.criterion import Criterion
from criteria.linalg.typing import Array


class CovarianceCriterion(Criterion):
    """A criterion whose `_cost` needs the covariance, and never looks at the information.

    A criterion of a part of the parameters has their covariance at hand; it then saves the inverse.
    """

    @abstractmethod
    def covariance_slope(self, cov: Array) -> Array:
        """S (..., p, p) with d cost = <S, d cov>, so that the gradient is ``-cov S cov``."""

    def cost_of_root(self, L: Array) -> Array:
        """Costs (...) of the covariances ``L L'`` of roots L (..., p, p)."""
        cov = L @ np.swapaxes(L, -1, -2)
        return self._cost(cov, cov)

    def slope_of_root(self, L: Array) -> Array:
        """``L' S L`` (..., p, p), with S the slope at the covariances ``L L'``."""
        transposed = np.swapaxes(L, -1, -2)
        return np.asarray(transposed @ self.covariance_slope(L @ transposed) @ L)
