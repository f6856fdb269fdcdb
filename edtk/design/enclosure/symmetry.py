"""Other variables of a box: halves that stand for all of it, and the angles of links.

*Halves.* Turns and mirrors that change no polynomial map one half of a box to the other.

*Links.* Where the axes of two joints are parallel, what is behind the second one turns by the sum
of both angles, ``s = t_j + t_i``, or by their difference where the axes point apart. A sensitivity
may be as large along a whole curve of constant s, and boxes in t_i and t_j follow that curve with a
staircase of small steps; a box in t_i and s does with one. The polynomial in the new variables is
exact: with the sign e of the axes, ``t_j = s - e t_i`` and

    exp(i (a t_i + b t_j)) = exp(i ((a - e b) t_i + b s)),

so that coefficients by waves only move. A limit on t_j becomes a constraint of both variables.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from edtk.design.enclosure.polynomial import ROUNDOFF, Axis, Polynomial
from edtk.system.typing import Array, Indices, Mask

TURN = 2 * np.pi
PARALLEL = 1e-9  # of a cosine: any other axes only make degrees higher
# Roundings of a move, in parts of all coefficients: of sums of two on the way to the waves of two
# axes one each, and on the way back two and four.
OF_MOVE = 8
SAME_END = 1e-12  # [rad] of ends of intervals
NOISE = 1e-10  # of the largest coefficient: less is no reason against a symmetry, and counts anyway


@dataclass(frozen=True)
class Motion:
    """A motion of angles, each of which it leaves, mirrors or turns by half: ``s t + pi h``.

    It multiplies ``cos kt`` by ``(-1)^(hk)`` and ``sin kt`` by ``s (-1)^(hk)``: each coefficient of
    a polynomial keeps its size.

    Attributes:
        mirrors: Whether s = -1 for each axis (d,).
        turns: Whether h = 1 for each axis (d,).
    """

    mirrors: tuple[bool, ...]
    turns: tuple[bool, ...]

    def keeps(self, axes: Sequence[Axis]) -> bool:
        """Whether it maps the box onto itself, but for whole turns."""
        each = zip(axes, self.mirrors, self.turns, strict=True)
        return all(_keeps(axis, mirror, turn) for axis, mirror, turn in each)

    def moves(self, j: int) -> bool:
        """Whether it changes the j-th angle."""
        return self.mirrors[j] or self.turns[j]

    def moved(self, places: Array) -> Array:
        """Where it moves places (m, d)."""
        return np.where(self.mirrors, -1.0, 1.0) * places + np.pi * np.array(self.turns)

    def half(self, j: int, axis: Axis) -> Axis:
        """A half of the j-th interval whose image is the other half."""
        width = axis.high - axis.low
        if not self.mirrors[j]:
            return replace(axis, high=axis.low + width / 2)
        # A mirror has two fixed angles; of a whole circle one half begins at either.
        if width < TURN - SAME_END:
            return replace(axis, low=axis.middle)
        fixed = np.pi / 2 if self.turns[j] else 0.0
        low = fixed + np.pi * np.ceil((axis.low - fixed) / np.pi)
        return replace(axis, low=low, high=low + np.pi)

    def changed(self, f: Polynomial) -> float:
        """``sup |f(moved t) - f(t)|``, at most: twice the coefficients whose sign changes."""
        changes = _odd(_kinds(f) & self.code)
        total = float(np.abs(f.coefficients[changes]).sum())
        return 2 * total * (1 + f.coefficients.size * ROUNDOFF) + 2 * f.error

    @property
    def code(self) -> int:
        """Two bits an axis: whether the sign of sines, and of odd orders, changes."""
        each = enumerate(zip(self.mirrors, self.turns, strict=True))
        return sum((mirror + 2 * turn) << 2 * j for j, (mirror, turn) in each)


def _folded(places: Array, axes: Sequence[Axis]) -> Array:
    """Places (m, d) with angles moved by whole turns to where intervals may have them."""
    folded = places.copy()
    for j, axis in enumerate(axes):
        if axis.kind == "angle":
            turns = np.round((places[:, j] - axis.middle) / TURN)
            folded[:, j] -= TURN * turns
    return folded


def _within(places: Array, axes: Sequence[Axis]) -> Mask:
    """Whether places (m, d) are in a box, but for rounding."""
    low = np.array([axis.low for axis in axes]) - SAME_END
    high = np.array([axis.high for axis in axes]) + SAME_END
    return np.asarray(((places >= low) & (places <= high)).all(axis=1))


def _kinds(f: Polynomial) -> Indices:
    """Two bits an axis, for each coefficient: whether its function is a sine, and of odd order."""
    kinds = np.zeros((1,) * len(f.axes), dtype=int)
    for j, axis in enumerate(f.axes):
        place = np.arange(f.coefficients.shape[j])
        order = (place + 1) // 2
        own = ((place % 2 == 0) & (order > 0)) + 2 * (order % 2)
        own = own * (axis.kind == "angle")
        kinds = kinds + (own << 2 * j).reshape([-1 if i == j else 1 for i in range(len(f.axes))])
    return kinds


def _odd(codes: Indices) -> Mask:
    """Whether the number of bits of each is odd."""
    found = codes
    for shift in (16, 8, 4, 2, 1):
        found = found ^ (found >> shift)
    return (found & 1).astype(bool)


def _keeps(axis: Axis, mirror: bool, turn: bool) -> bool:
    """Whether a motion maps an interval onto itself, but for whole turns."""
    if not mirror and not turn:
        return True
    if axis.kind == "length":
        return False
    if axis.high - axis.low >= TURN - SAME_END:
        return True
    # A turn by half moves every shorter interval; a mirror keeps it where it moves its middle by
    # whole turns.
    shift = 2 * axis.middle - (np.pi if turn else 0.0)
    return mirror and abs(shift - TURN * np.round(shift / TURN)) <= SAME_END


@dataclass(frozen=True)
class Halving:
    """A part of a box that stands for all of it.

    Attributes:
        whole: The intervals before any was halved.
        motions: The motions that map what was cut off to what was left, one after another.
        steps: The intervals that each of them left.
    """

    whole: tuple[Axis, ...]
    motions: tuple[Motion, ...]
    steps: tuple[tuple[Axis, ...], ...]

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The intervals that are left."""
        return self.steps[-1] if self.steps else self.whole

    def of(self, f: Polynomial) -> Polynomial:
        """A polynomial on what is left: by what its motions change it counts as error."""
        error = f.error + sum(motion.changed(f) for motion in self.motions)
        return Polynomial(self.axes, f.coefficients, error)

    def inside(self, places: Array) -> Array:
        """Places (m, d) of the whole box as places of what is left, of the same values."""
        places = _folded(places, self.whole)
        for motion, axes in zip(self.motions, self.steps, strict=True):
            beyond = ~_within(places, axes)
            places = np.where(beyond[:, None], _folded(motion.moved(places), axes), places)
        return places


def halved(axes: Sequence[Axis], functions: Sequence[Polynomial]) -> Halving:
    """Halve a box as often as motions leave all functions as they are.

    Args:
        axes: The box.
        functions: Polynomials on it; up to `NOISE` of each they are to stay.
    """
    left = tuple(axes)
    kinds = np.unique(np.concatenate([np.zeros(1, dtype=int), *map(_present, functions)]))
    motions = [one for one in _motions(left) if not _odd(kinds & one.code).any()]
    used = []
    steps = []
    for j in range(len(left)):
        while own := [one for one in motions if one.moves(j) and one.keeps(left)]:
            # A turn by half leaves no interval on which a mirror could act; so mirrors come first.
            one = max(own, key=lambda motion: motion.mirrors[j])
            left = (*left[:j], one.half(j, left[j]), *left[j + 1 :])
            used.append(one)
            steps.append(left)
    return Halving(tuple(axes), tuple(used), tuple(steps))


def _motions(axes: Sequence[Axis]) -> list[Motion]:
    """All motions but the identity that keep a box."""
    each = [
        [both for both in product((False, True), repeat=2) if _keeps(axis, *both)] for axis in axes
    ]
    every = (Motion(*zip(*choice, strict=True)) for choice in product(*each) if choice)
    return [one for one in every if any(one.moves(j) for j in range(len(axes)))]


def _present(f: Polynomial) -> Indices:
    """What kinds of functions a polynomial has, but for `NOISE`."""
    sizes = np.abs(f.coefficients)
    return np.unique(_kinds(f)[sizes > NOISE * sizes.max()])


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
