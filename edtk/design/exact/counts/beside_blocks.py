"""The question whose relaxation bounds plans in blocks."""

from dataclasses import replace

import numpy as np

from criteria import Criterion, CriterionError, Interest, Relaxable
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem

Question = tuple[Problem, Relaxable, Limits]


def beside_blocks(problem: Problem, criterion: Criterion, limits: Limits) -> Question | None:
    """Put one effect for all experiments in place of the effects of blocks.

    With ``s_b`` the sum of the rows of block b, and v the variance of its effect, blocks cost
    ``sum_b s_b' s_b / (n_b + 1/v)`` of the information. By the inequality of Cauchy and Schwarz
    this is at least ``s's / (m + B/v)`` with ``s = sum_b s_b``, for B blocks: what one effect costs
    of which the prior information is B/v. So plans in blocks tell no more than plans of the model
    with such an effect as one more parameter, which is nuisance. Plans reach it where all blocks
    have the same mean.

    Args:
        problem: The candidates, without a prior.
        criterion: What is minimised.
        limits: What plans must obey.

    Returns:
        The question to relax; as given where there are no blocks, and None where no relaxation
        bounds its plans.
    """
    if not isinstance(criterion, Relaxable):
        return None
    if not limits.blocks:
        return problem, criterion, limits
    if not criterion.monotone:
        return None
    free = replace(limits, blocks=())
    n, r, p = problem.factors().shape
    try:
        beside = _of_interest(criterion, p, r)
    except CriterionError:
        # Without blocks plans tell more: a bound on them is one here, if a weaker one.
        return problem, criterion, free
    effects = np.broadcast_to(np.eye(r), (n, r, r))
    rows = np.concatenate([problem.factors(), effects], axis=2)
    base = np.zeros((p + r, p + r))
    base[:p, :p] = limits.base
    precision = len(limits.blocks) / limits.block_variance
    base[p:, p:] = precision * np.eye(r)
    return Problem(rows), beside, replace(free, base=base)


def _of_interest(criterion: Relaxable, p: int, r: int) -> Interest:
    """The criterion of p parameters, beside r of nuisance."""
    base = criterion
    K = np.eye(p)
    names = None
    if isinstance(criterion, Interest):
        base = criterion.base
        K = criterion.K
        names = criterion.names
    return Interest(base, np.vstack([K, np.zeros((r, K.shape[1]))]), names)
