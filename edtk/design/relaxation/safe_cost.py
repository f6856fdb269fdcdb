"""The cost of a design that may be singular, and what it may be too low by."""

import numpy as np

from criteria import Criterion
from edtk.system.typing import Array

NOTHING = 1e-13  # part of a combination that an open direction may have by rounding alone


def safe_cost(criterion: Criterion, M: Array) -> float:
    """The cost of a design M (p, p), not below that of a regular design close to it.

    An inverse of a singular M leaves open directions out. Where a combination c of interest has a
    part a along such a direction v, beyond rounding, c is not told at all. With a little weight e
    elsewhere the cost C becomes about ``C (1 + e) + a^2/e``, which is least at ``C + 2 a C^(1/2)``;
    at unit diagonal ``C >= |c|^2/p``, so that C is too low by at most the part ``2 p^(1/2) a/|c|``.

    Args:
        criterion: What is minimised.
        M: The design (p, p).
    """
    cost = float(criterion.cost(M))
    if criterion.needs_all or not np.isfinite(cost):
        return cost
    strayed = criterion.strayed(M)
    return cost if strayed <= NOTHING else cost * (1 + 2 * len(M) ** 0.5 * strayed)
