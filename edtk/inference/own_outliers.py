"""Which of several outliers are so by themselves."""

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.inference.find_outliers import find_outliers
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.system.typing import Array, Indices

MOST = 20  # outliers that are looked at one by one; more are a matter of the noise or the model


def own_outliers(
    A: Array,
    measured: Array,
    noise: CorrelatedNoise,
    parameters: tuple[str, ...],
    found: Indices,
) -> Indices:
    """Of the outliers of a fit with correlated noise, those that are no others' neighbours.

    Readings of a visit tell each other's errors. Where one is off, the others seem to be off as
    well, each of which could be left out to make the rest agree better. So each is tested once more
    beside readings that are no outliers alone.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        noise: Their noise.
        parameters: Names (p,).
        found: Rows that are outliers with all others there.

    Returns:
        Those of these rows; all of them where none is an outlier without the others.
    """
    if not 1 < len(found) <= MOST:
        return found
    others = np.setdiff1d(np.arange(len(A)), found)
    own = []
    for row in found:
        rows = np.sort(np.append(others, row))
        try:
            whitened = Whitened.of(A[rows], noise[rows], parameters)
        except SingularPlanError:
            return found
        z = whitened.residual(measured[rows])
        dof = z.size - A.shape[-1]
        again = find_outliers(*whitened.deletable(z), dof, total=float((z**2).sum()))
        if row in rows[again]:
            own.append(row)
    return np.array(own) if own else found
