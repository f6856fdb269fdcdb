"""Generalised inverses of singular information matrices, for the combinations that they tell."""

from dataclasses import dataclass

import numpy as np

from criteria.linalg.inverse import (
    EPS,
    ROUNDING,
    eigenpairs,
    guarded_inverse,
    unit_scale,
    whitener,
    whitener_of_regular,
)
from criteria.linalg.typing import Array, Mask

SMALL = 1e-6  # entries below it are rounding of the echelon form, whose largest entries are one
# A diagonal entry below this part of the largest is what rounding leaves of a zero: the square of a
# dozen roundings of an excitation that is exactly zero, such as the torque of a vertical force
# about a vertical axis. Parameters whose units differ by less than 14 decades stay above it.
NOTHING = 1e-29
# Multiple of the rounding of an eigenvector, ``p eps / gap``, that a component along an open
# direction may have and still count as none.
SLACK = 64.0


def combination(factors: Array, parameters: tuple[str, ...]) -> str:
    """Words for a combination with these factors (p,), such as "k4", "k2 - 0.5 k3" or "- 2 k1"."""
    words = []
    for factor, name in zip(factors, parameters, strict=True):
        if factor:
            term = f"{abs(factor):.3g} {name}".removeprefix("1 ")
            words.append(f"{'-' if factor < 0 else '+'} {term}")
    return " ".join(words).removeprefix("+ ")


def combination_names(K: Array) -> tuple[str, ...]:
    """Words for combinations of parameters that are called k1 .. kp."""
    parameters = tuple(f"k{i + 1}" for i in range(len(K)))
    return tuple(combination(column, parameters) for column in K.T)


def null_space(M: Array) -> tuple[Array, Array]:
    """Directions that M (p, p) does not excite, whatever the units of the parameters.

    Returns:
        ``(N, d)``: the directions (p, r) in echelon form, few parameters each, in the scaled
        parameters ``d_i k_i``, and the scales d (p,).
    """
    d = unit_scale(np.diag(M))
    r, V = eigenpairs(M / np.outer(d, d))
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


def estimable_inverse(M: Array, K: Array, rounded: float = 1.0) -> tuple[Array, Array, Mask]:
    """Invert information matrices M as far as the combinations ``K'k`` need it.

    K'k is estimable under M if the columns of K lie in the range of M. Then ``K' G K`` is the same
    for every generalised inverse G of M (Pukelsheim, Optimal Design of Experiments, 1.18), and the
    one returned has the eigenvectors of M at unit diagonal, without the open ones. Regular M have
    the inverse of `guarded_inverse`, to the last bit.

    Args:
        M: Symmetric matrices (..., p, p).
        K: Combinations (p, s) of full column rank.
        rounded: How many times eps of its length each combination is known to.

    Returns:
        ``(safe, G, estimable)``: M and a generalised inverse, both with the identity in place of
        members that leave a combination open, and the mask (...) of the others.
    """
    safe, cov, regular = guarded_inverse(M)
    doubtful = ~regular | _has_nothing(M)
    if not doubtful.any():
        return safe, cov, regular
    flat = M.reshape(-1, *M.shape[-2:])
    p = M.shape[-1]
    safe = safe.reshape(flat.shape).copy()
    cov = cov.reshape(flat.shape).copy()
    good = np.array(regular).reshape(-1)
    for i in np.flatnonzero(doubtful.reshape(-1)):
        found = _Spectrum.of(flat[i]) if np.isfinite(flat[i]).all() else None
        good[i] = found is not None and not found.leaves_open(K, rounded).any()
        safe[i] = flat[i] if good[i] else np.eye(p)
        cov[i] = found.inverse() if found is not None and good[i] else np.eye(p)
    return safe.reshape(M.shape), cov.reshape(M.shape), good.reshape(M.shape[:-2])


def open_columns(M: Array, K: Array, rounded: float = 1.0) -> Mask:
    """Which columns (s,) of K are combinations that M (p, p) leaves open."""
    return _Spectrum.of(M).leaves_open(K, rounded)


def strayed_part(M: Array, K: Array) -> float:
    """How much of combinations lies along directions that M (p, p) leaves open.

    It is the largest part of a column of K (p, s), all at the unit diagonal of M. Columns in the
    range of M have a rounding; of others an inverse on the range alone leaves that part out.
    """
    found = _Spectrum.of(M)
    if not found.is_open.any():
        return 0.0
    scaled = K / found.d[:, None]
    along = np.linalg.norm(found.V[:, found.is_open].T @ scaled, axis=0)
    return float((along / np.linalg.norm(scaled, axis=0)).max())


def range_whitener(M: Array) -> Array:
    """T (p, r) with ``T' M T = I`` on the range of M (p, p); the `whitener` if M is regular."""
    # A Cholesky factor tells in a third of the time that no direction is open, as is the rule.
    T = None if _has_nothing(M) else whitener_of_regular(M)
    if T is not None:
        return T
    found = _Spectrum.of(M)
    if not found.is_open.any():
        return whitener(M)
    kept = ~found.is_open
    return np.asarray(found.V[:, kept] / found.d[:, None] / np.sqrt(found.r[kept]))


def open_subspace(M: Array) -> tuple[Array, Array]:
    """What M (p, p) leaves open, and what would close it.

    Returns:
        ``(U, W)``: open directions U (p, q) with ``M U = 0``, q of them, and W (p, q) such that
        ``M + W W'`` is regular, of order one at the unit diagonal of M, with ``W'U = I``.
    """
    found = _Spectrum.of(M)
    V = found.V[:, found.is_open]
    return V / found.d[:, None], V * found.d[:, None]


def _has_nothing(M: Array) -> Mask:
    """Whether a parameter has no information (...) but what rounding leaves."""
    diagonal = np.diagonal(M, axis1=-2, axis2=-1)
    return np.asarray(diagonal.min(axis=-1) <= NOTHING * diagonal.max(axis=-1))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """Eigenvalues of one information matrix at unit diagonal.

    Attributes:
        r: Eigenvalues (p,).
        V: Eigenvectors (p, p).
        d: Scales (p,) of the parameters, see `unit_scale`.
        is_open: Which directions (p,) have no information but rounding.
    """

    r: Array
    V: Array
    d: Array
    is_open: Mask

    @classmethod
    def of(cls, M: Array) -> "_Spectrum":
        """The spectrum of a finite M (p, p)."""
        diagonal = np.diag(M)
        has_some = diagonal > NOTHING * max(float(diagonal.max()), 0.0)
        d = unit_scale(np.where(has_some, diagonal, 0.0))
        R = np.where(has_some[:, None] & has_some, M / np.outer(d, d), 0.0)
        r, V = eigenpairs(R)
        return cls(r, V, d, r <= len(M) * ROUNDING)

    def leaves_open(self, K: Array, rounded: float) -> Mask:
        """Which columns (s,) of K have a component along an open direction, beyond rounding."""
        scaled = K / self.d[:, None]
        gap = self.r[~self.is_open].min(initial=1.0)
        allowed = SLACK * len(K) * EPS * rounded / gap * np.linalg.norm(scaled, axis=0)
        along = np.abs(self.V[:, self.is_open].T @ scaled)
        return np.asarray((along > allowed).any(axis=0))

    def inverse(self) -> Array:
        """The generalised inverse (p, p) without the open directions."""
        kept = self.V[:, ~self.is_open] / self.d[:, None]
        return np.asarray((kept / self.r[~self.is_open]) @ kept.T)
