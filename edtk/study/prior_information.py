"""What a study knows of its compliances before the measurements, as information."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.study.study_prior import study_prior
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study import Study


def prior_information(study: "Study") -> Array | None:
    """The precision of the Gaussian near the study's prior, which is added to that of a plan.

    An earlier calibration has the inverse of its covariance; a half-normal density of scale s has
    ``1/s^2``, and a log-normal one of median m and factor f has ``1/(m log f)^2``.

    Returns:
        Information (p, p); None unless `[prior] in_design` is set.

    Raises:
        UserError: The prior is not one, or says nothing.
    """
    if not study.specification.prior.in_design:
        return None
    precision, _ = study_prior(study).gaussian()
    if not np.asarray(precision).any():
        message = (
            "the prior says nothing about any compliance; expected an earlier calibration, or "
            "densities that are not flat"
        )
        raise study.error("prior.in_design", message)
    return precision
