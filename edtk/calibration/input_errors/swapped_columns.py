"""Columns that fit much better if they are read otherwise."""

import numpy as np

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.input_errors.readings import readings
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array

BY_FAR = -3.0  # standard deviations below zero that no compliance can have
SUSPECT = 3.0  # residuals over sigma beyond which other readings of the columns are tried
LEAST_FREEDOM = 5  # degrees of freedom from which residuals tell a good reading from a bad one
BETTER = 4.0  # factor by which such a reading must reduce the residuals
AS_GOOD = 1.2  # factor within which the likeliest reading is taken instead of the best one
ENOUGH = 1000  # rows on which readings are compared


def swapped_columns(fitted: FittedData) -> Finding | None:
    """Find columns that fit much better otherwise, or make every compliance negative by far."""
    fit = fitted.fit
    if (fit.unbounded < BY_FAR * fit.std).all():
        return Finding(Kind.WRONG_SIGN)
    if fit.dof < LEAST_FREEDOM or not fit.scale > SUSPECT:
        return None
    data, A = _some_rows(fitted)
    whitened = _whitened(fitted.study, data, A)
    before = _size(data, A, whitened, bounded=False)
    found = []
    for finding, other in readings(fitted.study, data):
        if _same_regressors(data, other):
            size = _size(other, A, whitened)
        else:
            other_A = other.regressor(fitted.study.model)
            size = _size(other, other_A, _whitened(fitted.study, other, other_A))
        found.append((finding, size))
    best = min(size for _, size in found)
    if not best * BETTER <= before < np.inf:
        return None
    # Readings come with the likeliest first, and several may be about as good.
    finding, after = next((finding, size) for finding, size in found if size <= AS_GOOD * best)
    numbers = {"before": before, "after": after}
    return Finding(finding.kind, columns=finding.columns, data={**finding.data, **numbers})


def _some_rows(fitted: FittedData) -> tuple[Measurements, Array]:
    """The measurements with their regressors; of very many, some."""
    data = fitted.data
    if len(data) <= ENOUGH:
        return data, fitted.A
    # By chance, as every second row may be of the same pose.
    rows = np.sort(np.random.default_rng(0).choice(len(data), ENOUGH, replace=False))
    return data[rows], fitted.A[rows]


def _same_regressors(data: Measurements, other: Measurements) -> bool:
    """Whether a reading leaves poses, loads and markers as they are."""
    return other.q is data.q and other.wrench is data.wrench and other.marker is data.marker


def _whitened(study: Study, data: Measurements, A: Array) -> Whitened | None:
    """The least-squares problem; None where it leaves compliances open."""
    try:
        return Whitened.of(A, data.sigma, study.model.parameters)
    except SingularPlanError:
        return None


def _size(data: Measurements, A: Array, whitened: Whitened | None, bounded: bool = True) -> float:
    """Residuals in units of sigma, root mean square.

    Args:
        data: The measurements.
        A: Their regressors (m, rows, p).
        whitened: Their least-squares problem; None where it leaves compliances open.
        bounded: Whether compliances may not be negative by far.

    Returns:
        The size; inf where compliances are open, or negative by far if bounded.
    """
    if whitened is None:
        return np.inf
    k = whitened.solve(data.deflection)
    z = (data.deflection - A @ k) * whitened.weight
    size = float(np.sqrt((z**2).sum() / max(z.size - len(k), 1)))
    if not bounded:
        return size
    std = max(size, 1.0) * np.sqrt(np.diag(whitened.covariance))
    return np.inf if (k < BY_FAR * std).any() else size
