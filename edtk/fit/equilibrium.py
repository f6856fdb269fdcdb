"""Compliances at the loaded equilibrium: fitted, linearised, and the bias of the linear model."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from edtk.fit.correlated_noise import AnyNoise
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import Whitened, estimate
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import LackOfFit
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest, torque_and_derivative
from edtk.robots.weights import Loading
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

MEASUREMENTS_AT_ONCE = 4096  # measurements at once; of 1e5, twice as fast as all of them at once
# Steps, in standard deviations: below the first the fit has converged, since the next step is
# smaller by the share of the deflection that is not linear, a hundredth or less.
CONVERGED = 1e-4
# Linearisations about the robust fit: it is near that of least squares, where the model is known.
ROBUST_STEPS = 2
# Gauss-Newton steps; three or four are the rule. More are needed where the arm is about to buckle.
GAUSS_NEWTON_STEPS = 30


def equilibrium_deflection(
    model: ElastostaticModel,
    q: ArrayLike,
    wrench: ArrayLike,
    k: ArrayLike,
) -> Array:
    """What instruments show of the motion from the unloaded pose to the loaded equilibrium.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        q: Joint variables (..., n) [rad or m].
        wrench: Forces and torques (..., 6) or (6,) at the tool point [N, N m].
        k: Compliances (..., n) or (n,) of all joints [rad/(N m)].

    Returns:
        Deflections (..., rows) [m, rad], one instrument after another.

    Raises:
        NoEquilibriumError: A pose buckles under the load.
    """
    rest = Rest.of(model, q, wrench, k)
    before = model.frames(rest.start)
    after = model.frames(rest.end)
    rows = [sensor.change(before, after) for sensor in model.whole_instruments]
    return np.moveaxis(np.concatenate(rows), 0, -1)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """``deflection(k) = constant + A k`` to the first order in k.

    Attributes:
        A: Derivatives (m, rows, p) of the deflections by the unknown compliances
            [m/(rad/(N m))].
        constant: Deflections (m, rows) less ``A k``, at the compliances of the linearisation
            [m, rad].
    """

    A: Array
    constant: Array


def linearise(model: ElastostaticModel, data: Measurements, k: Array) -> Linearisation:
    """Differentiate the deflections of a robot at rest under load by its compliances.

    The rest ``theta = diag(k) tau(q + theta)`` moves with compliance j by

        (I - diag(k) H) dtheta/dk_j = tau_j e_j,    H = dtau/dtheta,

    and a marker by its Jacobian in the loaded pose times that. A rotation vector r of the tool
    changes by ``J_l(r)^-1 w`` where the tool turns by w, with the left Jacobian of SO(3).

    At k = 0 this is the linear model, Eq. (4), with a constant of zero.

    Args:
        model: The robot with its calibration tool, the unknown joints, and the measured rows.
        data: Poses, loads and markers; measured values are not used.
        k: Compliances (n,) of all joints [rad/(N m)]. An estimate of a small one may be negative.

    Raises:
        NoEquilibriumError: A pose buckles under its load.
    """
    # Rows of one pose, such as its repetitions and its markers, share the equilibrium.
    if len(data) > MEASUREMENTS_AT_ONCE:
        # The arrays of very many poses would not fit into a core's cache, nor into a small memory.
        parts = [
            linearise(model, data[i : i + MEASUREMENTS_AT_ONCE], k)
            for i in range(0, len(data), MEASUREMENTS_AT_ONCE)
        ]
        A = np.concatenate([part.A for part in parts])
        return Linearisation(A, np.concatenate([part.constant for part in parts]))
    first = np.unique(data.pose, return_index=True)[1]
    wrench = data.wrench[first]
    rest = Rest.of(model, data.q[first], wrench, k, signed=True)
    end = np.moveaxis(_joint_derivative(model, rest.end, wrench, k, model.loading), 0, -1)
    start = np.zeros_like(end)
    if model.own_weights is not None:
        none = np.zeros_like(wrench)
        own = Loading(weights=model.own_weights)
        start = np.moveaxis(_joint_derivative(model, rest.start, none, k, own), 0, -1)
    before = model.frames(rest.start)
    after = model.frames(rest.end)
    A = np.empty((*data.deflection.shape, model.p))
    for rows, sensor in data.instruments(model):
        pose = data.pose[rows]
        poses = (before[pose], after[pose])
        derivative = sensor.change_derivative(*poses, start[..., pose], end[..., pose])
        A[rows] = np.moveaxis(derivative, -1, 0)
    return Linearisation(A, data.changes(model, rest) - A @ k[model.joints])


def _joint_derivative(
    model: ElastostaticModel, q: Array, wrench: Array, k: Array, loading: Loading
) -> Array:
    """``dtheta/dk`` (N, n, p) in loaded poses q (N, n)."""
    tau, H = torque_and_derivative(model.robot, q, wrench, loading)
    stiff = np.eye(model.robot.n) - k[:, None] * H
    loads = np.zeros((*tau.shape, model.p))
    loads[:, model.joints, np.arange(model.p)] = tau[:, model.joints]
    return np.asarray(np.linalg.solve(stiff, loads))


class NoFitError(ValueError):
    """The steps towards the best compliances do not settle."""

    def __str__(self) -> str:
        return f"the fit of the loaded equilibrium did not settle in {GAUSS_NEWTON_STEPS} steps"


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
    for _ in range(GAUSS_NEWTON_STEPS):
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


def fit_common_noise(
    data: LinearisedData, sigma: Array, group: Indices, found: LackOfFit, fit: Identification
) -> tuple[LinearisedData, Identification]:
    """Weight the means of repetitions by their own variance, and fit again.

    With a variance s^2 of each repetition and t^2 of what n repetitions share, in units of sigma,
    the mean has the variance ``s^2/n + t^2`` and the deviations from it s^2. So rows whose mean is
    shrunk by ``f = s / sqrt(s^2 + n t^2)``, ``(x - (1 - f) mean(x)) / s``, have independent errors
    of the stated sigma: generalised least squares with both variances estimated.

    Args:
        data: The linear model of the measurements.
        sigma: Noise (m, rows) [m, rad].
        group: Number (m,) of each row's group of repetitions, from 0.
        found: The two standard deviations.
        fit: The fit for independent errors.

    Returns:
        The model of rows with independent errors, and the fit: residuals are those of the measured
        rows, and intervals have the degrees of freedom of the groups' means.
    """
    count = np.bincount(group)
    s = found.pure_error
    shrink = s / np.sqrt(s**2 + count * found.common**2)

    def independent(x: Array) -> Array:
        """Rows (m, rows, ...) with independent errors."""
        scale = sigma.reshape(*sigma.shape, *(1,) * (x.ndim - 2))
        whitened = x / scale
        sums = np.zeros((len(count), *x.shape[1:]))
        np.add.at(sums, group, whitened)
        mean = (sums.T / count).T
        less = ((1 - shrink) * mean.T).T
        return (whitened - less[group]) * scale / s

    seen = LinearisedData(independent(data.A), independent(data.measured))
    again = identify(seen.A, seen.measured, sigma, fit.parameters)
    refit = replace(
        again,
        residual=data.measured - data.A @ again.unbounded,
        chi2=fit.chi2,
        p_value=fit.p_value,
        scale=fit.scale,
        covariance_dof=float(found.dof[0]),
        known=fit.known,
        too_few_for_robust=fit.too_few_for_robust,
    )
    return seen, refit


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
    # The linear model knows nothing of what compensators take: that is a part of its bias.
    model = replace(model, gives=None)
    # All joints bend in the measurements, those that the linear model takes as rigid too.
    measured = equilibrium_deflection(model, q, wrench, k)
    if known:
        others = replace(model, unknown=tuple(known))
        measured = measured - others.regressor(q, wrench) @ np.array(list(known.values()))
    fit = estimate(model.regressor(q, wrench), measured, sigma, model.parameters)
    return Bias(k[model.joints], fit.k, fit.covariance)
