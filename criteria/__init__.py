"""What makes an information matrix good: optimality criteria, each in a file of its own.

A criterion eats a (p, p) information matrix ``M = sum A_i' A_i / sigma^2`` and nothing else. This package
knows no robot, no plan and no algorithm, and imports nothing from edtk.

    >>> import numpy as np, criteria
    >>> round(float(criteria.create("D").value(np.diag([4.0, 9.0]))), 12)
    6.0
"""

from criteria.criterion import Criterion, Sense
from criteria.registry import (
    CriterionError,
    DuplicateCriterionError,
    UnknownCriterionError,
    available,
    create,
    get,
    register,
)

__all__ = [
    "Criterion",
    "CriterionError",
    "DuplicateCriterionError",
    "Sense",
    "UnknownCriterionError",
    "available",
    "create",
    "get",
    "register",
]
