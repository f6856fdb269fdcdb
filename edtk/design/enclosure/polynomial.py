"""Polynomials in angles and lengths: dense tensors of coefficients, with a bound on their error."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.polynomial import chebyshev

from edtk.system.typing import Array, Indices

ROUNDOFF = float(np.finfo(float).eps) / 2  # of one operation
POINTS = 1 << 22  # numbers that an evaluation holds at once


@dataclass(frozen=True)
class Axis:
    """One variable of a polynomial, and the interval that matters.

    An angle t of degree n has the functions ``1, cos t, sin t, ..., cos nt, sin nt``; a length x of
    degree n has ``1, u, ..., u^n`` of ``u = (x - middle)/half``, so that no function is above one.

    Args:
        kind: "angle" [rad] or "length" (any unit).
        low: Lower end of the interval.
        high: Upper end, not below the lower one.

    Raises:
        ValueError: The kind is unknown, or the ends are no numbers or not in order.
    """

    kind: Literal["angle", "length"]
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.kind not in ("angle", "length"):
            raise ValueError(f"an axis is an 'angle' or a 'length', not {self.kind!r}")
        if not -np.inf < self.low <= self.high < np.inf:
            raise ValueError(f"an axis from {self.low:g} to {self.high:g}; expected an interval")

    @property
    def middle(self) -> float:
        """The middle of the interval."""
        return (self.low + self.high) / 2

    @property
    def half(self) -> float:
        """Half the width of the interval; of a length one where the interval is a point."""
        half = (self.high - self.low) / 2
        return half if half or self.kind == "angle" else 1.0

    def size(self, degree: int) -> int:
        """How many functions a degree has."""
        return 2 * degree + 1 if self.kind == "angle" else degree + 1

    def degree(self, size: int) -> int:
        """The degree that so many functions have."""
        return size // 2 if self.kind == "angle" else size - 1

    def values(self, degree: int, at: Array) -> Array:
        """Values (m, size) of the functions at places (m,) of the variable."""
        if self.kind == "length":
            return np.vander((at - self.middle) / self.half, degree + 1, increasing=True)
        turns = at[:, None] * np.arange(1, degree + 1)
        both = np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(len(at), -1)
        return np.concatenate([np.ones((len(at), 1)), both], axis=1)

    def nodes(self, degree: int) -> Array:
        """Places (size,) that determine a polynomial: evenly on the circle, or Chebyshev's."""
        size = self.size(degree)
        if self.kind == "angle":
            return 2 * np.pi * np.arange(size) / size
        return self.middle + self.half * np.cos(np.pi * (np.arange(size) + 0.5) / size)

    def sampling(self, degree: int) -> "Sampling":
        """How coefficients follow from values at the nodes."""
        return Sampling.of(self.kind, degree)


@dataclass(frozen=True, eq=False)
class Sampling:
    """Between coefficients along one axis and values at its nodes.

    Attributes:
        synthesis: Values at the nodes of the functions (size, size).
        analysis: Its inverse.
        noise: At most so much, times the norm of errors of samples over ``sqrt(size)``, is the
            polynomial of these off at any place of the interval.
        rounding: The same of the roundings of one product with `analysis`, as parts of the samples.
    """

    synthesis: Array
    analysis: Array
    noise: float
    rounding: float

    @staticmethod
    @lru_cache
    def of(kind: str, degree: int) -> "Sampling":
        """The matrices of a degree.

        Let the functions be scaled such that the sum of their squares is at most s^2 anywhere:
        for an angle by ``1/sqrt(N)`` and ``sqrt(2/N)``, N = 2n + 1, with s = 1, which makes the
        analysis B orthogonal; for a length not at all, with ``s^2 = n + 1``. By Cauchy and
        Schwarz, errors e of samples move the polynomial by at most ``s |B e| <= s |B| |e|``. One
        product with B rounds by at most ``gamma_N |B| |f|``, entry by entry (Higham, Accuracy and
        Stability of Numerical Algorithms, 2002, eq. 3.12), and the entries of B, of angles up to
        half a turn, are off by no more than ten units in the mean.
        """
        if kind == "angle":
            count = 2 * degree + 1
            scale = np.sqrt(np.r_[1.0, np.full(2 * degree, 2.0)] / count)
            # Whole turns are taken off in whole numbers, so that no angle is above half a turn.
            steps = np.outer(np.arange(count), np.arange(1, degree + 1)) % count
            turns = 2 * np.pi * np.where(steps > degree, steps - count, steps) / count
            both = np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(count, -1)
            synthesis = np.concatenate([np.ones((count, 1)), both], axis=1)
            scaled = (synthesis * scale).T
            analysis = scaled * scale[:, None]
            largest = 1.0
        else:
            count = degree + 1
            axis = Axis("length", -1.0, 1.0)
            synthesis = axis.values(degree, axis.nodes(degree))
            by_chebyshev = np.zeros((count, count))
            for k in range(count):
                by_chebyshev[: k + 1, k] = chebyshev.cheb2poly(np.eye(count)[k])[: k + 1]
            cosines = np.cos(np.pi * np.outer(np.arange(count), np.arange(count) + 0.5) / count)
            cosines *= np.where(np.arange(count) == 0, 1.0, 2.0)[:, None] / count
            scaled = analysis = by_chebyshev @ cosines
            largest = np.sqrt(count)
        noise = largest * np.linalg.norm(scaled, 2) * np.sqrt(count)
        gamma = (2 * count + 12) * ROUNDOFF
        rounding = gamma * largest * np.linalg.norm(np.abs(scaled), 2) * np.sqrt(count)
        return Sampling(synthesis, analysis, float(noise), float(rounding))


@dataclass(frozen=True, eq=False)
class Polynomial:
    """``f(x) = sum_k c_k prod_j phi_kj(x_j)`` over the functions of each axis, see `Axis`.

    Args:
        axes: The variables (d,).
        coefficients: Tensor whose j-th axis holds the functions of the j-th variable.
        error: What is enclosed differs from the sum above by at most so much, anywhere in the box.

    Raises:
        ValueError: The tensor does not fit the axes.
    """

    axes: tuple[Axis, ...]
    coefficients: Array
    error: float = 0.0

    def __post_init__(self) -> None:
        shape = self.coefficients.shape
        fits = len(shape) == len(self.axes) and all(
            size >= 1 and (axis.kind == "length" or size % 2 == 1)
            for axis, size in zip(self.axes, shape, strict=True)
        )
        if not fits:
            raise ValueError(
                f"coefficients of the shape {shape} for {len(self.axes)} axes; expected 2n + 1 "
                "numbers along an angle of degree n, n + 1 along a length"
            )

    @classmethod
    def constant(cls, axes: Sequence[Axis], value: float) -> "Polynomial":
        """The same number everywhere."""
        return cls(tuple(axes), np.full((1,) * len(axes), float(value)))

    @classmethod
    def variable(cls, axes: Sequence[Axis], j: int, name: str = "x") -> "Polynomial":
        """The j-th length "x" itself, or "cos" or "sin" of the j-th angle.

        Raises:
            ValueError: The axis is of the other kind, or the name is none of these.
        """
        axis = axes[j]
        of_kind: dict[str, list[float]] = {"cos": [0.0, 1.0, 0.0], "sin": [0.0, 0.0, 1.0]}
        if axis.kind == "length":
            of_kind = {"x": [axis.middle, axis.half]}
        if name not in of_kind:
            raise ValueError(f"{name!r} of an axis of the kind {axis.kind}")
        shape = np.ones(len(axes), dtype=int)
        shape[j] = len(of_kind[name])
        return cls(tuple(axes), np.array(of_kind[name]).reshape(shape))

    @classmethod
    def interpolated(
        cls,
        axes: Sequence[Axis],
        degrees: Sequence[int],
        f: Callable[[Array], Array],
        rounding: float = 0.0,
    ) -> "Polynomial":
        """The polynomial f, from its values at as many places as it has coefficients.

        Args:
            axes: The variables (d,).
            degrees: What f's degree by each variable is at most: by derivation, it is not checked.
            f: Values (m,) of places (m, d), which may lie outside an angle's interval.
            rounding: Absolute error of values of f, at most.
        """
        grid = np.meshgrid(
            *(axis.nodes(n) for axis, n in zip(axes, degrees, strict=True)), indexing="ij"
        )
        places = np.stack([x.ravel() for x in grid], axis=-1)
        values = f(places).reshape([axis.size(n) for axis, n in zip(axes, degrees, strict=True)])
        return cls.of_samples(axes, values, rounding)

    @classmethod
    def of_samples(cls, axes: Sequence[Axis], values: Array, rounding: float = 0.0) -> "Polynomial":
        """The polynomial with these values on the grid of nodes of its degrees.

        Its error is that of the samples, and what the transforms round, see `Sampling`.
        """
        sizes = zip(axes, values.shape, strict=True)
        samplings = [axis.sampling(axis.degree(size)) for axis, size in sizes]
        largest = float(np.abs(values).max())
        steps = sum(one.rounding / one.noise for one in samplings)
        error = float(np.prod([one.noise for one in samplings])) * (rounding + steps * largest)
        coefficients = _along(values, [one.analysis for one in samplings])
        return cls(tuple(axes), coefficients, float(error))

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degree by each variable."""
        shape = self.coefficients.shape
        return tuple(axis.degree(size) for axis, size in zip(self.axes, shape, strict=True))

    @cached_property
    def size(self) -> float:
        """A bound of |f| by the sum of all coefficients: no function is above one in the box."""
        slack = 1 + self.coefficients.size * ROUNDOFF
        return float(np.abs(self.coefficients).sum()) * slack + self.error

    def __call__(self, places: Array) -> Array:
        """Values (m,) at places (m, d)."""
        step = max(1, POINTS * self.coefficients.shape[-1] // self.coefficients.size)
        found = [self._at(places[i : i + step]) for i in range(0, len(places), step)]
        return np.concatenate([np.zeros(0), *found])

    def _at(self, places: Array) -> Array:
        """Values at few places: one axis after the other, the last one first."""
        m = len(places)
        sums = np.repeat(self.coefficients[..., None], m, axis=-1) if not self.axes else None
        for axis, n, x in reversed(list(zip(self.axes, self.degrees, places.T, strict=True))):
            values = axis.values(n, x)
            if sums is None:
                sums = self.coefficients @ values.T
            else:
                sums = np.einsum("...km,mk->...m", sums, values)
        assert sums is not None
        return sums

    def __neg__(self) -> "Polynomial":
        """The negative -f."""
        return replace(self, coefficients=-self.coefficients)

    def __add__(self, other: "Polynomial | float") -> "Polynomial":
        """The sum f + g."""
        g = self._like(other)
        shape = np.maximum(self.coefficients.shape, g.coefficients.shape)
        total = self._padded(shape) + g._padded(shape)
        rounded = ROUNDOFF * float(np.abs(total).sum())
        return Polynomial(self.axes, total, self.error + g.error + 2 * rounded)

    def __radd__(self, other: float) -> "Polynomial":
        """A number + f, and so `sum`."""
        return self + other

    def __sub__(self, other: "Polynomial | float") -> "Polynomial":
        """The difference f - g."""
        return self + -self._like(other)

    def __rsub__(self, other: float) -> "Polynomial":
        """A number - f."""
        return -self + other

    def __mul__(self, other: "Polynomial | float") -> "Polynomial":
        """The product f g, by values on the grid that determines the product."""
        if not isinstance(other, Polynomial):
            rounded = ROUNDOFF * abs(other) * self.size
            error = abs(other) * self.error + rounded
            return Polynomial(self.axes, self.coefficients * other, error)
        return sum_of_products([(1.0, self, other)])

    def __rmul__(self, other: float) -> "Polynomial":
        """A number times f."""
        return self * other

    def _like(self, other: "Polynomial | float") -> "Polynomial":
        """A polynomial in the same variables.

        Raises:
            ValueError: The other one has other variables.
        """
        if not isinstance(other, Polynomial):
            return Polynomial.constant(self.axes, other)
        if other.axes != self.axes:
            raise ValueError("polynomials in different variables; expected the same axes")
        return other

    def _padded(self, shape: Array) -> Array:
        """The coefficients, with zeros for functions of higher degrees."""
        given = self.coefficients.shape
        return np.pad(
            self.coefficients, [(0, n - own) for own, n in zip(given, shape, strict=True)]
        )

    def samples(self, degrees: "Sequence[int] | Indices") -> "Samples":
        """Values on the grid of nodes of these degrees.

        Each is a sum of products with functions of at most one: of N along an axis it rounds by
        ``gamma_N`` of the sum of all sizes, and angles of up to n turns by as many units.
        """
        matrices = [
            axis.values(own, axis.nodes(int(n)))
            for axis, own, n in zip(self.axes, self.degrees, degrees, strict=True)
        ]
        steps = sum((8 * size + 4) * ROUNDOFF for size in self.coefficients.shape)
        values = _along(self.coefficients, matrices)
        return Samples(values, steps * (self.size - self.error))

    def raised(self, degrees: Sequence[int]) -> "Polynomial":
        """The same with zeros for functions up to these degrees."""
        sizes = [axis.size(n) for axis, n in zip(self.axes, degrees, strict=True)]
        return replace(self, coefficients=self._padded(np.array(sizes)))

    def cut(self, degrees: Sequence[int]) -> "Polynomial":
        """Without the functions above these degrees, whose coefficients count as error.

        What vanishes by derivation leaves roundings there, and so is dropped with proof.
        """
        sizes = [axis.size(n) for axis, n in zip(self.axes, degrees, strict=True)]
        kept = self.coefficients[tuple(slice(size) for size in sizes)]
        rest = self.coefficients.copy()
        rest[tuple(slice(size) for size in sizes)] = 0.0
        return Polynomial(self.axes, kept, self.error + _total(rest))

    def trimmed(self) -> "Polynomial":
        """`cut` to degrees above which no more is left, along each axis, than the error anyway.

        What vanishes by symmetry of a chain is left as rounding by the interpolation of a higher
        degree, and so is proved to vanish, up to this rounding, which counts.
        """
        degrees = []
        for j, axis in enumerate(self.axes):
            others = tuple(i for i in range(len(self.axes)) if i != j)
            sums = np.abs(self.coefficients).sum(axis=others)
            above = np.cumsum(sums[::-1])[::-1]  # of functions from this one on
            kept = int((above > self.error).sum())
            degrees.append(kept // 2 if axis.kind == "angle" else max(kept - 1, 0))
        return self.cut(degrees)

    def over(self, axes: Sequence[Axis], kept: Sequence[int]) -> "Polynomial":
        """The same in some of the variables, of the others it is of degree zero.

        Args:
            axes: The variables that are kept, angles perhaps with other intervals.
            kept: Their indices among those of today, in order.

        Raises:
            ValueError: It depends on another variable.
        """
        shape = self.coefficients.shape
        if any(size > 1 for j, size in enumerate(shape) if j not in kept):
            raise ValueError("a polynomial depends on a variable that is to be dropped")
        coefficients = self.coefficients.reshape([shape[j] for j in kept])
        return Polynomial(tuple(axes), coefficients, self.error)


class NotEnclosedError(ValueError):
    """What has no enclosure, and why, in one line."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Values on a grid, and how far each may be off by rounding."""

    values: Array
    rounding: float

    @property
    def largest(self) -> float:
        """The largest size of a value."""
        return float(np.abs(self.values).max())


def sum_of_squares(terms: Sequence[Polynomial]) -> Polynomial:
    """``sum_i f_i^2``, by values on one grid; at least one term."""
    return sum_of_products([(1.0, f, f) for f in terms])


def sum_of_products(terms: Sequence[tuple[float, Polynomial, Polynomial]]) -> Polynomial:
    """``sum_i w_i f_i g_i``, by values on one grid; at least one term."""
    axes = terms[0][1].axes
    degrees = np.max([np.add(f.degrees, g.degrees) for _, f, g in terms], axis=0)
    values = np.zeros([axis.size(int(n)) for axis, n in zip(axes, degrees, strict=True)])
    rounding = error = 0.0
    for weight, f, g in terms:
        one, other = f.samples(degrees), g.samples(degrees)
        values += weight * one.values * other.values
        of_terms = (len(terms) + 2) * ROUNDOFF * one.largest * other.largest
        of_one = (other.largest + other.rounding) * one.rounding
        rounding += abs(weight) * (of_terms + of_one + one.largest * other.rounding)
        error += abs(weight) * (f.size * g.error + g.size * f.error)
    total = Polynomial.of_samples(axes, values, rounding)
    return replace(total, error=total.error + error)


def _along(values: Array, matrices: Sequence[Array]) -> Array:
    """A matrix times a tensor along each axis."""
    for matrix in matrices:
        # The first axis becomes the last one; after all axes each is where it was.
        values = np.tensordot(values, matrix, axes=(0, 1))
    return values


def _total(values: Array) -> float:
    """The sum of all sizes, from above."""
    return float(np.abs(values).sum()) * (1 + values.size * ROUNDOFF)
