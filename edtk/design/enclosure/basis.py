"""Normalised bases of a box: where the largest coefficient of a polynomial bounds it from above.

On an interval of half width a, in the distance s from its middle, let

    u = sin((a - s)/2),  v = sin((a + s)/2)   of an angle,      u = a - s,  v = a + s   of a length.

All functions of degree n are ``sum_k c_k w_k u^(N-k) v^k / r^N``, with N = 2n, r = sin(a) of an
angle and N = n, r = 2a of a length. With the weights of

    sum_k w_k x^k = (1 + 2 x cos(a) + x^2)^n   of an angle,    (1 + x)^n   of a length

the sum of the basis functions is one, and for ``a < pi/2`` none is negative. So
``min c <= f <= max c``, the ends of c are values, and the same holds in several variables (Pena,
"Shape preserving representations for trigonometric polynomial curves", CAGD 14, 1997;
Sanchez-Reyes, "Harmonic rational Bezier curves, p-Bezier curves and trigonometric polynomials",
CAGD 15, 1998). Of lengths it is Bernstein's basis, to which that of angles tends for small a.

The left half of the interval has ``u' = sin(-s/2)`` and ``v' = v``, so that ``u = v' + q u'`` with
``q = 2 cos(a/2)``, and ``u = v' + 2 u'`` with ``u' = -s`` of a length, where q = 2. The
coefficients of the half follow by a matrix whose entries are not negative and whose rows have the
sum one:

    c'_j = q^-j sum_k w_k/w'_j binomial(N - k, j - k) c_k.
"""

from functools import lru_cache
from math import comb

import numpy as np

from edtk.design.enclosure.polynomial import ROUNDOFF, Axis
from edtk.system.typing import Array

WIDEST = np.pi / 2  # of the first boxes by an angle: weights are then far from zero


def order(axis: Axis, degree: int) -> int:
    """The number N of basis functions less one."""
    return axis.size(degree) - 1


@lru_cache(maxsize=4096)
def weights(kind: str, degree: int, half: float) -> Array:
    """The weights w (N + 1,) that make the sum of the basis one."""
    factor = [1.0, 2.0 * np.cos(half), 1.0] if kind == "angle" else [1.0, 1.0]
    return _power(np.array(factor), degree)


def basis(kind: str, degree: int, half: float, s: Array) -> Array:
    """Values (m, N + 1) of the basis at distances s (m,) from the middle of an interval."""
    w = weights(kind, degree, half)
    k = np.arange(len(w))
    if kind == "angle":
        u, v, r = np.sin((half - s) / 2), np.sin((half + s) / 2), np.sin(half)
    else:
        u, v, r = half - s, half + s, 2 * half
    return np.asarray(w * (u / r)[:, None] ** (len(w) - 1 - k) * (v / r)[:, None] ** k)


@lru_cache(maxsize=4096)
def halves(kind: str, degree: int, half: float) -> Array:
    """Matrices (2, N + 1, N + 1) to the coefficients on the lower and on the upper half.

    Args:
        kind: Of the axis.
        degree: Degree n of the polynomial.
        half: Half width a of the interval; of a length it does not count.
    """
    w = weights(kind, degree, half)
    finer = weights(kind, degree, half / 2)
    q = 2.0 * np.cos(half / 2) if kind == "angle" else 2.0
    N = len(w) - 1
    lower = np.zeros((N + 1, N + 1))
    for j in range(N + 1):
        for k in range(j + 1):
            lower[j, k] = comb(N - k, j - k) * w[k] / finer[j] / q**j
    return np.stack([lower, lower[::-1, ::-1]])


def rounding_of_half(size: int, unit: float) -> float:
    """Rounding of one product with a matrix of `halves`, relative to the largest coefficient.

    An entry has two weights of up to N positive sums of three products each, a power of q and five
    operations more, all relative: at most ``8 N + 8`` units of double precision. The product of a
    row of sum one is a sum of N + 1 products, with a unit for an entry that is cut to the precision
    of the tensor.

    Args:
        size: N + 1.
        unit: Rounding of one operation in the precision of the tensor.
    """
    return (8 * size + 8) * ROUNDOFF + (size + 2) * unit


@lru_cache(maxsize=4096)
def elevation(kind: str, degree: int, higher: int, half: float) -> Array:
    """The matrix (N' + 1, N + 1) from coefficients of a degree to those of a higher one.

    A polynomial times one: ``c'_j w'_j = sum_k c_k w_k d_(j-k)`` with weights d of the difference
    of degrees. Entries are not negative, and rows have the sum one.
    """
    w = weights(kind, degree, half)
    one = weights(kind, higher - degree, half)
    total = weights(kind, higher, half)
    matrix = np.zeros((len(total), len(w)))
    for k in range(len(w)):
        matrix[k : k + len(one), k] = w[k] * one
    return matrix / total[:, None]


def from_functions(axis: Axis, degree: int, middle: Array, half: Array) -> Array:
    """Matrices (b, N + 1, size) from coefficients of a `Polynomial` to those of intervals.

    Args:
        axis: The variable.
        degree: Degree n of the polynomial.
        middle: Middles (b,) of the intervals.
        half: Their half widths (b,).
    """
    if axis.kind == "length":
        return _from_powers(axis, degree, middle, half)
    widths, which = np.unique(half, return_inverse=True)
    local = np.stack([_from_turns(degree, a) for a in widths.tolist()])[which]
    turned = np.empty((len(middle), 2 * degree + 1, 2 * degree + 1))
    turned[:, :, 0] = local[:, :, 0].real
    if degree:
        # exp(i k t) = exp(i k middle) exp(i k s)
        k = np.arange(1, degree + 1)
        both = local[:, :, 1:] * np.exp(1j * middle[:, None] * k)[:, None]
        turned[:, :, 1::2] = both.real
        turned[:, :, 2::2] = both.imag
    return turned


@lru_cache(maxsize=4096)
def _from_turns(degree: int, half: float) -> Array:
    """Coefficients (N + 1, n + 1), complex, of ``exp(i k s)`` for k to n.

    In u and v, ``exp(i s)`` is ``(exp(-i a/2) + exp(i a/2) x)^2`` and one ``1 + 2 x cos(a) + x^2``.
    """
    w = weights("angle", degree, half)
    turn = np.array([np.exp(-0.5j * half), np.exp(0.5j * half)])
    columns = [
        np.convolve(_power(turn, 2 * k), weights("angle", degree - k, half)) / w
        for k in range(degree + 1)
    ]
    return np.stack(columns, axis=-1)


def _from_powers(axis: Axis, degree: int, middle: Array, half: Array) -> Array:
    """Matrices of a length, whose functions are ``((x - axis.middle)/axis.half)^k``.

    At the ends of the interval u = l and u = h; in Bernstein's basis u is ``l + h x`` of ``1 + x``.
    """
    low = (middle - half - axis.middle) / axis.half
    high = (middle + half - axis.middle) / axis.half
    w = weights("length", degree, 1.0)
    matrix = np.empty((len(middle), degree + 1, degree + 1))
    for b, ends in enumerate(zip(low, high, strict=True)):
        for k in range(degree + 1):
            one = weights("length", degree - k, 1.0)
            matrix[b, :, k] = np.convolve(_power(np.array(ends), k), one) / w
    return matrix


def largest_entry(axis: Axis, degree: int, half: float) -> float:
    """A bound on sums of sizes of terms of an entry of `from_functions`.

    Of an angle all terms of ``exp(i k s)`` have the sizes of ``(1 + x)^(2k)``; of a length no
    function is above one in the axis.
    """
    if axis.kind == "length":
        return 1.0
    w = weights("angle", degree, half)
    ones = np.ones(2)
    sizes = [
        np.convolve(_power(ones, 2 * k), weights("angle", degree - k, half)) / w
        for k in range(degree + 1)
    ]
    return float(np.max(sizes)) * 2**0.5


def rounding_of_entry(axis: Axis, degree: int) -> float:
    """Rounding of a product with a matrix of `from_functions`, relative to `largest_entry`.

    An entry has at most 3n factors of two or three terms, of which each complex product counts four
    units and each sum one; a weight has n factors; the turn ``exp(i k middle)`` is rounded by
    ``2 pi n`` units in its angle, and two more. Then comes a sum of N + 1 products.
    """
    return (40 * degree + order(axis, degree) + 16) * ROUNDOFF


def _power(factor: Array, n: int) -> Array:
    """Coefficients of the n-th power of a polynomial."""
    found = np.ones(1, dtype=factor.dtype)
    for _ in range(n):
        found = np.convolve(found, factor)
    return found
