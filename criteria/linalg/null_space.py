"""What an information matrix says nothing about."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

Array = NDArray[np.float64]


def null_space(M: Array) -> tuple[Array, Array]:
    """Directions that M (p, p) does not excite, of M scaled to a unit diagonal so that units do not matter.

    Returns:
        ``(N, d)``: the directions in echelon form (p, r), few parameters each, in the scaled parameters ``d_i k_i``.
    """
    root = np.sqrt(np.maximum(np.diag(M), 0.0))
    d = np.where(root > 0, root, 1.0)
    R = M / np.outer(d, d)
    r, V = np.linalg.eigh(R)
    N = V[:, r <= 16 * len(M) * np.finfo(float).eps * max(r[-1], 1.0)]
    if N.shape[1]:
        _, triangle, pivots = qr(N.T, mode="economic", pivoting=True)
        N[pivots] = np.linalg.solve(triangle[:, : N.shape[1]], triangle).T
    return np.where(np.abs(N) > 1e-6, N, 0.0), d


def open_directions(M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """What a person calls each direction that M (p, p) does not excite: "k4", or "k2 - 0.5 k3"."""
    N, d = null_space(M)
    names = []
    for column in N.T:
        x = column / d
        lead = np.flatnonzero(np.abs(column) > (1 - 1e-6) * np.abs(column).max())[0]
        x /= x[lead]
        terms = [(c, f"{abs(c):.3g} {name}") for c, name in zip(x, parameters, strict=True) if c]
        text = " ".join(f"{'-' if c < 0 else '+'} {term.removeprefix('1 ')}" for c, term in terms)
        names.append(text.removeprefix("+ "))
    return tuple(names)
