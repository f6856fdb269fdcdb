"""The least error with which a study measures a length."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects

COORDINATES = 3  # of the first marker; or a distance, in any number of rows


def least_error(study: "StudyObjects", q: Array) -> float:
    """The least standard deviation of a coordinate of the first marker in any of some poses [m].

    Args:
        study: The study.
        q: Poses (s, n) [rad or m]; they do not matter where noise is white.
    """
    if study.noise is None:
        return float(study.sigma[0])
    Sigma = study.noise.covariance_of(study.model, study.model.frames(q))
    return float(np.sqrt(np.einsum("rrk->rk", Sigma)[:COORDINATES].min()))
