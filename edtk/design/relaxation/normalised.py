"""How criteria that are blind to the amount of information are brought to the others' form."""

import numpy as np

from criteria import Criterion
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices


def is_normalised(criterion: Criterion) -> bool:
    """Whether designs are compared at unit trace, because the cost has degree zero.

    Such a cost does not depend on the length of M, so that no bound on ``<Z, M>`` tells anything
    about it. Among designs of unit trace a bound does, and these are means of candidates of unit
    trace, with other weights than the design itself.
    """
    return criterion.degree == 0


def normalised(problem: Problem, criterion: Criterion) -> Problem:
    """The problem that the relaxation solves and whose sensitivities prove its bound.

    Args:
        problem: The candidates as they are.
        criterion: Tells whether candidates must have unit trace, see `is_normalised`.

    Returns:
        The problem itself, or the one of candidates of unit trace.
    """
    return problem.with_unit_trace(criterion.trace_root) if is_normalised(criterion) else problem


def original_weights(
    problem: Problem, criterion: Criterion, chosen: Indices, weights: Array
) -> Array:
    """Weights of the candidates as they are, from those of the normalised problem.

    Args:
        problem: The candidates as they are.
        criterion: What the weights minimise.
        chosen: Indices (k,) of the candidates that have weights.
        weights: Weights (k,) in the normalised problem.

    Returns:
        Weights (k,) of sum one, of a design whose information has the same direction.
    """
    if is_normalised(criterion):
        trace = problem[chosen].traces(criterion.trace_root)
        weights = np.divide(weights, trace, out=np.zeros_like(weights), where=trace > 0)
    return weights / weights.sum()
