"""The candidates with which column generation begins."""

import numpy as np

from criteria.linalg.null_space import open_directions
from edtk.design.problem import Problem
from edtk.design.relaxation.experiment_blocks import experiment_blocks
from edtk.system.typing import Array, Indices

# Among so many candidates the choice takes milliseconds; among all of a million it would take
# longer than the relaxation itself.
SAMPLE = 2000
# Part of the mean of all candidates from which the greedy choice starts: M is regular from the
# beginning, whatever the sample, and the mean soon no longer matters.
REGULARISATION = 1e-6


def first_active_set(problem: Problem, size: int) -> Indices:
    """Choose candidates that together identify every parameter, for the first restricted master.

    One after another the candidate of the largest sensitivity to ``M^-1`` is taken, which is the
    one that raises det M most. The choice is among an evenly spaced sample of the candidates, or
    among all of them if the sample leaves a direction of the parameters open.

    Args:
        problem: Candidates that identify all parameters.
        size: Number of candidates to choose; at least as many as there are parameters are taken.

    Returns:
        Indices (k,), in the order of the choice.
    """
    sample = np.unique(np.linspace(0, problem.n - 1, SAMPLE).astype(int))
    every = np.arange(problem.n)
    for among in (sample, every):
        part = problem[among] if len(among) < problem.n else problem
        M = REGULARISATION * problem.mean
        chosen = _most_informative(part, M, min(max(size, problem.p), part.n))
        if not open_directions(experiment_blocks(part, chosen).mean(axis=0), problem.parameters):
            break
    return among[chosen]


def _most_informative(problem: Problem, M: Array, size: int) -> Indices:
    """Indices (size,) of candidates, each the one that raises det M most beside those before it."""
    chosen: list[int] = []
    for _ in range(size):
        gain = problem.sensitivities(np.linalg.inv(M))
        gain[chosen] = -np.inf
        chosen.append(int(gain.argmax()))
        M = M + experiment_blocks(problem, np.array(chosen[-1:]))[0]
    return np.array(chosen)
