"""Optimality criteria, each in a file of its own: they say how good an information matrix is.

A criterion is a function of the (p, p) information matrix ``M = sum A_i' A_i / sigma^2`` alone.
This package knows no robot, no plan and no algorithm, and imports nothing from edtk.

    >>> import numpy as np, criteria
    >>> round(float(criteria.create("D").value(np.diag([4.0, 9.0]))), 12)
    6.0
"""

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import Criterion, Sense
from criteria.errors import (
    CriterionError,
    DuplicateCriterionError,
    MissingTargetError,
    UnknownCriterionError,
)
from criteria.interest import Interest
from criteria.power_criterion import PowerCriterion
from criteria.registry import (
    as_criterion,
    available,
    create,
    families,
    from_dict,
    get,
    load_all,
    parameters_of,
    register,
)
from criteria.relaxable import Relaxable

__all__ = [
    "ConvexCriterion",
    "Criterion",
    "CriterionError",
    "DuplicateCriterionError",
    "Interest",
    "MissingTargetError",
    "PowerCriterion",
    "Relaxable",
    "Sense",
    "UnknownCriterionError",
    "as_criterion",
    "available",
    "create",
    "families",
    "from_dict",
    "get",
    "load_all",
    "parameters_of",
    "register",
]
