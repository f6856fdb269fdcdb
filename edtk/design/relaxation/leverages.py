"""How much of a design's information each candidate carries."""

from typing import Protocol

import numpy as np

from criteria.linalg.inverse import guarded_inverse
from edtk.system.typing import Array


class Priced(Protocol):
    """Candidates that tell their sensitivities, such as a `Problem` or an `ActiveInformation`."""

    def sensitivities(self, Z: Array) -> Array:
        """``<Z, M_i>`` (k,) of a symmetric Z (p, p)."""
        ...


def leverages(candidates: Priced, weights: Array, M: Array) -> Array:
    """Leverages ``l_i = w_i <M^-1, M_i>`` (k,) of the candidates of a design M; their sum is p.

    Without candidates of leverages that add up to l there remains ``(1 - l) M`` at least, in the
    order of matrices, since ``w_i M_i <= l_i M``. So the sensitivities to the gradient change by a
    part of the order of l. That does not follow from light weights: near a singular optimum all
    that is told about some direction comes from candidates of vanishing weight, and the gradient,
    whose limit is the multiplier of the singular optimum, depends on the ratios of these weights.

    Args:
        candidates: The candidates (k).
        weights: Their weights (k,).
        M: ``sum_i w_i M_i`` (p, p).

    Returns:
        The leverages; zeros where M is singular to working precision.
    """
    _, cov, is_regular = guarded_inverse(M)
    if not is_regular:
        return np.zeros(len(weights))
    return weights * candidates.sensitivities(cov)
