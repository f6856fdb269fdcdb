"""Parameters that the measured poses cannot tell, however small the noise is."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.inference.least_squares import Whitened

ALIKE = 0.99  # correlation above which two parameters are hardly told apart
ALONE = 0.05  # share of an error in one pose that the residuals show, below which it is named
UNSEEN = 0.005  # the same, below which it is worth a warning
MUCH_WIDER = 4.0  # growth of a variance without a pose by which a parameter rests on that pose


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
    """Parameters that rest on one pose.

    With G = Q'Q of a pose's rows, the least eigenvalue of I - G is the share of an error in that
    pose that residuals show; without the pose the covariance is ``T (I - G)^-1 T'`` where it is
    ``T T'`` with the pose.
    """
    data = fitted.data
    parameters = fitted.study.model.parameters
    # The least eigenvalue of I - G is at least one minus the trace of G, the pose's leverage.
    share = np.bincount(data.pose, fitted.fit.leverage.sum(axis=1))
    suspects = np.flatnonzero(share > 1 - ALONE)
    if not len(suspects):
        return
    whitened = Whitened.of(fitted.A, data.sigma, parameters)
    T = np.linalg.inv(whitened.R)
    for pose in suspects:
        rows = np.flatnonzero(data.pose == pose)
        Q = whitened.Q[rows].reshape(-1, T.shape[1])
        left, V = np.linalg.eigh(np.eye(T.shape[1]) - Q.T @ Q)
        if left[0] < ALONE:
            # An eigenvalue that is zero but for rounding stands for an infinite variance.
            without = ((T @ V) ** 2 / np.maximum(left, 1e-12)).sum(axis=1)
            growth = without / (T**2).sum(axis=1)
            resting = growth >= min(MUCH_WIDER, growth.max())
            names = tuple(np.array(parameters)[resting].tolist())
            severity = Severity.WARNING if left[0] < UNSEEN else Severity.NOTE
            finding = Finding(Kind.ONE_POSE, tuple(rows.tolist()), parameters=names)
            yield Diagnostic(severity, finding)


def _linear_model(fitted: FittedData, rho0_bias: float | None) -> Iterator[Diagnostic]:
    """A linear model that costs more than the noise."""
    target = fitted.study.target
    if target is None or rho0_bias is None:
        return
    if rho0_bias > fitted.fit.accuracy(target)[0]:
        finding = Finding(Kind.LINEAR_MODEL, data={"rho0_bias": rho0_bias})
        yield Diagnostic(Severity.WARNING, finding)
