"""Compliances fitted to the loaded equilibrium, of which the linear model is the first order."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.identification import Identification
from edtk.inference.identify import identify
from edtk.inference.least_squares import Whitened
from edtk.inference.linearise import Linearisation, linearise
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

# Steps, in standard deviations: below the first the fit has converged, since the next step is
# smaller by the share of the deflection that is not linear, a hundredth or less.
CONVERGED = 1e-4
# Linearisations about the robust fit: it is near that of least squares, where the model is known.
ROBUST_STEPS = 2
# Gauss-Newton steps; three or four are the rule. More are needed where the arm is about to buckle.
ITERATIONS = 30


class NoFitError(ValueError):
    """The steps towards the best compliances do not settle."""

    def __str__(self) -> str:
        return f"the fit of the loaded equilibrium did not settle in {ITERATIONS} steps"


@dataclass(frozen=True, eq=False)
class LinearisedData:
    """Measurements as a linear model sees them that is exact about one estimate.

    Attributes:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) less the constant of the linearisation [m, rad], so that
            the model is ``measured = A k``.
    """

    A: Array
    measured: Array

    @classmethod
    def of(cls, data: Measurements, linear: Linearisation) -> "LinearisedData":
        """Take the constant of the linearisation from the measured deflections."""
        return cls(linear.A, data.deflection - linear.constant)


def fit_equilibrium(
    model: ElastostaticModel,
    data: Measurements,
    start: Array,
    robust: bool = False,
    known: bool = True,
) -> tuple[LinearisedData, Identification]:
    """Minimise ``sum |dp_i - d_i(k)|^2 / sigma^2`` over k, with the deflections d_i at rest.

    Gauss-Newton: in each step the deflections are linearised about the estimate, and the linear
    least-squares problem is solved. At the minimum its statistics, covariance and leverage are
    those of the nonlinear fit to the first order, and its regressors serve a robust fit or a
    sampled posterior as those of the linear model would.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        start: Compliances (n,) of all joints: those of the unknown ones are a first estimate
            [rad/(N m)].
        robust: Huber's loss instead of squares.
        known: Whether sigma is believed, or a common factor of it is estimated.

    Returns:
        The measurements as the linear model about the estimate sees them, and the fit.

    Raises:
        NoEquilibriumError: The arm buckles in a pose.
        SingularPlanError: The measurements do not identify all parameters.
        NothingLeftError: No residuals remain to estimate sigma from.
        SigmaTooSmallError: Robust, and no residual is as small as sigma says.
        NoFitError: The steps do not settle.
    """
    k = start.copy()
    joints = model.joints
    for _ in range(ITERATIONS):
        linearised = LinearisedData.of(data, linearise(model, data, k))
        whitened = Whitened.of(linearised.A, data.noise, model.parameters)
        estimate = whitened.solve(linearised.measured)
        step = (estimate - k[joints]) / np.sqrt(np.diag(whitened.covariance))
        k[joints] = estimate
        if np.abs(step).max() < CONVERGED:
            break
    else:
        raise NoFitError
    fit = _identified(model, data, linearised, False, known)
    if not robust:
        return linearised, fit
    for _ in range(ROBUST_STEPS):
        fit = _identified(model, data, linearised, True, known)
        k[joints] = fit.unbounded
        linearised = LinearisedData.of(data, linearise(model, data, k))
    return linearised, _identified(model, data, linearised, True, known)


def _identified(
    model: ElastostaticModel,
    data: Measurements,
    linearised: LinearisedData,
    robust: bool,
    known: bool,
) -> Identification:
    """The fit of linearised measurements, with everything that the residuals say."""
    return identify(linearised.A, linearised.measured, data.noise, model.parameters, robust, known)
