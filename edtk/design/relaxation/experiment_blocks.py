"""The information that a plan of one experiment has."""

from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices


def experiment_blocks(problem: Problem, chosen: Indices) -> Array:
    """Information ``M0 + A_i' A_i / sigma^2`` (k, p, p) of one experiment in some candidates each.

    Weights of sum one make of them the information matrix of a design, the prior M0 included. The
    candidates alone are `Problem.blocks`.

    Args:
        problem: The candidates, and the prior information per experiment.
        chosen: Indices (k,) of the candidates.
    """
    blocks = problem.blocks(chosen)
    return blocks if problem.prior is None else blocks + problem.prior
