"""Criteria that depend on the covariance alone."""

from abc import abstractmethod

from criteria.criterion import Criterion
from criteria.linalg.typing import Array


class CovarianceCriterion(Criterion):
    """A criterion whose `_cost` needs the covariance, and never looks at the information.

    A criterion of a part of the parameters has their covariance at hand; it then saves the inverse.
    """

    @abstractmethod
    def covariance_slope(self, cov: Array) -> Array:
        """S (..., p, p) with d cost = <S, d cov>, so that the gradient is ``-cov S cov``."""
