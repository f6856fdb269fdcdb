"""The error of a compensation in the test pose, by a posterior of the compliances."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.inference.convergence import autocorrelation_time
from edtk.inference.least_squares import Estimate
from edtk.inference.posterior import Posterior
from edtk.system.presented import Presented
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class PoseError(Presented):
    """The error after compensation with the least-squares estimate, by the posterior [m].

    Attributes:
        rho0: ``sqrt(E |A0 (k - k_hat)|^2)``.
        rho0_error: Its Monte-Carlo standard error.
        rho0_fit: ``sqrt(trace(A0 cov A0'))``, Eq. (20), with the covariance of the fit.
        error_95: Length that ``|A0 (k - k_hat)|`` does not exceed with a probability of 95 %.
        displacement: Mean of the displacement ``A0 k`` under the task's load (3,).
        displacement_95: Ends of its 95 % intervals, by coordinate (2, 3).
    """

    rho0: float
    rho0_error: float
    rho0_fit: float
    error_95: float
    displacement: Array
    displacement_95: Array

    def headline(self) -> str:
        """The error after compensation."""
        return f"rho0 = {1e3 * self.rho0:.4g} mm in the test pose"

    def to_dict(self) -> dict[str, Any]:
        """Plain data [m]."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
        }


def pose_error(A0: Array, fit: Estimate, posterior: Posterior) -> PoseError:
    """Find errors and displacements in a pose.

    Args:
        A0: Regressor (3, p) of the pose [m/(rad/(N m))].
        fit: The estimate with which commands are compensated.
        posterior: The compliances that the robot may have.
    """
    squares = (((posterior.samples - fit.k) @ A0.T) ** 2).sum(axis=-1)
    rho0 = float(np.sqrt(squares.mean()))
    effective = squares.size / autocorrelation_time(squares[..., None])[0]
    moved = posterior.samples @ A0.T
    return PoseError(
        rho0=rho0,
        # The error of a mean of squares; of its root it is half that, relative to the root.
        rho0_error=float(squares.std() / np.sqrt(effective) / (2 * rho0)),
        rho0_fit=float(np.sqrt(np.trace(A0 @ fit.covariance @ A0.T))),
        error_95=float(np.sqrt(np.quantile(squares, 0.95))),
        displacement=moved.mean(axis=(0, 1)),
        displacement_95=np.quantile(moved, [0.025, 0.975], axis=(0, 1)),
    )
