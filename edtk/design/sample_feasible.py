"""Random feasible experiments."""

import numpy as np

from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.system.typing import Array


def sample_feasible(space: DesignSpace, n: int, seed: int | tuple[int, ...]) -> Array:
    """Draw n feasible experiments (n, v), uniform within the bounds.

    Raises:
        EmptyFeasibleSetError: No feasible pose turns up; names the constraint.
        ValueError: n < 1.
    """
    return np.concatenate([chunk.x for chunk in CandidateSource(space, seed).chunks(n)])
