"""How accurate a compensation is, from the covariance of its compliances."""

import numpy as np

from edtk.system.typing import Array


def compensation_accuracy(A: Array, cov: Array) -> Array:
    """Eq. (17), the accuracy after compensation; Eq. (20) for the A0 of the test pose.

    ``rho = sqrt(E(dk' A' A dk)) = sqrt(trace(A cov A'))``.

    Args:
        A: Regressors (..., rows, p) of the task poses.
        cov: Covariance (p, p) of the compliances.

    Returns:
        Root mean square position error (...) [m].
    """
    return np.sqrt(np.einsum("...ri,ij,...rj->...", A, cov, A))
