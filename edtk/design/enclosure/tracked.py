"""A sensitivity to readings of a tracker, whose errors grow with the length of its beam.

With the beam b from the tracker to the marker, ``s = b'b``, and variances that are ``l(s)`` across
it and ``e(s)`` along it, ``V = l I + (e - l) b b'/s`` and ``V^-1 = (I + k b b')/l`` with
``k = (l - e)/(e s)``. So a sensitivity is at most u where

    N + k(s) Q - u l(s) <= 0,    N = <Z, A'A>,    Q = <Z, A'b b'A>,

and N, Q and s are polynomials. l is concave in s, and k is falling and convex. On a box with
``s_0 <= s <= s_1`` and ``Q >= Q_0`` the chords l* and k* of both between its ends give

    k Q <= k(s_0) Q + Q_0 (k* - k(s_0)),    -u l <= -u l*,

as ``(k(s_0) - k)(Q - Q_0) >= 0``: a polynomial for each box, which is above by the square of the
box. Where it is so near the tracker that k says little, ``Q <= s N`` makes it
``N l(s_1)/e(s_0) - u l*``.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.design.enclosure.boxes import Grid, limits_on
from edtk.design.enclosure.objective import OF_QUOTIENT, Objective
from edtk.design.enclosure.polynomial import ROUNDOFF, Polynomial
from edtk.system.typing import Array

CLOSE_BY = 4.0  # a box is near where its largest squared distance is as many times its least one
OF_WEIGHTS = 64 * ROUNDOFF  # roundings of variances, chords and their products, from above


@dataclass(frozen=True)
class Growth:
    """Variances of a reading over a least one: ``l = (w^2 + k (a + b r)^2)/least``, r the distance.

    Attributes:
        white: Variance w^2 that no distance changes [m^2].
        readings: Readings k that a row is made of.
        along: Coefficients a [m] and b [m/m] of the standard deviation along the beam; none is
            above that of the next.
        across: Those of the one across it.
        least: What variances are in parts of [m^2].
    """

    white: float
    readings: float
    along: tuple[float, float]
    across: tuple[float, float]
    least: float

    def aside(self, s: Array) -> Array:
        """The variance l across a beam of squared length s."""
        return self._variance(self.across, s)

    def inline(self, s: Array) -> Array:
        """The variance e along it."""
        return self._variance(self.along, s)

    def excess(self, s: Array) -> Array:
        """``k = (l - e)/(e s)`` [1/m^2], infinite at a distance of zero."""
        r = np.sqrt(s)
        (a, b), (c, d) = self.along, self.across
        with np.errstate(divide="ignore"):
            over = ((c - a) + (d - b) * r) * ((c + a) + (d + b) * r) / s
        return np.asarray(self.readings / self.least * over / self.inline(s))

    def _variance(self, coefficients: tuple[float, float], s: Array) -> Array:
        a, b = coefficients
        sizes = np.square(a + b * np.sqrt(s))
        return np.asarray((self.white + self.readings * sizes) / self.least)


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackedObjective(Objective):
    """``(N + k(s) Q)/l(s) + constant``, see this module's head; N is the numerator.

    Attributes:
        growth: How variances grow.
        squared: The squared distance s [m^2].
        inline: Q, for N in variances of `growth.least` [m^2]; None where k is zero.
        nearest: No place has a smaller s [m^2], which a wide box cannot tell. Where it is zero
            errors have a part that no distance changes.
        constant: What every place has besides.
    """

    growth: Growth
    squared: Polynomial
    inline: Polynomial | None
    nearest: float
    constant: float = 0.0

    def __call__(self, places: Array) -> Array:
        """Values (m,) at places (m, d)."""
        s = np.maximum(self.squared(places), self.nearest)
        above = self.numerator(places)
        if self.inline is not None:
            above = above + self.growth.excess(s) * self.inline(places)
        return np.asarray(above / self.growth.aside(s) + self.constant)

    def plus(self, constant: float) -> "TrackedObjective":
        """The objective and a number."""
        return replace(self, constant=self.constant + constant)

    def tested(self, level: float) -> Polynomial:
        """``N - u l*`` with the chord of all places, near which `weights` bring it on each box."""
        first, slope = self._line
        u = level - self.constant
        return self.numerator - (u * slope * self.squared + u * first)

    @property
    def forms(self) -> tuple[Polynomial, ...]:
        """What `weights` are of, besides: s, and Q if there is any."""
        return (self.squared,) if self.inline is None else (self.squared, self.inline)

    def scale(self, grid: Grid) -> tuple[float, float]:
        """A lower and an upper bound of l."""
        del grid
        least, most = self.growth.aside(np.array(self._distances)).tolist()
        return least * (1 - OF_WEIGHTS), most * (1 + OF_WEIGHTS)

    def most(self, grid: Grid) -> float:
        """No place has a value above, as ``Q <= s N``."""
        largest = limits_on(self.numerator, grid)[1]
        least = float(self.growth.inline(np.array(self._distances[0])))
        return largest / least * (1 + OF_WEIGHTS) + self.constant

    @property
    def levels(self) -> tuple[float, float]:
        """Those of a quotient: it has a denominator on each box."""
        return OF_QUOTIENT

    @property
    def unit(self) -> float:
        """N is in parts of the least variance [m^2]."""
        return self.growth.least

    def weights(self, level: float, low: Array, high: Array) -> tuple[Array, Array, Array]:
        """On boxes, what is to be at most zero, see this module's head.

        Args:
            level: The level u.
            low: Lower bounds of the forms (forms, b) on each box.
            high: Upper bounds of s (b,).

        Returns:
            Factors (1 + forms, b) of `tested` and of the forms, constants (b,), and by how much
            these may be off by rounding (b,).
        """
        u = level - self.constant
        s = np.maximum(low[0], self.nearest)
        variance = self.growth.aside(s)
        slope = _slope(variance, self.growth.aside(high), s, high)
        own = np.ones_like(s)
        more = np.zeros((2, len(s)))  # of Q, and of s - s_0 by it
        size = u * variance + u * slope * high
        if self.inline is not None:
            is_near = high > CLOSE_BY * s
            ratio = self.growth.aside(high) / self.growth.inline(s) * (1 + OF_WEIGHTS)
            own = np.where(is_near, ratio, own)
            far = np.where(is_near, high, s)
            first = self.growth.excess(far) * (1 + OF_WEIGHTS)
            falling = _slope(first, self.growth.excess(high), far, high)
            least = np.maximum(low[1], 0.0)
            more = np.where(is_near, 0.0, [first, least * falling])
            size = size + least * more[0] - more[1] * high
        offset, rise = self._line
        of_s = u * (own * rise - slope) + more[1]
        constant = u * (own * offset - variance + slope * s) - more[1] * s
        size = size + own * u * (abs(offset) + rise * high)
        factors = np.stack([own, of_s, more[0]])[: 1 + len(self.forms)]
        return factors, constant, OF_WEIGHTS * size

    @cached_property
    def _distances(self) -> tuple[float, float]:
        """A lower and an upper bound of s."""
        low, high = limits_on(self.squared, Grid(self.squared.axes))
        return max(low, self.nearest), high

    @cached_property
    def _line(self) -> tuple[float, float]:
        """The chord ``first + slope s`` of l over all places."""
        ends = np.array(self._distances)
        variances = self.growth.aside(ends)
        slope = float(_slope(*variances, *ends))
        return float(variances[0] - slope * ends[0]), slope


def _slope(first: Array, last: Array, low: Array, high: Array) -> Array:
    """Slopes (b,) between the values at both ends of intervals; zero of a point."""
    width = high - low
    rise = np.where(width > 0, last - first, 0.0)
    return np.asarray(rise / np.where(width > 0, width, 1.0))
