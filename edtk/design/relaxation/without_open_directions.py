"""Problems some of whose parameters no candidate tells, which then must not be of interest."""

from dataclasses import replace

import numpy as np

from criteria.linalg.estimable import open_subspace
from criteria.linalg.root import root
from edtk.design.bound import Bound, BoundKind
from edtk.design.problem import Problem
from edtk.design.relaxation.relaxation import Relaxation


def without_open_directions(problem: Problem) -> Problem:
    """The same problem with information about the directions that all its candidates leave open.

    Let ``M U = 0`` for every design M, let W be such that W'U is regular, and let ``U'K = 0``, so
    that K'k is estimable. From ``(M + W W') Y = K`` follow ``U'W W'Y = 0``, so ``W'Y = 0`` and
    ``M Y = K``: C_K is the same with and without W W'. With it, all designs can be regular.

    Args:
        problem: Candidates that tell all that is of interest.

    Returns:
        A problem whose prior has W W' besides; the problem itself where no direction is open.
    """
    _, W = open_subspace(problem.mean)
    if not W.size:
        return problem
    prior = W @ W.T if problem.prior is None else problem.prior + W @ W.T
    return problem.with_prior(prior)


def proved_on(problem: Problem, found: Relaxation) -> Relaxation:
    """The relaxation of a closed problem as one of the problem itself.

    With the projection ``P = I - U W'`` the multiplier ``P Z P'`` has the same sensitivities to the
    candidates and the same ``K'Z K`` as Z, and none to W W'.

    Args:
        problem: The problem as it was given.
        found: The relaxation of `without_open_directions`, with costs of the problem as given.
    """
    U, W = open_subspace(problem.mean)
    P = np.eye(problem.p) - U @ W.T
    # A product of a root with itself is semidefinite, where P Z P' may leave a noise that is not.
    roots = np.array([root(z) @ P.T for z in found.multipliers])
    Z = np.swapaxes(roots, 1, 2) @ roots
    largest = problem.sensitivities(Z).max(axis=-1)
    cost = found.criterion.lower_bound(Z, largest, problem.information(found.weights))
    bound = Bound.of(found.criterion, cost, found.cost, BoundKind.PROVED_ON_CANDIDATES)
    return replace(found, multipliers=Z, proved_bound=bound)
