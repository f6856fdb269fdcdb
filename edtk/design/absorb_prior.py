"""Bayesian criteria as criteria of a problem that knows the prior itself."""

from criteria import Criterion
from edtk.design.problem import Problem


def absorb_prior(
    problem: Problem, criterion: Criterion, size: float = 1.0
) -> tuple[Problem, Criterion]:
    """Put the prior precision of a Bayesian criterion into the problem.

    ``phi(M + R)`` of a plan of m experiments is phi of their information where each of them has
    ``R/m`` besides its own; so every algorithm sees a homogeneous criterion. Of other criteria
    nothing changes.

    Args:
        problem: The candidates.
        criterion: Any criterion.
        size: Number m of experiments that share the prior; one where weights of sum one are sought.

    Returns:
        The problem with more prior information, and phi; or both as they were given.
    """
    criterion.require_order(problem.p)
    if criterion.precision is None:
        return problem, criterion
    prior = criterion.precision / size
    if problem.prior is not None:
        prior = prior + problem.prior
    return problem.with_prior(prior), criterion.without_prior
