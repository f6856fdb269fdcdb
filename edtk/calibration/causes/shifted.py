"""Groups of rows that are off together."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.causes.cause import Cause
from edtk.calibration.causes.rarity import rarity, reading_rarity
from edtk.calibration.causes.tried import Tried
from edtk.inference.distributions import chi_square_tail
from edtk.inference.least_squares import Whitened
from edtk.system.typing import Array, Indices

SEEN = 1e-9  # share of a shift's information that residuals show, below which it is rounding


def shifted(
    whitened: Whitened,
    measured: Array,
    chi2: float,
    group: Indices,
    cause: str,
    usual: Array,
    units: Array | None = None,
) -> Iterator[Tried]:
    """Try each group of rows, such as a pose with all its repetitions, as shifted by a constant.

    Args:
        whitened: The factored regressors of the measurements.
        measured: Deflections (m, rows) [m, rad].
        chi2: Sum of squares without a shift.
        group: Number (m,) of each row's group.
        cause: Name of such a fault.
        usual: Sizes (c,) that the parts of a shift usually have [m, rad].
        units: What each unit of the shift adds to the measurements (m, rows, c); defaults to a unit
            of each coordinate.
    """
    residual = whitened.residual(measured)
    numbers = np.unique(group)
    for number in numbers:
        at = np.flatnonzero(group == number)
        seen_in, shift = whitened.shift(at, units)
        onto = np.einsum("mrp,mrs->ps", whitened.Q[seen_in], shift)
        gram = np.einsum("mrs,mrt->st", shift, shift) - onto.T @ onto
        along = np.einsum("mrs,mr->s", shift, residual[seen_in])
        values, vectors = np.linalg.eigh(gram)
        seen = values > SEEN * np.trace(gram)
        parts = vectors.T @ along
        drop = float((parts[seen] ** 2 / values[seen]).sum())
        dims = int(seen.sum())
        p = float(chi_square_tail(drop, max(dims, 1)))
        c = vectors[:, seen] @ (parts[seen] / values[seen])
        size = 1e3 * float(np.linalg.norm(c[:3]))
        found = Cause(cause, size, "mm", None, p, rows=tuple(at.tolist()))
        cost = None
        if dims == len(usual):
            own = np.linalg.inv(gram) / np.outer(usual, usual)
            cost_of = rarity if len(at) > 1 else reading_rarity
            cost = cost_of(c / usual, own, float(np.sqrt(dims)))
        yield Tried(found, chi2 - drop, dims, len(numbers), cost)
