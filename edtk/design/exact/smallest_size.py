"""The least number of experiments that identify all parameters."""

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.problem import Problem

DRAWN = 4000  # random poses; a direction that one in thirty excites is seen a hundred times
# Least eigenvalue that counts as identified, in parameters that whiten the mean of these poses. A
# direction that no chosen pose excites has SINGULAR. Of random pairs of poses of the paper's study
# even the worst of two thousand has 7e-7, and a pair that was chosen has one.
REGULAR = 1e-7
SINGULAR = 1e-9  # lets the determinant of too few poses tell which pose adds a direction


def smallest_size(space: DesignSpace, criterion: Criterion | None = None) -> int:
    """Find the least number of experiments whose information is regular.

    Of random poses, the one with the largest determinant beside those chosen before (and the
    prior) is chosen next. A pose that adds a direction is thus preferred to one that adds none,
    and p poses have all p directions.

    A criterion that is not about all parameters needs less: there the pose is chosen that lowers
    its cost most, until the cost is finite.

    Args:
        space: Model, feasible set and prior.
        criterion: Tells what has to be identified; defaults to all parameters.

    Raises:
        RankDeficientError: No number of experiments identifies all that has to be.
    """
    problem = CandidateSource(space, 0, workers=1).take(DRAWN).problem
    problem.require_identifiable(criterion)
    if criterion is not None and not criterion.needs_all:
        return _smallest_size_for(criterion, problem)
    p = space.p
    T = whitener(problem.mean)
    blocks = T.T @ problem.blocks() @ T
    M = SINGULAR * np.eye(p)
    if problem.prior is not None:
        M = M + T.T @ problem.prior @ T
    for size in range(1, p + 1):
        M = M + blocks[int(np.linalg.slogdet(M + blocks).logabsdet.argmax())]
        if np.linalg.eigvalsh(M)[0] > REGULAR:
            return size
    return p


def _smallest_size_for(criterion: Criterion, problem: Problem) -> int:
    """The same for a criterion that is finite at some singular matrices."""
    T = range_whitener(problem.mean)
    whitened = criterion.in_units(T)
    blocks = T.T @ problem.blocks() @ T
    r = T.shape[1]
    M = np.zeros((r, r)) if problem.prior is None else T.T @ problem.prior @ T
    for size in range(1, r + 1):
        best = int(np.argmin(whitened.cost(M + blocks + SINGULAR * np.eye(r))))
        M = M + blocks[best]
        if np.isfinite(whitened.cost(M)):
            return size
    return r
