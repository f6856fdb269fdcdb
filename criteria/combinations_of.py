"""Combinations of the parameters that a person gives, checked."""

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion_error import CriterionError
from criteria.linalg.typing import Array

DEPENDENT = 1e-10  # least singular value of unit combinations that do not follow from each other


def combinations_of(K: ArrayLike) -> Array:
    """A frozen copy (p, s) of combinations.

    Raises:
        CriterionError: They are not finite, or depend on each other.
    """
    found = np.array(K, dtype=float)
    found = found[:, None] if found.ndim == 1 else found
    if found.ndim != 2 or 0 in found.shape or not np.isfinite(found).all():
        raise CriterionError("interest: expected a finite matrix (p, s), a combination a column")
    length = np.linalg.norm(found, axis=0)
    if not (length > 0).all():
        raise CriterionError("interest: a combination is zero; expected factors that are not")
    s = np.linalg.svd(found / length, compute_uv=False)
    if found.shape[1] > found.shape[0] or s[-1] < DEPENDENT:
        raise CriterionError(
            "interest: a combination follows from the others; expected each to say something new"
        )
    found.flags.writeable = False
    return found
