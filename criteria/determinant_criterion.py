"""Criteria that depend on the determinant of the information alone."""

from abc import abstractmethod

import numpy as np

from criteria.criterion import Criterion
from criteria.linalg.typing import Array


class DeterminantCriterion(Criterion):
    """A criterion whose cost is a function of det M.

    An exchange of experiments evaluates such a criterion by the matrix determinant lemma, which
    needs no update of an inverse.
    """

    @abstractmethod
    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """Costs (...) of regular (p, p) matrices, given their log det M (...)."""

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_log_determinant(np.linalg.slogdet(M).logabsdet, M.shape[-1])
