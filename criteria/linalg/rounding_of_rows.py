"""What rounding of rows makes of the variances that they combine."""

import numpy as np

from criteria.linalg.inverse import EPS
from criteria.linalg.typing import Array


def rounding_of_rows(rows: Array, W: Array) -> float:
    """Bound the relative error of ``sum_j |a_j W|^2`` where products of a_j and W cancel.

    A product of p terms is wrong by ``p eps`` times the sum of their sizes; with ``|w_i|`` the
    length of a row of W, ``|a_j W|`` is wrong by ``p eps sum_i |a_ji| |w_i|`` at most.

    Args:
        rows: Rows a_j (k, p).
        W: Matrix (p, r), such as a root of a covariance.
    """
    lengths = np.linalg.norm(rows @ W, axis=1)
    sizes = np.abs(rows) @ np.linalg.norm(W, axis=1)
    total = float(lengths @ lengths)
    return float(2 * rows.shape[1] * EPS * (lengths @ sizes) / total) if total > 0 else 0.0
