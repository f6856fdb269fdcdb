"""The angles of links as variables, in place of those of joints whose axes are parallel.

Where the axes of two joints are parallel, what is behind the second one turns by the sum of both
angles, ``s = t_j + t_i``, or by their difference where the axes point apart. A sensitivity may be
as large along a whole curve of constant s, and boxes in t_i and t_j follow that curve with a
staircase of small steps; a box in t_i and s does with one. The polynomial in the new variables is
exact: with the sign e of the axes, ``t_j = s - e t_i`` and

    exp(i (a t_i + b t_j)) = exp(i ((a - e b) t_i + b s)),

so that coefficients by waves only move. A limit on t_j becomes a constraint of both variables.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edtk.design.enclosure.polynomial import ROUNDOFF, Axis, Polynomial
from edtk.design.enclosure.symmetry import TURN
from edtk.system.typing import Array

PARALLEL = 1e-9  # of a cosine: any other axes only make degrees higher
# Roundings of a move, in parts of all coefficients: of sums of two on the way to the waves of two
# axes one each, and on the way back two and four.
OF_MOVE = 8


@dataclass(frozen=True)
class Link:
    """The angle ``s = t_j + sign t_i`` in place of t_j.

    Attributes:
        first: The axis i.
        second: The axis j, behind it.
        sign: One, or minus one.
    """

    first: int
    second: int
    sign: int

    def axes(self, axes: Sequence[Axis]) -> tuple[Axis, ...]:
        """The variables, with the interval that s has."""
        one, other = axes[self.first], axes[self.second]
        ends = sorted((self.sign * one.low, self.sign * one.high))
        low = other.low + ends[0]
        s = Axis("angle", low, min(other.high + ends[1], low + TURN))
        return tuple(s if k == self.second else axis for k, axis in enumerate(axes))

    def matrix(self, d: int) -> Array:
        """S (d, d) with ``t = S t'`` for the new variables t'."""
        S = np.eye(d)
        S[self.second, self.first] = -self.sign
        return S

    def of(self, f: Polynomial) -> Polynomial:
        """A polynomial of the old variables in the new ones, without degrees that vanish."""
        waves = _to_waves(_to_waves(f.coefficients, self.first), self.second)
        ordered = np.moveaxis(waves, (self.first, self.second), (0, 1))
        a, b = ordered.shape[:2]
        moved = np.zeros((a + b - 1, *ordered.shape[1:]), dtype=complex)
        for k in range(b):
            begin = b // 2 - self.sign * (k - b // 2)
            moved[begin : begin + a, k] = ordered[:, k]
        waves = np.moveaxis(moved, (0, 1), (self.first, self.second))
        found = _from_waves(_from_waves(waves, self.second), self.first).real
        error = f.error + OF_MOVE * ROUNDOFF * f.size
        return Polynomial(self.axes(f.axes), np.ascontiguousarray(found), error).trimmed()


def _to_waves(values: Array, axis: int) -> Array:
    """Coefficients by ``exp(ikt)``, k from -n to n, of those by ``1, cos t, sin t, ...``."""
    real = np.moveaxis(values, axis, 0)
    cosines, sines = 0.5 * real[1::2], 0.5j * real[2::2]
    waves = np.concatenate([(cosines + sines)[::-1], real[:1], cosines - sines])
    return np.moveaxis(waves, 0, axis)


def _from_waves(values: Array, axis: int) -> Array:
    """The way back from `_to_waves`."""
    waves = np.moveaxis(values, axis, 0)
    n = len(waves) // 2
    forth, back = waves[n + 1 :], waves[:n][::-1]
    real = np.empty_like(waves)
    real[0], real[1::2], real[2::2] = waves[n], forth + back, 1j * (forth - back)
    return np.moveaxis(real, 0, axis)


def direction_of(one: Array, other: Array) -> int:
    """One for axes (3, m) that are parallel in all of m poses, minus one where they point apart.

    Zero for any others: their sum would be no better a variable.
    """
    cosines = np.sum(one * other, axis=0)
    if np.abs(cosines).min() < 1 - PARALLEL or np.ptp(np.sign(cosines)):
        return 0
    return int(np.sign(cosines[0]))


def within(axes: Sequence[Axis], j: int) -> Polynomial | None:
    """``cos(t_j - middle) - cos(half)``, not negative within an interval; None of a whole turn."""
    axis = axes[j]
    if axis.high - axis.low >= TURN:
        return None
    values = np.array([-np.cos(axis.half), np.cos(axis.middle), np.sin(axis.middle)])
    rounding = (8 + 4 * (abs(axis.low) + abs(axis.high))) * ROUNDOFF
    shape = np.where(np.arange(len(axes)) == j, 3, 1)
    return Polynomial(tuple(axes), values.reshape(shape), rounding)
