"""The candidates with which column generation begins."""

from weakref import WeakKeyDictionary

import numpy as np

from criteria.linalg.inverse import whitener
from criteria.linalg.null_space import open_directions
from criteria.linalg.root import root
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
    known = _known.setdefault(problem, {})
    if size not in known:
        known[size] = _chosen(problem, size)
    return known[size]


# Several criteria of one problem begin with the same candidates; they are forgotten with it.
_known: WeakKeyDictionary[Problem, dict[int, Indices]] = WeakKeyDictionary()


def _chosen(problem: Problem, size: int) -> Indices:
    """The candidates of `first_active_set`."""
    sample = np.unique(np.linspace(0, problem.n - 1, SAMPLE).astype(int))
    every = np.arange(problem.n)
    for among in (sample, every):
        part = problem[among] if len(among) < problem.n else problem
        chosen = _most_informative(part, problem.mean, min(max(size, problem.p), part.n))
        if not open_directions(experiment_blocks(part, chosen).mean(axis=0), problem.parameters):
            break
    return among[chosen]


def _most_informative(problem: Problem, mean: Array, size: int) -> Indices:
    """Indices (size,) of candidates, each the one that raises det M most beside those before it.

    After a candidate of information ``U'U`` the inverse C of M is ``C - B B'`` with
    ``B = C U' F^-1``, ``F'F = I + U C U'``. So the sensitivities fall by those to ``B B'``, a
    matrix of low rank, and no inverse is computed anew.
    """
    T = whitener(mean)
    C = T @ T.T / REGULARISATION
    gain = problem.sensitivities(C)
    chosen: list[int] = []
    for _ in range(size):
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        chosen.append(best)
        B = _lost(C, problem, best)
        C = C - B @ B.T
        gain = gain - problem.sensitivities_to_root(B)
    return np.array(chosen)


def _lost(C: Array, problem: Problem, chosen: int) -> Array:
    """B (p, r): an inverse C (p, p) falls by ``B B'`` where a candidate joins."""
    U = problem.factors(chosen)
    if problem.prior is not None:
        U = np.concatenate([U, root(problem.prior)])
    F = np.linalg.cholesky(np.eye(len(U)) + U @ C @ U.T)
    return np.asarray(np.linalg.solve(F, U @ C).T)
