"""The bias of compliances that a linear model identifies from a robot at rest under load."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from edtk.inference.equilibrium_deflection import equilibrium_deflection
from edtk.inference.least_squares import estimate
from edtk.inference.whiten import AnyNoise
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.presented import Presented
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Bias(Presented):
    """Expected estimates where the linear model is fitted to a loaded equilibrium.

    Attributes:
        true: Compliances (p,) of the robot [rad/(N m)].
        expected: Mean (p,) of the estimates [rad/(N m)].
        covariance: Their covariance (p, p), Eq. (13).
    """

    true: Array
    expected: Array
    covariance: Array

    def headline(self) -> str:
        """The largest bias in standard deviations."""
        worst = self.in_std[np.abs(self.in_std).argmax()]
        return f"{len(self.true)} compliances, off by {worst:+.3g} standard deviations at most"

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
        """Bias (p,) in per cent of the true compliances; infinite where only the truth is zero."""
        # A joint that is rigid in truth has no percentage: infinite, unless its bias is zero too.
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.bias == 0, 0.0, 100 * self.bias / self.true)

    def in_pose(self, A: Array) -> float:
        """Length of the mean error ``|A (E(k_hat) - k)|`` after compensation in a pose [m].

        Squared, it adds to rho^2 of Eq. (17), which counts the noise alone.

        Args:
            A: Regressor (rows, p) of the pose [m/(rad/(N m))].
        """
        return float(np.linalg.norm(A @ self.bias))


def linearisation_bias(
    model: ElastostaticModel,
    q: Array,
    wrench: ArrayLike,
    sigma: AnyNoise,
    k: ArrayLike,
    known: Mapping[int, float] | None = None,
) -> Bias:
    """Fit the linear model, Eq. (9), to noise-free measurements of the loaded equilibrium.

    Least squares is linear in the measurements, so that the fit of their mean is the mean of the
    fits: no noise need be drawn.

    Args:
        model: The robot with its calibration tool.
        q: Poses (m, n), one a measurement [rad or m].
        wrench: Forces and torques (m, 6) or (6,) [N, N m].
        sigma: Noise, one number, one a row (rows,), or one a row of each measurement (m, rows)
            [m, rad]; or correlated noise.
        k: True compliances (n,) of all joints [rad/(N m)]. A joint that is not among the unknown
            ones bends too, and its part of the measurements is ascribed to the others, less what
            is known.
        known: Compliances of other joints that the fit takes as known, by their indices; none by
            default [rad/(N m)].

    Raises:
        SingularPlanError: The measurements do not identify all parameters.
        NoEquilibriumError: A pose buckles under the load.
    """
    k = np.asarray(k, dtype=float)
    # All joints bend in the measurements, those that the linear model takes as rigid too.
    measured = equilibrium_deflection(model, q, wrench, k)
    if known:
        others = replace(model, unknown=tuple(known))
        measured = measured - others.regressor(q, wrench) @ np.array(list(known.values()))
    fit = estimate(model.regressor(q, wrench), measured, sigma, model.parameters)
    return Bias(k[model.joints], fit.k, fit.covariance)
