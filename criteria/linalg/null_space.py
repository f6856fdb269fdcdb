"""Directions of the parameters that an information matrix does not excite."""

import numpy as np

from criteria.linalg.combination import combination
from criteria.linalg.inverse import ROUNDING
from criteria.linalg.root import unit_scale
from criteria.linalg.typing import Array

SMALL = 1e-6  # entries below it are rounding of the echelon form, whose largest entries are one


def null_space(M: Array) -> tuple[Array, Array]:
    """Directions that M (p, p) does not excite, whatever the units of the parameters.

    Returns:
        ``(N, d)``: the directions (p, r) in echelon form, few parameters each, in the scaled
        parameters ``d_i k_i``, and the scales d (p,).
    """
    d = unit_scale(np.diag(M))
    r, V = np.linalg.eigh(M / np.outer(d, d))
    return _echelon(V[:, r <= len(M) * ROUNDING * max(r[-1], 1.0)]), d


def _echelon(N: Array) -> Array:
    """A basis (p, r) of the space of the columns of N, each of few parameters."""
    N = N.copy()
    if N.shape[1]:
        # scipy is imported here, where it is needed: regular matrices are the rule.
        from scipy.linalg import qr

        _, triangle, pivots = qr(N.T, mode="economic", pivoting=True)
        N[pivots] = np.linalg.solve(triangle[:, : N.shape[1]], triangle).T
    return np.where(np.abs(N) > SMALL, N, 0.0)


def open_directions(M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Words for each direction that M (p, p) does not excite, such as "k4" or "k2 - 0.5 k3"."""
    N, d = null_space(M)
    return tuple(_words(column, column / d, parameters) for column in N.T)


def directions_in_words(V: Array, d: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Words for the space of directions V (p, r) of the scaled parameters ``d_i k_i``."""
    return tuple(_words(column, column / d, parameters) for column in _echelon(V).T)


def _words(scaled: Array, direction: Array, parameters: tuple[str, ...]) -> str:
    """One direction (p,) as a sum of parameters, of which the first leading one has no factor."""
    # The leading parameter is chosen in scaled parameters, where entries can be compared.
    size = np.abs(scaled)
    lead = np.flatnonzero(size > (1 - SMALL) * size.max())[0]
    return combination(direction / direction[lead], parameters)
