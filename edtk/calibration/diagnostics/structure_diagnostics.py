"""Parameters that the measured poses cannot tell, however small the noise is."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.inference.least_squares import Whitened
from edtk.system.typing import Array

ALIKE = 0.99  # correlation above which two parameters are hardly told apart
MUCH_WIDER = 5.0  # growth of a standard deviation by which a parameter rests on a pose
UNKNOWN = 1e3  # growth of a standard deviation beyond which a parameter is as good as unknown
ROUNDING = 1e-12  # of eigenvalues that are one at most


def structure_diagnostics(
    fitted: FittedData, rho0_bias: float | None = None
) -> Iterator[Diagnostic]:
    """Name equal rows, parameters that are alike or rest on one pose, and a costly linear model.

    Args:
        fitted: The measurements and their fit.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    yield from _equal_rows(fitted)
    yield from _alike(fitted)
    yield from _alone(fitted)
    yield from _linear_model(fitted, rho0_bias)


def _equal_rows(fitted: FittedData) -> Iterator[Diagnostic]:
    """Equal rows that chance may have made; those that it did not are an input error."""
    found = fitted.equal_rows
    if found is not None:
        data = {"others": found.others, "chance": found.chance}
        finding = Finding(Kind.EQUAL_ROWS, (found.later, found.earlier), data=data)
        yield Diagnostic(Severity.NOTE, finding)


def _alike(fitted: FittedData) -> Iterator[Diagnostic]:
    """The two parameters that are hardest to tell apart."""
    fit = fitted.fit
    off = np.abs(fit.correlation - np.eye(len(fit.k)))
    if off.max() > ALIKE:
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        names = fitted.study.model.parameters
        data = {"correlation": float(fit.correlation[i, j])}
        finding = Finding(Kind.ALIKE_PARAMETERS, parameters=(names[j], names[i]), data=data)
        yield Diagnostic(Severity.WARNING, finding)


def _alone(fitted: FittedData) -> Iterator[Diagnostic]:
    """Parameters that would be unknown, or hardly known, without one of the poses.

    Few poses leave no other choice, and are what a plan of few poses asks for: it is a note. With
    ``G = Q'Q`` of a pose's rows the covariance is ``T T'``, and ``T (I - G)^-1 T'`` without the
    pose. Parameters that rest on the same poses are named together.
    """
    growth = _growth_without(fitted)
    resting: dict[tuple[int, ...], list[int]] = {}
    for i, of_parameter in enumerate(growth.T):
        poses = tuple(np.flatnonzero(of_parameter >= MUCH_WIDER**2).tolist())
        if poses:
            resting.setdefault(poses, []).append(i)
    names = fitted.study.model.parameters
    for poses, members in resting.items():
        rows = np.flatnonzero(np.isin(fitted.data.pose, poses))
        times = float(np.sqrt(growth[np.ix_(poses, members)].min()))
        data = {"poses": len(poses), "times": times, "unknown": times > UNKNOWN}
        named = tuple(names[i] for i in members)
        finding = Finding(Kind.ONE_POSE, tuple(rows.tolist()), parameters=named, data=data)
        yield Diagnostic(Severity.NOTE, finding)


def _growth_without(fitted: FittedData) -> Array:
    """Growth (poses, p) of each parameter's variance where one pose is left out; inf if unknown."""
    data = fitted.data
    parameters = fitted.study.model.parameters
    # The least eigenvalue of I - G is at least one minus the trace of G, the pose's leverage: of
    # most poses that shows that no variance grows by much.
    share = np.bincount(data.pose, fitted.fit.leverage.sum(axis=1))
    growth = np.ones((len(share), len(parameters)))
    suspects = np.flatnonzero(share > 1 - 1 / MUCH_WIDER**2)
    if fitted.untold or not len(suspects):
        return growth
    whitened = Whitened.of(fitted.A, fitted.noise, parameters)
    T = np.linalg.inv(whitened.R)
    for pose in suspects:
        Q = whitened.Q[data.pose == pose].reshape(-1, T.shape[1])
        left, V = np.linalg.eigh(np.eye(T.shape[1]) - Q.T @ Q)
        # An eigenvalue that is zero but for rounding stands for an infinite variance.
        growth[pose] = ((T @ V) ** 2 / np.maximum(left, ROUNDING)).sum(axis=1) / (T**2).sum(axis=1)
    return growth


def _linear_model(fitted: FittedData, rho0_bias: float | None) -> Iterator[Diagnostic]:
    """A linear model that costs more than the noise."""
    target = fitted.study.target
    if target is None or rho0_bias is None:
        return
    if rho0_bias > fitted.fit.accuracy(target)[0]:
        tasks = fitted.study.tasks
        place = {"place": tasks.place} if len(tasks) > 1 else {}
        finding = Finding(Kind.LINEAR_MODEL, data={"rho0_bias": rho0_bias, **place})
        yield Diagnostic(Severity.WARNING, finding)
