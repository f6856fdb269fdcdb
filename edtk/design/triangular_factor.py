"""The triangular factor of many rows, by a QR factorization that sees a part of them at a time."""

from collections.abc import Iterable

import numpy as np

from edtk.system.typing import Array

AT_ONCE = 2**18  # doubles per part: some megabytes beside millions of rows


def triangular_factor(parts: Iterable[Array], scale: Array) -> Array:
    """R (p, p), upper triangular, with ``R'R = sum of B'B``, where B are rows over `scale`.

    Squares of rows never occur, so that R has all digits of rows whose condition number is up to
    the inverse of a rounding; of ``B'B`` that is true up to its root only. Householder reflections
    are stable column by column, whatever their units.

    Args:
        parts: Rows (k, p), part by part.
        scale: Size (p,) of each column.
    """
    p = len(scale)
    R = np.zeros((0, p))
    step = max(AT_ONCE // p, 2 * p)
    for rows in parts:
        for start in range(0, len(rows), step):
            part = np.vstack([R, rows[start : start + step] / scale])
            R = np.asarray(np.linalg.qr(part, mode="r"))
    found = np.zeros((p, p))
    found[: len(R)] = R
    return found
