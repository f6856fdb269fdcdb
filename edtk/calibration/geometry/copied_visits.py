"""Positions that were copied instead of measured: whole visits, and columns of a marker."""

from pathlib import Path

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.equal_rows import resolution
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt
from edtk.inference.distributions import poisson_tail
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.errors import UserError
from edtk.system.typing import Indices

CHANCE = 1e-3  # probability of equal visits up to which they are copies
SAME = 1e-7  # [m] two markers as near are one: the last digit of any instrument is larger
FEWEST = 2  # visits that two markers share


def refuse_copied_visits(data: MarkerPositions, sigma: float, path: Path) -> None:
    """Refuse a sheet in which visits of a pose are the same to the last digit.

    Two readings of a coordinate with the standard deviation sigma and the resolution d agree with
    the probability ``d / (2 sqrt(pi) sigma)`` at most; the number of visits that agree in all
    coordinates is about Poisson's. Readings that are as coarse as that may agree by chance.

    Args:
        data: All visits.
        sigma: Standard deviation of a reading [m].
        path: The sheet, for the message.

    Raises:
        UserError: More visits agree than chance explains.
    """
    x = np.nan_to_num(data.measured.reshape(len(data), -1), nan=-1.0)
    seen = data.seen.any(axis=1)
    _, first, number = np.unique(
        np.column_stack([data.pose, x]), axis=0, return_index=True, return_inverse=True
    )
    earlier = first[number.reshape(-1)]
    copies = np.flatnonzero(seen & (earlier != np.arange(len(data))))
    if not len(copies):
        return
    step = resolution(1e3 * data.measured[data.seen]) / 1e3
    agree = min(step / (2 * np.sqrt(np.pi) * sigma), 1.0) ** (3 * data.seen.sum(axis=1).min())
    expected = float(_pairs(data.pose) * agree)
    if float(poisson_tail(len(copies) - 1, expected)) > CHANCE:
        return
    later = copies[0]
    rows = [
        int(data.row[visit][data.row[visit] >= 0].min()) + 1 for visit in (later, earlier[later])
    ]
    more = len(copies) - 1
    others = (
        f", and {more} more visit{'s have' if more > 1 else ' has'} such a twin" if more else ""
    )
    raise UserError(
        f"row {rows[0]} is row {rows[1]} to the last digit, in all columns{others}; expected "
        "measurements anew",
        where=path,
    )


def _pairs(number: Indices) -> float:
    """How many pairs have the same number."""
    counts = np.bincount(number)
    return float((counts * (counts - 1) / 2).sum())


def without_copied_markers(
    data: MarkerPositions,
) -> tuple[MarkerPositions, list[GeometricDoubt]]:
    """The positions without markers that are where another one is, in all rows.

    Two reflectors are never at one place: the columns of one were copied, and would count twice.

    Args:
        data: Positions of the markers on the tool.
    """
    doubts = []
    copied: list[int] = []
    for j in range(len(data.markers)):
        for i in range(j):
            both = data.seen[:, i] & data.seen[:, j]
            if i in copied or both.sum() < FEWEST:
                continue
            apart = np.abs(data.measured[both, i] - data.measured[both, j]).max()
            if apart > SAME:
                continue
            one, other = data.markers[i], data.markers[j]
            text = (
                f"markers {one} and {other} are at the same place in all {both.sum()} visits: were "
                f"columns copied? {other} does not count"
            )
            doubts.append(GeometricDoubt(Severity.WARNING, "equal_markers", text))
            copied.append(j)
            break
    if not copied:
        return data, []
    return data.of_markers([i for i in range(len(data.markers)) if i not in copied]), doubts
