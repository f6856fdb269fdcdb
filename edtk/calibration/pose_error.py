"""The error of a compensation in the test poses, by a posterior of the compliances."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.inference.convergence import autocorrelation_time
from edtk.inference.least_squares import Estimate
from edtk.inference.posterior import Posterior
from edtk.model.tasks import Tasks
from edtk.system.presented import Presented
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class PoseError(Presented):
    """The error after compensation with the least-squares estimate, by the posterior [m].

    A0 is the target of rho0: the test pose's regressor, unless a neighbourhood or rotations count
    too.

    Attributes:
        rho0: ``sqrt(E |A0 (k - k_hat)|^2)``.
        rho0_error: Its Monte-Carlo standard error.
        rho0_fit: ``sqrt(trace(A0 cov A0'))``, Eq. (20), with the covariance of the fit.
        error_95: Length that ``|A0 (k - k_hat)|`` does not exceed with a probability of 95 %.
        displacement: Mean of the displacement of the tool point under the task's load (3,).
        displacement_95: Ends of its 95 % intervals, by coordinate (2, 3).
        place: Where rho0 is the error, in words.
        displaced: Which of several test poses the displacement is of, counted from 1: the one with
            the largest error; None for a single one.
    """

    rho0: float
    rho0_error: float
    rho0_fit: float
    error_95: float
    displacement: Array
    displacement_95: Array
    place: str = "in the test pose"
    displaced: int | None = None

    def headline(self) -> str:
        """The error after compensation."""
        return f"rho0 = {1e3 * self.rho0:.4g} mm {self.place}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data [m]."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
            if name != "displaced" or value is not None
        }


def pose_error(tasks: Tasks, fit: Estimate, posterior: Posterior) -> PoseError:
    """Find errors and displacements in the test poses.

    Args:
        tasks: The test poses. Their target says what counts as the error, the regressor of the
            worst of them how the tool point is displaced.
        fit: The estimate with which commands are compensated.
        posterior: The compliances that the robot may have.
    """
    target = tasks.target
    squares = (((posterior.samples - fit.k) @ target.T) ** 2).sum(axis=-1)
    rho0 = float(np.sqrt(squares.mean()))
    effective = squares.size / autocorrelation_time(squares[..., None])[0]
    dk = (posterior.samples - fit.k).reshape(-1, len(fit.k))
    second_moment = dk.T @ dk / len(dk)
    worst = int(np.argmax([np.sum((A @ second_moment) * A) for A in tasks.targets]))
    moved = posterior.samples @ tasks[worst].regressor.T
    return PoseError(
        rho0=rho0,
        # The error of a mean of squares; of its root it is half that, relative to the root.
        rho0_error=float(squares.std() / np.sqrt(effective) / (2 * rho0)),
        rho0_fit=float(np.sqrt(np.trace(target @ fit.covariance @ target.T))),
        error_95=float(np.sqrt(np.quantile(squares, 0.95))),
        displacement=moved.mean(axis=(0, 1)),
        displacement_95=np.quantile(moved, [0.025, 0.975], axis=(0, 1)),
        place=tasks.place,
        displaced=worst + 1 if len(tasks) > 1 else None,
    )
