"""A check that the gradient of a criterion is that of its cost."""

import numpy as np

from criteria.criterion import Criterion
from criteria.criterion_error import CriterionError
from criteria.linalg.typing import Array

STEP = 1e-4  # of a change of M, relative to its size: differences are good to its square
WRONG = 1e-3  # of the sizes of gradient and change: no rounding, and no step, is as wrong
DIRECTIONS = 2


def require_slope(criterion: Criterion, M: Array) -> None:
    """Check ``d cost = <G, dM>`` by differences of the cost.

    A wrong gradient makes no bound wrong, which multipliers prove by themselves, but designs poor:
    searches go where it points.

    Args:
        criterion: Any criterion.
        M: A well-conditioned information matrix (p, p). At a kink of the cost a subgradient is
            between the two one-sided slopes.

    Raises:
        CriterionError: Gradient and cost differ; the message says by how much.
    """
    rng = np.random.default_rng(0)
    cost = float(criterion.cost(M))
    G = criterion.gradient(M)
    for _ in range(DIRECTIONS):
        E = rng.normal(size=M.shape)
        E = (E + E.T) * np.linalg.norm(M) / np.linalg.norm(E + E.T)
        slopes = [
            (float(criterion.cost(M + sign * STEP * E)) - cost) / (sign * STEP) for sign in (1, -1)
        ]
        stated = float(np.sum(G * E))
        slack = WRONG * (np.linalg.norm(G) * np.linalg.norm(E) + max(map(abs, slopes)))
        if not min(slopes) - slack <= stated <= max(slopes) + slack:
            raise CriterionError(
                f"criterion {criterion.name!r}: its gradient is not that of its cost: along a "
                f"change of M the slope is {np.mean(slopes):.4g}, by the gradient {stated:.4g}"
            )
