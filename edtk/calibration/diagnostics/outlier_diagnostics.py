"""Rows that do not belong to the others."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.causes.find_causes import UNEXPLAINED
from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.inference.identification import Identification
from edtk.inference.identify import INTERPOLATED, identify
from edtk.inference.least_squares import SingularPlanError

TOO_MANY = 3  # of so many rows one outlier is the most for a result that can be used


def outlier_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name the outliers, and say whether the rest fits, or whether there are too many of them."""
    fit = fitted.fit
    if fit.too_few_for_robust:
        numbers = {
            "coordinates": fit.residual.size,
            "parameters": len(fit.k),
            "needed": INTERPOLATED * len(fit.k),
        }
        yield Diagnostic(Severity.WARNING, Finding(Kind.TOO_FEW_FOR_ROBUST, data=numbers))
    if not len(fit.outliers):
        return
    too_many = TOO_MANY * len(fit.outliers) > len(fit.residual)
    severity = Severity.ALARM if too_many else Severity.WARNING
    rows = tuple(fit.outliers.tolist())
    rest = _rest(fitted)
    p_rest = None if rest is None else rest.p_value
    if fitted.found_causes.unexplained and p_rest is not None and p_rest < UNEXPLAINED:
        return  # the model does not fit the other rows either
    data = {
        "robust": fit.robust,
        "p_rest": p_rest,
        "off": None if rest is None else _off(fitted, rest),
    }
    yield Diagnostic(severity, Finding(Kind.OUTLIERS, rows, data=data))


def _rest(fitted: FittedData) -> Identification | None:
    """The fit of the other rows alone; None where it cannot tell whether they fit."""
    fit = fitted.fit
    if not fit.known or fit.robust:
        return None
    rest = np.delete(np.arange(len(fitted.data)), fit.outliers)
    noise = fitted.noise[rest]
    try:
        return identify(fitted.A[rest], fitted.measured[rest], noise, fit.parameters)
    except SingularPlanError:
        return None


def _off(fitted: FittedData, rest: Identification) -> float | None:
    """By how much outliers are off what the other rows predict, at most [m]; None for rotations."""
    rows = fitted.fit.outliers
    lengths = fitted.data.lengths[rows]
    off = fitted.as_linear[rows] - fitted.linear_regressor[rows] @ rest.unbounded
    size = np.linalg.norm(np.where(lengths, off, 0.0), axis=1)
    return float(size.max()) if lengths.any(axis=1).all() else None
