"""What the linear model costs: the bias of compliances that are identified from a robot at rest under load."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from edtk.inference.least_squares import estimate
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bias:
    """Expected estimates, where measurements come from the loaded equilibrium and the linear model is fitted.

    Attributes:
        true: Compliances (p,) of the robot [rad/(N m)].
        expected: Mean (p,) of the estimates [rad/(N m)].
        covariance: Their covariance (p, p), Eq. (13).
    """

    true: Array
    expected: Array
    covariance: Array

    @property
    def bias(self) -> Array:
        """``E(k_hat) - k`` (p,) [rad/(N m)]."""
        return self.expected - self.true

    @property
    def std(self) -> Array:
        """Standard deviations (p,) of the estimates [rad/(N m)]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def in_std(self) -> Array:
        """Bias (p,) in standard deviations."""
        return self.bias / self.std

    @property
    def percent(self) -> Array:
        """Bias (p,) in per cent of the true compliances; infinite where one is zero and its bias is not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.bias == 0, 0.0, 100 * self.bias / self.true)

    def in_pose(self, A: Array) -> float:
        """Length of the mean error ``|A (E(k_hat) - k)|`` after compensation in the pose of regressor A (rows, p) [m].

        Squared, it adds to rho^2 of Eq. (17), which counts the noise alone.
        """
        return float(np.linalg.norm(A @ self.bias))


def equilibrium_deflection(
    model: ElastostaticModel,
    q: ArrayLike,
    wrench: ArrayLike,
    k: ArrayLike,
    marker: ArrayLike = (0.0, 0.0, 0.0),
) -> Array:
    """What is measured without noise: the motion (..., rows) of the tool, or of a marker on it, under load [m, rad].

    The tool turns by R, so that a marker at an offset o from the tool point moves by ``d + (R - I) o``.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        q: Joint variables (..., n) [rad or m].
        wrench: Forces and torques (..., 6) or (6,) at the tool point [N, N m].
        k: Compliances (..., n) or (n,) of all joints [rad/(N m)].
        marker: Offsets (..., 3) or (3,) from the tool point, in the tool frame [m].

    Raises:
        NoEquilibriumError: A pose buckles under the load.
    """
    return marker_motion(model, q, equilibrium(model.robot, q, wrench, k).displacement, marker)


def marker_motion(model: ElastostaticModel, q: ArrayLike, moved: Array, marker: ArrayLike) -> Array:
    """Motion (..., rows) of markers on a tool that moves by a displacement and a rotation vector (..., 6) [m, rad].

    Args:
        model: The robot with its calibration tool, and the measured rows.
        q: Joint variables (..., n) without load [rad or m].
        moved: Motion of the tool (..., 6), in world axes.
        marker: Offsets (..., 3) or (3,) from the tool point, in the tool frame [m].
    """
    marker = np.asarray(marker, dtype=float)
    if marker.any():
        at = np.broadcast_to(model.robot.forward(q)[..., :3, :3], (*moved.shape[:-1], 3, 3))
        offset = (at @ marker[..., None])[..., 0].reshape(-1, 3)
        swing = Rotation.from_rotvec(moved[..., 3:].reshape(-1, 3)).apply(offset) - offset
        moved = moved + np.concatenate([swing, np.zeros_like(swing)], axis=-1).reshape(moved.shape)
    return moved[..., :3] if model.rows == "position" else moved


def linearisation_bias(
    model: ElastostaticModel, q: Array, wrench: ArrayLike, sigma: ArrayLike, k: ArrayLike
) -> Bias:
    """Fit the linear model, Eq. (9), to noise-free measurements of the loaded equilibrium.

    Least squares is linear in the measurements, so that what it makes of their mean is the mean of what it makes
    of them: no noise need be drawn.

    Args:
        model: The robot with its calibration tool.
        q: Poses (m, n), one a measurement [rad or m].
        wrench: Forces and torques (m, 6) or (6,) [N, N m].
        sigma: Noise, one number or one per row (rows,) [m, rad].
        k: True compliances (n,) of all joints [rad/(N m)]; one of a joint that is not among the unknown ones makes the
            robot bend, and its part of the measurements is ascribed to the others.

    Raises:
        SingularPlanError: The measurements do not identify all parameters; names them.
        NoEquilibriumError: A pose buckles under the load.
    """
    k = np.asarray(k, dtype=float)
    measured = equilibrium_deflection(model, q, wrench, k)
    fit = estimate(model.regressor(q, wrench), measured, sigma, model.parameters)
    return Bias(k[model.joints], fit.k, fit.covariance)
