"""Interval arithmetic with derivatives, on which a user's function may run instead of numbers.

Ends are rounded outward: sums and products are within half a unit of their doubles, and numpy's
functions within four units. A function f of x has the derivatives ``f'(x) dx_j`` by the chain rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.design.expansion import rational
from edtk.system.typing import Array

UNITS = 8.0 * float(np.finfo(float).eps)  # relative error of a function of numpy, from above
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Range:
    """Numbers between two ends, of arrays of one shape; the order of the ends is not checked.

    Args:
        low: Lower ends.
        high: Upper ends.
    """

    low: Array
    high: Array

    @classmethod
    def of(cls, values: Any) -> Range:
        """Numbers themselves."""
        exact = np.asarray(values, dtype=float)
        return cls(exact, exact)

    @classmethod
    def outward(cls, low: Array, high: Array) -> Range:
        """Ends that one operation has rounded; what is no number may be anything."""
        below = np.nextafter(low, -np.inf)
        above = np.nextafter(high, np.inf)
        return cls(
            np.where(np.isnan(below), -np.inf, below), np.where(np.isnan(above), np.inf, above)
        )

    @classmethod
    def computed(cls, low: Array, high: Array) -> Range:
        """Ends that a function of numpy has computed."""
        return cls.outward(low - UNITS * np.abs(low) - TINY, high + UNITS * np.abs(high) + TINY)

    def __neg__(self) -> Range:
        """All numbers with the other sign."""
        return Range(-self.high, -self.low)

    def __add__(self, other: Range) -> Range:
        """All sums."""
        return Range.outward(self.low + other.low, self.high + other.high)

    def __mul__(self, other: Range) -> Range:
        """All products."""
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        # Zero times infinity: the infinite end stands for finite numbers.
        ends = [np.where(np.isnan(end), 0.0, end) for end in ends]
        return Range.outward(np.minimum.reduce(ends), np.maximum.reduce(ends))

    def __abs__(self) -> Range:
        """All sizes."""
        a, b = np.abs(self.low), np.abs(self.high)
        least = np.where((self.low <= 0) & (self.high >= 0), 0.0, np.minimum(a, b))
        return Range(least, np.maximum(a, b))

    def not_negative(self) -> Range:
        """Those that are not negative, where no others can be meant; zero where there are none."""
        return Range(np.maximum(self.low, 0.0), np.maximum(self.high, 0.0))

    def squared(self) -> Range:
        """All squares."""
        sizes = abs(self)
        return Range.outward(sizes.low**2, sizes.high**2).not_negative()

    def inverse(self) -> Range:
        """All reciprocals; any number where zero is among the numbers."""
        safe = (self.low > 0) | (self.high < 0)
        low = np.where(safe, self.low, 1.0)
        high = np.where(safe, self.high, 1.0)
        found = Range.outward(1 / high, 1 / low)
        return Range(np.where(safe, found.low, -np.inf), np.where(safe, found.high, np.inf))

    def rising(self, function: Callable[[Array], Array]) -> Range:
        """All values of a function that nowhere falls."""
        return Range.computed(function(self.low), function(self.high))

    def wave(self) -> Range:
        """All cosines."""
        turns = 2 * np.pi
        ends = Range.computed(
            np.minimum(np.cos(self.low), np.cos(self.high)),
            np.maximum(np.cos(self.low), np.cos(self.high)),
        )
        # A multiple of a turn may lie within the ends, but for their own rounding.
        slack = UNITS * (1 + abs(self).high)
        tops = np.floor((self.high + slack) / turns) >= np.ceil((self.low - slack) / turns)
        bottoms = np.floor((self.high + slack) / turns - 0.5) >= np.ceil(
            (self.low - slack) / turns - 0.5
        )
        finite = np.isfinite(self.low) & np.isfinite(self.high)
        low = np.where(bottoms | ~finite, -1.0, np.maximum(ends.low, -1.0))
        return Range(low, np.where(tops | ~finite, 1.0, np.minimum(ends.high, 1.0)))

    def times(self, matrix: Array, axis: int) -> Range:
        """Products with a matrix (k, n) along an axis of n, with the rounding of their sums."""
        low = np.moveaxis(self.low, axis, 0)
        high = np.moveaxis(self.high, axis, 0)
        up, down = np.maximum(matrix, 0.0), np.minimum(matrix, 0.0)
        size = np.tensordot(np.abs(matrix), abs(Range(low, high)).high, 1)
        off = (len(low) + 2) * UNITS * size
        below = np.tensordot(up, low, 1) + np.tensordot(down, high, 1) - off
        above = np.tensordot(up, high, 1) + np.tensordot(down, low, 1) + off
        found = Range.outward(below, above)
        return Range(np.moveaxis(found.low, 0, axis), np.moveaxis(found.high, 0, axis))

    def total(self, axes: tuple[int, ...]) -> Range:
        """Sums over axes, with their rounding."""
        count = int(np.prod([self.low.shape[axis] for axis in axes]))
        off = count * UNITS * abs(self).high.sum(axis=axes)
        return Range.outward(self.low.sum(axis=axes) - off, self.high.sum(axis=axes) + off)


# The double is below pi/2, by less than a unit.
QUARTER = Range(np.asarray(np.pi / 2), np.nextafter(np.asarray(np.pi / 2), np.inf))


@dataclass(frozen=True, eq=False)
class Interval:
    """An entry of an array on which a function runs: its values and derivatives over boxes.

    What asks for an order or for a float, and functions of numpy that are not written here, are a
    `TypeError`.

    Args:
        value: Values (b,).
        slope: Derivatives (d, b) by each variable.
    """

    value: Range
    slope: Range

    def __add__(self, other: object) -> Interval:
        """The sum."""
        if isinstance(other, Interval):
            return Interval(self.value + other.value, self.slope + other.slope)
        return Interval(self.value + _number(other), self.slope)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        """The negative."""
        return Interval(-self.value, -self.slope)

    def __pos__(self) -> Interval:
        """The same."""
        return self

    def __sub__(self, other: object) -> Interval:
        """The difference."""
        return self + (-other if isinstance(other, Interval) else -rational(other))

    def __rsub__(self, other: object) -> Interval:
        """A number less this."""
        return -self + other

    def __mul__(self, other: object) -> Interval:
        """The product; one with itself is a square."""
        if other is self:
            return self**2
        if isinstance(other, Interval):
            slope = self.value * other.slope + other.value * self.slope
            return Interval(self.value * other.value, slope)
        factor = _number(other)
        return Interval(self.value * factor, self.slope * factor)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Interval:
        """The quotient."""
        if isinstance(other, Interval):
            return self * other._inverse()
        return self * (1 / rational(other))

    def __rtruediv__(self, other: object) -> Interval:
        """A number over this."""
        return self._inverse() * other

    def __pow__(self, other: object) -> Interval:
        """A power by a number."""
        power = rational(other)
        if power == 0.5:
            return self.sqrt()
        if power.denominator > 1:
            return (self.log() * power).exp()
        n = int(power)
        if n < 0:
            return (self**-n)._inverse()
        if n == 0:
            return self * 0 + 1
        return self._by(_whole_power(self.value, n), _whole_power(self.value, n - 1) * _number(n))

    def __rpow__(self, other: object) -> Interval:
        """A positive number to this power."""
        return (self * float(np.log(float(rational(other))))).exp()

    def __abs__(self) -> Interval:
        """The size."""
        v = self.value
        sign = Range(np.where(v.low > 0, 1.0, -1.0), np.where(v.high < 0, -1.0, 1.0))
        return self._by(abs(v), sign)

    def __eq__(self, other: object) -> bool:
        """No answer: it may differ from point to point."""
        raise TypeError("a comparison")

    def __bool__(self) -> bool:
        """No answer: it may differ from point to point."""
        raise TypeError("a comparison")

    def exp(self) -> Interval:
        """``np.exp``."""
        found = self.value.rising(np.exp).not_negative()
        return self._by(found, found)

    def log(self) -> Interval:
        """``np.log``, any number where it is not defined."""
        positive = self.value.not_negative()
        return self._by(positive.rising(np.log), positive.inverse())

    def expm1(self) -> Interval:
        """``np.expm1``."""
        return self.exp() - 1

    def log1p(self) -> Interval:
        """``np.log1p``."""
        return (self + 1).log()

    def sqrt(self) -> Interval:
        """``np.sqrt``."""
        found = self.value.not_negative().rising(np.sqrt).not_negative()
        return self._by(found, (found * Range.of(2.0)).inverse())

    def cos(self) -> Interval:
        """``np.cos``."""
        return self._by(self.value.wave(), -(self.value + -QUARTER).wave())

    def sin(self) -> Interval:
        """``np.sin``, the cosine a quarter of a turn before."""
        return self._by((self.value + -QUARTER).wave(), self.value.wave())

    def tanh(self) -> Interval:
        """``np.tanh``."""
        found = self.value.rising(np.tanh)
        return self._by(found, -found.squared() + Range.of(1.0))

    def sinh(self) -> Interval:
        """``np.sinh``."""
        return self._by(self.value.rising(np.sinh), abs(self.value).rising(np.cosh))

    def cosh(self) -> Interval:
        """``np.cosh``."""
        return self._by(abs(self.value).rising(np.cosh), self.value.rising(np.sinh))

    def arctan(self) -> Interval:
        """``np.arctan``."""
        slope = (self.value.squared() + Range.of(1.0)).inverse()
        return self._by(self.value.rising(np.arctan), slope)

    def _inverse(self) -> Interval:
        """The reciprocal."""
        found = self.value.inverse()
        return self._by(found, -found.squared())

    def _by(self, value: Range, rate: Range) -> Interval:
        """A function with this value and this derivative."""
        return Interval(value, self.slope * rate)


def _number(given: object) -> Range:
    """A number, rounded outward where no double is it."""
    exact = rational(given)
    near = float(exact)
    if near == exact:
        return Range.of(near)
    return Range.outward(np.asarray(near), np.asarray(near))


def _whole_power(v: Range, n: int) -> Range:
    """All powers by a whole number from zero."""
    if n == 0:
        return Range(np.ones_like(v.low), np.ones_like(v.high))
    if n % 2 == 0:
        return abs(v).rising(lambda x: x**n).not_negative()
    return v.rising(lambda x: x**n)


def run_on_boxes(function: Callable[[Any], Any], low: Array, high: Array) -> tuple[Range, Range]:
    """Values (..., b) and derivatives (d, ..., b) of a function of points over boxes.

    Args:
        function: Maps points (n, d) to values (n, ...).
        low: Lower ends (b, d) of the boxes.
        high: Upper ends (b, d).

    Raises:
        TypeError: It does not run on intervals; or another error, whatever the function raises.
    """
    b, d = low.shape
    x = np.empty((1, d), dtype=object)
    for j in range(d):
        unit = np.repeat(np.eye(d)[:, j : j + 1], b, axis=1)
        x[0, j] = Interval(Range(low[:, j], high[:, j]), Range.of(unit))
    with np.errstate(all="ignore"):
        found = np.asarray(function(x), dtype=object)
        found = found.reshape(found.shape[1:])
        zero = Interval(Range.of(np.zeros(b)), Range.of(np.zeros((d, b))))
        each = [zero + entry for entry in found.ravel()]
        value = Range(
            np.stack([e.value.low for e in each]).reshape(*found.shape, b),
            np.stack([e.value.high for e in each]).reshape(*found.shape, b),
        )
        slope = Range(
            np.stack([e.slope.low for e in each], axis=1).reshape(d, *found.shape, b),
            np.stack([e.slope.high for e in each], axis=1).reshape(d, *found.shape, b),
        )
    return value, slope
