"""Functions of points of a box as polynomials: derived by running them, or interpolated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from numbers import Rational
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from criteria.linalg.inverse import EPS
from edtk.system.errors import ArgumentError, whole_number
from edtk.system.typing import Array

Exponents = tuple[int, ...]
Function = Callable[[Any], ArrayLike]
# Relative difference from a polynomial beyond which a function is none. The rounding of one that is
# written badly stays below, and is counted.
NO_POLYNOMIAL = 1e-9
ABOVE = 1 + 1e-12  # what is rounded up by so much is above a sum of some thousand terms
FRESH_POINTS = 200  # points at which a polynomial is compared with the function, at least
MOST_TERMS = 20_000  # terms of one entry: no more could be enclosed in reasonable time
MOST_POWER = 100
SMALL_ENTRY = 1e-6  # part of the largest entry, below which an entry may be rounding


class NotPolynomialError(ValueError):
    """A function is no polynomial, or none that is found; the message says why.

    Attributes:
        x: A point (d,) that shows it, if one does.
    """

    def __init__(self, message: str, x: Array | None = None) -> None:
        super().__init__(message)
        self.x = x


@dataclass(frozen=True, eq=False)
class Term:
    """An entry of an array on which a function runs: a polynomial with rational coefficients.

    It adds, subtracts and multiplies, and divides by numbers. All else is a `TypeError`: a function
    that asks for a root, an order or a float does not run on it. Doubles are rational numbers, and
    nothing is rounded.

    Args:
        variables: Number d of variables.
        terms: Coefficients of products of powers, by the exponents (d,).
    """

    variables: int
    terms: dict[Exponents, Fraction]

    def __post_init__(self) -> None:
        if len(self.terms) > MOST_TERMS:
            raise TypeError(f"more than {MOST_TERMS} terms")

    def __add__(self, other: object) -> Term:
        """The sum."""
        terms = dict(self.terms)
        for exponents, c in self._like(other).terms.items():
            terms[exponents] = terms.get(exponents, Fraction(0)) + c
        return self._of(terms)

    def __radd__(self, other: object) -> Term:
        """A number + f, and so `sum`."""
        return self + other

    def __neg__(self) -> Term:
        """-f."""
        return self._of({exponents: -c for exponents, c in self.terms.items()})

    def __pos__(self) -> Term:
        """The same."""
        return self

    def __sub__(self, other: object) -> Term:
        """The difference."""
        return self + -self._like(other)

    def __rsub__(self, other: object) -> Term:
        """A number - f."""
        return -self + other

    def __mul__(self, other: object) -> Term:
        """The product."""
        terms: dict[Exponents, Fraction] = {}
        pairs = product(self.terms.items(), self._like(other).terms.items())
        for (m, a), (n, b) in pairs:
            exponents = tuple(i + j for i, j in zip(m, n, strict=True))
            terms[exponents] = terms.get(exponents, Fraction(0)) + a * b
        return self._of(terms)

    def __rmul__(self, other: object) -> Term:
        """A number times f."""
        return self * other

    def __truediv__(self, other: object) -> Term:
        """The quotient by a number."""
        divisor = rational(other)
        if not divisor:
            raise TypeError("a division by zero")
        return self * (1 / divisor)

    def __pow__(self, other: object) -> Term:
        """A whole power."""
        power = rational(other)
        if power.denominator > 1 or not 0 <= power <= MOST_POWER:
            raise TypeError(f"the power {other}")
        found = self._like(1)
        for _ in range(int(power)):
            found = found * self
        return found

    def __eq__(self, other: object) -> bool:
        """No answer: it may differ from point to point."""
        raise TypeError("a comparison")

    def __bool__(self) -> bool:
        """No answer: it may differ from point to point."""
        raise TypeError("a comparison")

    def _of(self, terms: dict[Exponents, Fraction]) -> Term:
        """The polynomial of these terms, without those that vanish."""
        return Term(self.variables, {exponents: c for exponents, c in terms.items() if c})

    def _like(self, other: object) -> Term:
        """A polynomial, or a number as one."""
        if isinstance(other, Term):
            return other
        return self._of({(0,) * self.variables: rational(other)})


def rational(given: object) -> Fraction:
    """A number as a fraction.

    Raises:
        TypeError: It is none, or not finite.
    """
    if isinstance(given, np.generic):
        given = given.item()
    if isinstance(given, Rational):
        return Fraction(given)
    if isinstance(given, float) and np.isfinite(given):
        return Fraction(given)
    raise TypeError(f"{type(given).__name__} where a number is expected")


@dataclass(frozen=True, eq=False)
class Expansion:
    """Polynomials of points of a box in powers of ``u_j = (x_j - middle_j)/half_j``, |u_j| <= 1.

    Attributes:
        limits: Bounds (2, d) of the box.
        exact: Coefficients (..., n_1 + 1, .., n_d + 1), fractions.
        errors: Differences (...) of the functions from these, at most, anywhere in the box.
        is_derived: Whether the functions were run on polynomials: they are these, and the errors
            are zero. Otherwise they were interpolated, by a degree that somebody has stated.
    """

    limits: Array
    exact: np.ndarray[tuple[int, ...], np.dtype[np.object_]]
    errors: Array
    is_derived: bool

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degree by each variable."""
        return tuple(size - 1 for size in self.exact.shape[-self.limits.shape[1] :])

    @cached_property
    def coefficients(self) -> Array:
        """The coefficients as doubles, each rounded once."""
        return self.exact.astype(float)

    def reshaped(self, shape: tuple[int, ...]) -> Expansion:
        """The same entries in another shape."""
        errors = self.errors.reshape(shape)
        sizes = self.exact.shape[-self.limits.shape[1] :]
        return replace(self, exact=self.exact.reshape(*errors.shape, *sizes), errors=errors)

    def divided(self, by: Array) -> Expansion:
        """The entries (k, p), each row divided by a number (k,)."""
        fractions = np.array([Fraction(1) / Fraction(one) for one in by.tolist()], dtype=object)
        others = [1] * (self.exact.ndim - 1)
        exact = self.exact * fractions.reshape(-1, *others)
        return replace(self, exact=exact, errors=self.errors / by[:, None] * ABOVE)

    def times(self, T: Array | None) -> Expansion:
        """The entries (k, p) times a matrix (p, q), without rounding; None for the identity."""
        if T is None:
            return self
        fractions = np.array([Fraction(t) for t in T.ravel().tolist()], dtype=object)
        turned = np.tensordot(self.exact, fractions.reshape(T.shape), axes=(1, 0))
        errors = self.errors @ np.abs(T) * ABOVE
        return replace(self, exact=np.moveaxis(turned, -1, 1), errors=errors)

    def values(self, x: Array) -> Array:
        """Values (m, ...) at points x (m, d)."""
        low, high = self.limits
        found = np.broadcast_to(self.coefficients, (len(x), *self.coefficients.shape))
        u = (x - (low + high) / 2) / ((high - low) / 2)
        for own in u.T[::-1]:
            powers = np.vander(own, found.shape[-1], increasing=True)
            found = np.einsum("m...k,mk->m...", found, powers)
        return found


def expand(function: Function, limits: Array, degree: tuple[int, ...] | None) -> Expansion:
    """A function of points (n, d), with values (n, ...), as polynomials.

    It is run on polynomials where it lets itself: then nothing is rounded, and nothing has to be
    believed. Otherwise it is interpolated by the degree that is stated. Either is compared with the
    function at fresh points.

    Args:
        function: The function.
        limits: Bounds (2, d) of the box.
        degree: What the degree by each variable is at most; None where nobody has stated it.

    Raises:
        NotPolynomialError: It is no polynomial, or not of this degree.
    """
    try:
        found = derived(function, limits)
    except Exception as error:  # whatever a function raises that expects an array of floats
        if degree is None:
            reason = " ".join(str(error).split())
            raise NotPolynomialError(f"it does not run on polynomials ({reason})") from error
        return interpolated(function, limits, degree)
    if degree is not None and np.greater(found.degrees, degree).any():
        return interpolated(function, limits, degree)
    _differences(found, function)
    return found


def derived(function: Function, limits: Array) -> Expansion:
    """The function, run on polynomials instead of numbers.

    Raises:
        TypeError: It does not run on them; or another error, whatever the function raises.
    """
    d = limits.shape[1]
    values = np.asarray(function(_variables(limits)), dtype=object)
    values = values.reshape(values.shape[1:])
    zero = Term(d, {})
    entries = [zero + value for value in values.ravel()]
    exponents = [own for entry in entries for own in entry.terms]
    sizes = np.max(exponents or [(0,) * d], axis=0) + 1
    if np.prod(sizes) > MOST_TERMS:
        raise TypeError(f"more than {MOST_TERMS} coefficients")
    exact = np.full((len(entries), *sizes), Fraction(0), dtype=object)
    for i, entry in enumerate(entries):
        for own, c in entry.terms.items():
            exact[(i, *own)] = c
    shape = values.shape
    return Expansion(limits, exact.reshape(*shape, *sizes), np.zeros(shape), True)


def _variables(limits: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.object_]]:
    """The point (1, d) of polynomials: each variable, ``middle + half u``."""
    d = limits.shape[1]
    x = np.empty((1, d), dtype=object)
    for j, (a, b) in enumerate(zip(*limits.tolist(), strict=True)):
        low, high = Fraction(a), Fraction(b)
        own = tuple(int(i == j) for i in range(d))
        x[0, j] = Term(d, {(0,) * d: (low + high) / 2, own: (high - low) / 2})
    return x


def interpolated(function: Function, limits: Array, degree: Sequence[int]) -> Expansion:
    """The function from its values at Chebyshev's nodes, if it is a polynomial of a degree.

    Values that are wrong by e make the polynomial wrong by ``Lambda e`` at most, with Lebesgue's
    constant ``Lambda <= prod_j (1 + 2/pi log(n_j + 1))`` of the nodes (Rivlin, Chebyshev
    Polynomials, 1990, theorem 1.2). Their error is what the polynomial misses at fresh points.

    Args:
        function: The function.
        limits: Bounds (2, d) of the box.
        degree: Its degree by each variable, at most.

    Raises:
        NotPolynomialError: It is none of this degree; the point that shows it is named.
    """
    sizes = np.add(degree, 1)
    if np.prod(sizes) > MOST_TERMS:
        raise NotPolynomialError(f"a degree of more than {MOST_TERMS} coefficients")
    low, high = limits
    nodes = [np.cos(np.pi * (np.arange(size) + 0.5) / size) for size in sizes]
    u = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, len(sizes))
    values = _finite(function, low + (high - low) * (1 + u) / 2)
    waves = values.reshape(*sizes, -1)
    for size in sizes:
        # The first axis becomes the last one; after all variables the entries are the first.
        waves = np.tensordot(waves, _cosines(int(size)), axes=(0, 1))
    shape = values.shape[1:]
    found = _of_waves(limits, waves, shape, np.zeros(shape))
    missed = np.maximum(_differences(found, function), EPS * np.abs(values).max(axis=0))
    errors = (1 + float(np.prod(1 + 2 / np.pi * np.log(sizes)))) * missed
    for axis in range(1, waves.ndim):
        waves, errors = _trimmed(waves, errors, axis)
    return _of_waves(limits, waves, shape, errors)


def _finite(function: Function, x: Array) -> Array:
    """Values (m, ...) at points x (m, d).

    Raises:
        NotPolynomialError: One is not finite; its point is named.
    """
    values = np.asarray(function(x), dtype=float)
    lost = np.flatnonzero(~np.isfinite(values.reshape(len(x), -1)).all(axis=1))
    if len(lost):
        raise NotPolynomialError("a value is not finite", x[lost[0]])
    return values


def _cosines(size: int) -> Array:
    """Coefficients (size, size) of Chebyshev's polynomials, from values at their nodes."""
    k = np.arange(size)
    cosines = np.cos(np.pi * np.outer(k, k + 0.5) / size)
    return np.asarray(cosines * np.where(k == 0, 1.0, 2.0)[:, None] / size)


def _of_waves(limits: Array, waves: Array, shape: tuple[int, ...], errors: Array) -> Expansion:
    """The expansion of entries with these coefficients (k, sizes) of Chebyshev's polynomials."""
    exact = np.array([Fraction(c) for c in waves.ravel().tolist()], dtype=object)
    exact = exact.reshape(waves.shape)
    for size in waves.shape[1:]:
        rows = [chebyshev.cheb2poly([0] * k + [1]) for k in range(size)]
        powers = np.array([[int(c) for c in row] + [0] * (size - len(row)) for row in rows], object)
        exact = np.tensordot(exact, powers, axes=(1, 0))
    return Expansion(limits, exact.reshape(*shape, *waves.shape[1:]), errors, False)


def _trimmed(waves: Array, errors: Array, axis: int) -> tuple[Array, Array]:
    """Without the highest degrees along an axis that are lost in the errors; these count them."""
    kept = waves
    flat = errors.ravel()
    while kept.shape[axis] > 1:
        top = np.abs(kept.take(-1, axis)).reshape(len(kept), -1).sum(axis=1)
        if (top > flat).any():
            break
        kept = kept.take(range(kept.shape[axis] - 1), axis)
    dropped = np.abs(waves).reshape(len(waves), -1).sum(axis=1)
    dropped -= np.abs(kept).reshape(len(kept), -1).sum(axis=1)
    return kept, errors + np.maximum(dropped, 0.0).reshape(errors.shape)


def _differences(found: Expansion, function: Function) -> Array:
    """The largest differences (...) of polynomials from the function, at fresh points.

    Raises:
        NotPolynomialError: One is more than rounding; its point is named.
    """
    low, high = found.limits
    number = max(FRESH_POINTS, 2 * found.exact[(0,) * found.errors.ndim].size)
    inside = low + (high - low) * np.random.default_rng(0).random((number, len(low)))
    x = np.concatenate([inside, found.limits])
    values = _finite(function, x)
    away = np.abs(values - found.values(x)).reshape(len(x), -1)
    size = np.abs(values).reshape(len(x), -1).max(axis=0)
    parts = away / (size + SMALL_ENTRY * size.max() + np.finfo(float).tiny)
    worst = int(parts.max(axis=1).argmax())
    if not parts.max() <= NO_POLYNOMIAL:
        raise NotPolynomialError(
            f"a value differs by {parts.max():.1e} of the largest from any polynomial of degree "
            f"{', '.join(str(n) for n in found.degrees)}",
            x[worst],
        )
    return np.asarray(away.max(axis=0).reshape(found.errors.shape))


def degrees_of(given: int | Sequence[int], d: int) -> tuple[int, ...]:
    """The degree by each of d variables, from one for all or from as many.

    Raises:
        ArgumentError: It is neither.
    """
    try:
        each = [given] * d if np.ndim(given) == 0 else list(given)  # type: ignore[arg-type]
    except ValueError as error:  # lists of other lengths within
        message = f"expected a number, or one for each of {d} variables"
        raise ArgumentError(message, argument="degree") from error
    if len(each) != d:
        message = f"{len(each)} numbers; expected one, or one for each of {d} variables"
        raise ArgumentError(message, argument="degree")
    return tuple(whole_number(one, "degree", 0) for one in each)
