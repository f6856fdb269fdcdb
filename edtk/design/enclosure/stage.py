"""One level of a covering: what closes a box there, and how an open one is halved.

A box is closed, that is not halved any more, where one of these holds of its coefficients in the
basis of `basis.py`, to a level u:

- *below*: those of ``N - u D`` are at most zero, of an objective N/D;
- *infeasible*: those of a slack c are negative;
- *penalised*: those of ``N - u D + sum_i mu_i c_i`` are at most zero, for some ``mu >= 0``: where
  the box is feasible, ``c_i >= 0``.

Where an objective has `forms`, what is above ``N - u D`` is another polynomial on each box.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from edtk.design.enclosure import basis
from edtk.design.enclosure.boxes import (
    DEEPEST,
    Boxes,
    Grid,
    Leaves,
    Reason,
    along,
    at_once,
    coefficients,
    rounding_of_halves,
    rounding_of_slack,
)
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import ROUNDOFF, Polynomial
from edtk.system.typing import Array, Indices, Mask

PENALTIES = 6  # factors of a slack that are tried
LEVELLED = 20  # rounds of factors of several slacks together
TINY = float(np.finfo(float).tiny)
SINGLE = np.float32
UNIT = float(np.finfo(SINGLE).eps) / 2
EIGHT = 8 * UNIT  # roundings
LEAST = 128 * float(np.finfo(SINGLE).smallest_subnormal)  # what roundings below normal numbers lose
# Rounding of halvings, in parts of what errors of the polynomials leave of the gap, from which on a
# tensor is made anew.
PART_OF_GAP = 0.25
# Error of the polynomials, in parts of the gap, up to which boxes are halved until what is left of
# the gap closes them: a quarter of it, which takes four times as many boxes for each two joints.
FINE = 0.75
FRESH = 4  # roundings, or least errors, up to which making a tensor anew gains little
STRIDE = 2  # places of a tensor that are left out where an axis is chosen


@dataclass(frozen=True, eq=False)
class OpenBoxes:
    """Open boxes with their coefficients.

    Attributes:
        boxes: The boxes (b).
        bound: What is known from the boxes around them (b,).
        penalties: The factors mu of the slacks (b, c) that prove it.
        values: Coefficients (b, ...) of ``N - u D``.
        error: By how much these may be off (b,).
        rounding: How much of that each halving adds (b,).
        slacks: Coefficients (b, ...) of each slack.
        forms: Those of what else an objective is made of on each box; none of most.
    """

    boxes: Boxes
    bound: Array
    penalties: Array
    values: Array
    error: Array
    rounding: Array
    slacks: tuple[Array, ...]
    forms: tuple[Array, ...]

    @property
    def leaves(self) -> Leaves:
        """The boxes as leaves."""
        return replace(
            Leaves.unknown(self.boxes, self.bound, len(self.slacks)), penalties=self.penalties
        )

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, which: Indices | Mask | slice) -> "OpenBoxes":
        return OpenBoxes(
            self.boxes[which],
            self.bound[which],
            self.penalties[which],
            self.values[which],
            self.error[which],
            self.rounding[which],
            tuple(slack[which] for slack in self.slacks),
            tuple(form[which] for form in self.forms),
        )


@lru_cache(maxsize=1024)
def _by_depth(
    matrix: Callable[..., Array], kind: str, degrees: tuple[int, ...], widest: float
) -> Array:
    """A matrix of `basis` for the half width at each depth (DEEPEST + 1, ...)."""
    return np.stack([matrix(kind, *degrees, widest / 2**k) for k in range(DEEPEST + 1)])


class Stage:
    """One level u of one objective, at which boxes are closed or halved.

    Attributes:
        tested: ``N - u D``, in degrees no lower than those of slacks.
        least: A lower bound of D; its upper one is `most`.
    """

    def __init__(self, enclosed: Enclosed, objective: Objective, grid: Grid, level: float) -> None:
        self.enclosed = enclosed
        self.grid = grid
        self.level = level
        self.objective = objective
        self.forms = objective.forms
        tested = objective.tested(level)
        others = [f.degrees for f in (*enclosed.slacks, *self.forms)]
        self.tested = tested.raised(np.max([tested.degrees, *others], axis=0).tolist())
        self.least, self.most = objective.scale(grid)
        self.degrees = self.tested.degrees
        self.chunk = at_once(self.tested)
        self.least_error = 0.0  # of coefficients that are made anew
        self.off = np.zeros(len(self.forms))  # by which those of forms are lifted at most

    def opened(self, leaves: Leaves) -> OpenBoxes:
        """Boxes with their coefficients, made from the polynomials."""
        middles = self.grid.middles(leaves.boxes)
        halves = self.grid.halves(leaves.boxes)
        values, error = coefficients(self.tested, middles, halves)
        largest = np.abs(values).reshape(len(values), -1).max(axis=1)
        self.least_error = error
        lifted, by = [], []
        for form in (*self.enclosed.slacks, *self.forms):
            found, wrong = coefficients(form, middles, halves)
            by.append(wrong + rounding_of_slack(form))
            lifted.append(found + by[-1])
        count = len(self.enclosed.slacks)
        self.off = np.maximum(self.off, by[count:])
        return OpenBoxes(
            leaves.boxes,
            leaves.bound,
            leaves.penalties,
            values.astype(SINGLE),
            error + UNIT * largest + LEAST,
            rounding_of_halves(self.tested, UNIT) * largest + LEAST,
            tuple(lifted[:count]),
            tuple(lifted[count:]),
        )

    def bound(self, top: Array) -> Array:
        """What ``N - u D <= top`` says of N/D."""
        if self.least <= 0:
            return np.where(top <= 0, self.level, np.inf)
        return self.level + top / np.where(top > 0, self.least, self.most)

    def halved(self, chunk: OpenBoxes, axis: int) -> OpenBoxes:
        """Both halves of boxes along one axis, lower ones first."""
        depth = chunk.boxes.depth[:, axis]
        kind = self.enclosed.axes[axis].kind
        widest = float(self.grid.widest[axis])

        def cut(values: Array, degree: int) -> Array:
            H = _by_depth(basis.halves, kind, (degree,), widest)[depth].astype(values.dtype)
            return np.concatenate([along(H[:, side], values, axis) for side in (0, 1)])

        return OpenBoxes(
            Boxes.joined([chunk.boxes.half(axis, 0), chunk.boxes.half(axis, 1)]),
            np.tile(chunk.bound, 2),
            np.tile(chunk.penalties, (2, 1)),
            cut(chunk.values, self.degrees[axis]),
            np.tile(chunk.error + chunk.rounding, 2),
            np.tile(chunk.rounding, 2),
            tuple(
                cut(values, slack.degrees[axis])
                for values, slack in zip(chunk.slacks, self.enclosed.slacks, strict=True)
            ),
            tuple(
                cut(values, form.degrees[axis])
                for values, form in zip(chunk.forms, self.forms, strict=True)
            ),
        )

    def above(self, chunk: OpenBoxes) -> OpenBoxes:
        """Boxes with the coefficients of what is above ``N - u D`` there, in double precision.

        Forms stand too high by as much as they may be off, and twice that is taken from their least
        coefficients. A sum of products rounds by few units of each, and by those of raised forms.
        """
        if not self.forms:
            return chunk
        b = len(chunk)
        depth = chunk.boxes.depth
        flat = [form.reshape(b, -1) for form in chunk.forms]
        low = np.stack([own.min(axis=1) for own in flat]) - 2 * self.off[:, None]
        (own, *factors), constant, error = self.objective.weights(
            self.level, low, flat[0].max(axis=1)
        )
        tested = chunk.values.reshape(b, -1)
        values = own[:, None] * tested + constant[:, None]
        size = own * np.abs(tested).max(axis=1) + np.abs(constant)
        error += own * chunk.error
        for i, (factor, form) in enumerate(zip(factors, self.forms, strict=True)):
            raised = self.elevated(chunk.forms[i], form.degrees, depth)
            values += factor[:, None] * raised.reshape(b, -1)
            size += np.abs(factor) * np.abs(flat[i]).max(axis=1) * self.rounds(form)
            error += 2 * np.abs(factor) * self.off[i]
        error += 8 * ROUNDOFF * size
        return replace(chunk, values=values.reshape(chunk.values.shape), error=error)

    def elevated(self, values: Array, degrees: tuple[int, ...], depth: Indices) -> Array:
        """Coefficients (b, ...) of a slack in the degrees of the objective."""
        # The last axis comes first: its products are the narrowest, while the tensor is small.
        for j in reversed(range(len(degrees))):
            if degrees[j] == self.degrees[j]:
                continue
            kind = self.enclosed.axes[j].kind
            E = _by_depth(
                basis.elevation, kind, (degrees[j], self.degrees[j]), float(self.grid.widest[j])
            )
            values = along(E[depth[:, j]].astype(values.dtype), values, j)
        return values

    def rounds(self, form: Polynomial) -> float:
        """Roundings of a form's product with a factor in a sum, over eight.

        Each axis along which it is raised adds a sum of products; averages are not larger than what
        they are of.
        """
        raised = [j for j, n in enumerate(form.degrees) if n != self.degrees[j]]
        rounds = 12 + sum(form.coefficients.shape[j] + 3 for j in raised)
        return rounds / 8

    def close(self, chunk: OpenBoxes, shift: float, gap: float) -> tuple[Leaves, Mask, Array]:
        """What is known of open boxes at ``level + shift``, and which of them are closed.

        Args:
            chunk: The boxes.
            shift: By how much the largest known value has risen since the level was set.
            gap: How far the level is above that value.

        Returns:
            What is known, whether each is closed, and the coefficients (b, ...) with penalties.
        """
        b = len(chunk)
        top = chunk.values.reshape(b, -1).max(axis=1) + chunk.error
        reason = np.where(top <= shift, Reason.BELOW, Reason.OPEN)
        cut = np.zeros((b, len(chunk.slacks)), dtype=bool)
        for i, slack in enumerate(chunk.slacks):
            own = slack.reshape(b, -1)
            reason[own.max(axis=1) < 0] = Reason.INFEASIBLE
            cut[:, i] = own.min(axis=1) < 0
        values = chunk.values
        penalties = np.zeros((b, len(chunk.slacks)))
        some = np.flatnonzero((reason == Reason.OPEN) & cut.any(axis=1))
        if len(some):
            values = values.copy()
            penalised = Penalised(self, chunk[some], top[some], shift)
            for i in range(len(chunk.slacks)):
                penalised.add(i, cut[some, i])
            penalised.join(cut[some])
            top[some] = penalised.top
            penalties[some] = penalised.penalties
            values[some] = penalised.values
            reason[some[penalised.top <= shift]] = Reason.PENALISED
        # Where errors of the polynomials alone keep a box open, and leave little of the gap, no
        # halving will close it.
        hidden = (top - chunk.error <= shift) & (chunk.error <= FRESH * self.least_error)
        hidden &= self.least_error > FINE * gap
        hidden |= (chunk.boxes.depth >= DEEPEST - 1).any(axis=1)
        hidden &= reason == Reason.OPEN
        reason[hidden] = np.where(penalties[hidden].any(axis=1), Reason.PENALISED, Reason.BELOW)
        bound = self.bound(top)
        # What is known from a box around this one rests on that one's factors.
        inherited = (chunk.bound <= bound) & (reason == Reason.OPEN)
        penalties[inherited] = chunk.penalties[inherited]
        bound = np.minimum(chunk.bound, bound)
        bound[reason == Reason.INFEASIBLE] = -np.inf
        leaves = Leaves(chunk.boxes, reason, bound, penalties)
        return leaves, reason != Reason.OPEN, values

    def split(self, chunk: OpenBoxes, values: Array) -> list[OpenBoxes]:
        """Halves of boxes, each along the axis of the largest second difference of coefficients.

        What coefficients are above the values of a polynomial comes from second differences, of
        which a few tell.
        """
        axes, differences = _largest_second_difference(values)
        # Differences of rounding alone would always choose the same axis.
        lost = differences <= 4 * chunk.error
        axes[lost] = chunk.boxes.depth[lost].argmin(axis=1)
        parts = []
        for axis in np.unique(axes).tolist():
            both = self.halved(chunk[axes == axis], axis)
            parts += [both[i : i + self.chunk] for i in range(0, len(both), self.chunk)]
        return parts

    def is_coarse(self, chunk: OpenBoxes, gap: float) -> bool:
        """Whether halvings have rounded by much of what is left of a gap, and by much anew."""
        rounded = chunk.error - self.least_error
        left = max(gap - self.least_error, (1 - FINE) * gap)
        if not (rounded > PART_OF_GAP * left).any():
            return False
        largest = np.abs(chunk.values).reshape(len(chunk), -1).max(axis=1)
        anew = rounding_of_halves(self.tested, UNIT) * largest
        return bool((rounded > FRESH * anew).any())


def _largest_second_difference(values: Array) -> tuple[Indices, Array]:
    """The axis (b,) of the largest second difference of some coefficients, and its size (b,)."""
    found = np.full((values.ndim - 1, len(values)), -1.0)
    for j in range(1, values.ndim):
        if values.shape[j] < 3:
            # A degree of one by a length: first differences are all there is.
            if values.shape[j] == 2:
                found[j - 1] = 0.0
            continue
        every: list[slice] = [slice(None)] + [slice(None, None, STRIDE)] * (values.ndim - 1)
        every[j] = slice(None)
        some = np.moveaxis(values[tuple(every)], j, 1)
        second = some[:, :-2] - 2 * some[:, 1:-1] + some[:, 2:]
        found[j - 1] = np.abs(second).reshape(len(values), -1).max(axis=1)
    return found.argmax(axis=0), found.max(axis=0)


class Penalised:
    """Coefficients of some boxes with those of slacks added, so that the largest one falls.

    Attributes:
        values: Coefficients (b, ...) of ``N - u D + sum_i mu_i c_i``.
        top: The largest of each (b,), with its error.
        penalties: Factors mu (b, c).
    """

    def __init__(self, stage: Stage, chunk: OpenBoxes, top: Array, shift: float) -> None:
        self.stage = stage
        self.chunk = chunk
        self.shift = shift
        self.values = chunk.values.copy()
        self.top = top.copy()
        self.error = chunk.error.copy()
        self.penalties = np.zeros((len(chunk), len(chunk.slacks)))

    def add(self, i: int, cut: Mask) -> None:
        """Add the best factor of a slack, where it cuts a box that is still open."""
        which = np.flatnonzero(cut & (self.top > self.shift))
        if not len(which):
            return
        f = self.values[which].reshape(len(which), -1)
        c = self._raised(i, which)
        size = self._rounded_size(i, which)
        best, top = _best_factors(f, c, self.top[which], self.error[which], size, self.shift)
        gained = np.flatnonzero(best > 0)
        if not len(gained):
            return
        own, mu = which[gained], best[gained]
        penalised = f[gained] + mu[:, None] * c[gained]
        self.values[own] = penalised.reshape(len(own), *self.values.shape[1:])
        self.error[own] += EIGHT * (np.abs(penalised).max(axis=1) + mu * size[gained])
        self.top[own] = top[gained]
        self.penalties[own, i] = mu

    def join(self, cut: Mask) -> None:
        """Try factors of several slacks (b, c) together, where these cut a box that is still open.

        At a maximum on several constraints ``f + sum_i mu_i c_i`` is level for the multipliers of
        Karush, Kuhn and Tucker, and one factor after the other does not find them. So the factors
        make it as level as they can, by least squares of its slopes at the corners of the box.
        """
        which = np.flatnonzero((cut.sum(axis=1) > 1) & (self.top > self.shift))
        if not len(which):
            return
        f = corners(self.chunk.values[which])
        c = np.stack([corners(slack[which]) for slack in self.chunk.slacks], axis=1)
        mu = _levelling(_slopes(f), _slopes(c) * cut[which, :, None])
        level = (f + (mu[:, None] @ c)[:, 0]).max(axis=1)
        hopeful = ((mu > 0).sum(axis=1) > 1) & (level <= self.shift)
        which, mu = which[hopeful], mu[hopeful]
        if not len(which):
            return
        total = self.chunk.values[which].reshape(len(which), -1)
        error = self.chunk.error[which]
        for i in np.flatnonzero(mu.any(axis=0)).tolist():
            own = mu[:, i].astype(total.dtype)
            total = total + own[:, None] * self._raised(i, which)
            error = error + EIGHT * (np.abs(total).max(axis=1) + own * self._rounded_size(i, which))
        top = total.max(axis=1) + error
        better = top < self.top[which]
        at = which[better]
        self.values[at] = total[better].reshape(len(at), *self.values.shape[1:])
        self.error[at], self.top[at], self.penalties[at] = error[better], top[better], mu[better]

    def _raised(self, i: int, which: Indices) -> Array:
        """Coefficients (b, n) of a slack in the degrees of the objective and in its precision."""
        own = self.chunk.slacks[i][which].astype(self.values.dtype)
        degrees = self.stage.enclosed.slacks[i].degrees
        raised = self.stage.elevated(own, degrees, self.chunk.boxes.depth[which])
        return raised.reshape(len(which), -1)

    def _rounded_size(self, i: int, which: Indices) -> Array:
        """How large a slack is on each box (b,), times its roundings over eight.

        A slack is rounded to single precision, and three terms, none above f, the sum or the slack,
        by three operations.
        """
        own = self.chunk.slacks[i][which].reshape(len(which), -1)
        rounds = self.stage.rounds(self.stage.enclosed.slacks[i])
        return np.asarray(np.abs(own).max(axis=1) * rounds)


def _slopes(corners: Array) -> Array:
    """How much values (..., 2^d) at the corners of boxes rise along each axis (..., d), halved."""
    d = corners.shape[-1].bit_length() - 1
    upper = np.array(list(product((-1.0, 1.0), repeat=d))) / 2**d
    return np.asarray(corners @ upper)


def _levelling(g: Array, A: Array) -> Array:
    """Factors mu (b, c), none negative, with the least ``|g + mu A|`` for g (b, d) and A (b, c, d).

    By rounds of best single factors: such a sum of squares has no other resting points.
    """
    square = A @ np.swapaxes(A, 1, 2)
    right = (A @ g[..., None])[..., 0]
    mu = np.zeros_like(right)
    size = np.maximum(np.einsum("bii->bi", square), TINY)
    for _ in range(LEVELLED):
        for i in range(mu.shape[1]):
            rest = right[:, i] + (square[:, i] * mu).sum(axis=1)
            mu[:, i] = np.maximum(mu[:, i] - rest / size[:, i], 0.0)
    return mu


def _best_factors(
    f: Array, c: Array, top: Array, error: Array, size: Array, shift: float
) -> tuple[Array, Array]:
    """The factors mu (b,) for which the largest of ``f + mu c`` is small, and that one (b,).

    ``max_k (f_k + mu c_k)`` is convex in mu, and each trial tells one of its lines. The next trial
    is where the best falling and the best rising line meet, whose height no factor can go below: a
    box that it leaves open is given up.

    Args:
        f: Coefficients (b, n).
        c: Those of a slack.
        top: The largest of f (b,), with its error.
        error: By how much f may be off (b,).
        size: Of what `EIGHT` is the rounding by mu one (b,).
        shift: A box is closed where the largest is no more.
    """
    rows = np.arange(len(f))
    at = f.argmax(axis=1)
    falling = np.stack([f[rows, at], c[rows, at]])
    at = c.argmax(axis=1)
    rising = np.stack([f[rows, at], c[rows, at]])
    best = np.zeros(len(f))
    top = top.copy()
    live = np.flatnonzero(falling[1] < 0)
    for _ in range(PENALTIES):
        apart = rising[1, live] - falling[1, live]
        mu = np.maximum((falling[0, live] - rising[0, live]) / apart, 0.0)
        height = falling[0, live] + mu * falling[1, live]
        hopeful = height <= shift
        live, mu = live[hopeful], mu[hopeful]
        if not len(live):
            break
        # Of all boxes, as at first, a copy would take a third of the time.
        some = slice(None) if len(live) == len(f) else live
        total = c[some] * mu[:, None]
        total += f[some]
        k = total.argmax(axis=1)
        line = np.stack([f[live, k], c[live, k]])
        wrong = error[live] + EIGHT * (np.abs(line[0]) + mu * size[live])
        found = total[np.arange(len(live)), k] + wrong
        better = found < top[live]
        top[live[better]] = found[better]
        best[live[better]] = mu[better]
        falls = line[1] < 0
        falling[:, live[falls]] = line[:, falls]
        rising[:, live[~falls]] = line[:, ~falls]
        live = live[top[live] > shift]
    return best, top


def corners(values: Array) -> Array:
    """Coefficients (b, 2^d) at the corners of boxes."""
    for j in range(1, values.ndim):
        values = values.take([0, -1], axis=j)
    return values.reshape(len(values), -1)
