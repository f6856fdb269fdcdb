"""The covariance of a plan's estimates, as far as the study needs it."""

import numpy as np

import criteria
from criteria.linalg.estimable import estimable_inverse, open_columns
from edtk.inference.least_squares import SingularPlanError, covariance
from edtk.study.study import Study
from edtk.system.typing import Array


class OpenInterestError(SingularPlanError):
    """A plan cannot identify what is of interest."""

    def __str__(self) -> str:
        return f"the plan cannot identify {' or '.join(self.parameters)}, which is of interest"


def plan_covariance(study: Study, M: Array) -> Array:
    """Covariance (p, p) of the compliances, Eq. (13), under the information M (p, p) of a plan.

    Where only some compliances are of interest, the plan may leave others open. These have infinite
    variances, and their covariances are no numbers.

    Raises:
        SingularPlanError: All compliances are of interest, and the plan cannot identify them.
        OpenInterestError: The plan cannot identify what is of interest; names it.
    """
    names = study.model.parameters
    if study.interest is None:
        return covariance(M, names)
    try:
        return covariance(M, names)
    except SingularPlanError:
        missing = criteria.create("A", interest=study.interest).missing(M, names)
        if missing:
            raise OpenInterestError(tuple(missing)) from None
    everything = np.eye(len(M))
    is_open = open_columns(M, everything)
    cov = estimable_inverse(M, everything[:, ~is_open])[1].copy()
    cov[is_open] = np.nan
    cov[:, is_open] = np.nan
    cov[is_open, is_open] = np.inf
    return cov
