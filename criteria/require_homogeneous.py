"""A check that a criterion has the degree that it declares."""

import numpy as np

from criteria.criterion import Criterion
from criteria.criterion_error import CriterionError
from criteria.linalg.typing import Array

FACTORS = (0.25, 7.0)  # of information; powers of two alone would hide a cost that rounds
WRONG = 1e-6  # relative difference of costs that no rounding of a sound design makes


def require_homogeneous(criterion: Criterion, M: Array, rounding: float = 0.0) -> None:
    """Check ``cost(c M) = c^-degree cost(M)``, on which every bound rests.

    Bounds of weights are scaled by it to plans of m experiments, and duals are derived from it. A
    criterion whose degree is wrong would get bounds that are wrong, in silence.

    Args:
        criterion: Any criterion.
        M: An information matrix (p, p) at which to check; nothing is checked where its cost is
            not finite.
        rounding: Relative error that rounding may make in costs of M.

    Raises:
        CriterionError: The cost grows otherwise; the message says how.
    """
    cost = float(criterion.cost(M))
    if not np.isfinite(cost) or criterion.precision is not None:
        return
    if not cost > 0:
        raise CriterionError(
            f"criterion {criterion.name!r}: its cost is {cost:g}; expected a positive number"
        )
    allowed = WRONG + 2 * rounding
    for factor in FACTORS:
        found = float(criterion.cost(factor * M)) / cost
        expected = factor**-criterion.degree
        if not abs(found - expected) <= allowed * expected:
            raise CriterionError(
                f"criterion {criterion.name!r}: its cost is not homogeneous of degree "
                f"{criterion.degree:g}: {factor:g} times the information has {found:.6g} times the "
                f"cost; expected {expected:.6g}"
            )
