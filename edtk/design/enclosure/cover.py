"""An upper bound of polynomials over a box and constraints, by halving: branch and bound.

Boxes are closed or halved as `stage.py` says, until no feasible place has an objective above a
level. Levels fall from far above the largest value that is known towards it; each begins with the
boxes that the last one has closed, so that a run that is stopped keeps the bound of all that was
closed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from edtk.design.enclosure.boxes import (
    Boxes,
    Grid,
    Leaves,
    Reason,
    rounding_of_slack,
)
from edtk.design.enclosure.objective import Enclosed
from edtk.design.enclosure.stage import OpenBoxes, Stage, corners
from edtk.system.time_limit import no_progress, out_of_time
from edtk.system.typing import Array, Indices

SMALL_DENOMINATOR = 1e-3  # part of the largest denominator
# A search for a large value that begins nowhere: places that are drawn, and rounds around the best.
DRAWN_PLACES = 4096
SEARCH_ROUNDS = 30
PLACES_AROUND = 64


Progress = Callable[[float, float], object]


class CoveringInterrupted(KeyboardInterrupt):
    """The user has interrupted a covering; `best` is the covering so far, which is one."""

    def __init__(self, best: "Covering") -> None:
        super().__init__("interrupted")
        self.best = best


@dataclass(frozen=True, eq=False)
class Covering:
    """An upper bound of the objectives over all feasible places, and what proves it.

    Attributes:
        enclosed: What is bounded.
        grid: The first boxes.
        leaves: Of each objective the boxes that cover the domain.
        lower: The largest objective that is known of a place that is feasible, within the errors of
            slacks; -inf where none is known.
        place: That place (d,).
        seconds: Time that it took [s].
        boxes: Number of boxes that were looked at.
    """

    enclosed: Enclosed
    grid: Grid
    leaves: tuple[Leaves, ...]
    lower: float
    place: Array
    seconds: float
    boxes: int

    @property
    def upper(self) -> float:
        """No feasible place has an objective above; -inf where no place is feasible."""
        return max(float(leaves.bound.max()) for leaves in self.leaves)


class _Search:
    """The trees of a covering as they grow, and the largest value that is known.

    Args:
        enclosed: What is bounded.
        tolerance: How far U may be above the largest value, in units.
        unit: The unit; None for the largest known value.
        most: A value above which the search ends.
        progress: Called with the level and the part of the domain that is closed at it.
    """

    def __init__(
        self,
        enclosed: Enclosed,
        tolerance: float,
        unit: float | None,
        most: float,
        progress: Progress,
    ) -> None:
        self.enclosed = enclosed
        self.grid = Grid(enclosed.axes)
        self.tolerance = tolerance
        self.given_unit = unit
        self.most = most
        self.progress = progress
        self.lower = -np.inf
        self.highest = -np.inf  # coefficient of a corner that was looked at, at this level
        self.place = np.full(len(enclosed.axes), np.nan)
        self.boxes = 0

    def see(self, places: Array) -> bool:
        """Remember the feasible place of the largest objective, if it is larger than the known."""
        places = np.clip(places, *self.grid.limits)
        feasible = np.ones(len(places), dtype=bool)
        for slack in self.enclosed.slacks:
            # What may be feasible counts: boxes around it cannot be closed as infeasible.
            feasible &= slack(places) >= -slack.error - rounding_of_slack(slack)
        places = places[feasible]
        if not len(places):
            return False
        values = np.max([objective(places) for objective in self.enclosed.objectives], axis=0)
        best = int(values.argmax())
        if not values[best] > self.lower:
            return False
        self.lower = float(values[best])
        self.place = places[best]
        return True

    def draw(self) -> None:
        """Look for a large value: places all over the box, then ever closer to the best one."""
        rng = np.random.default_rng(0)
        low, high = self.grid.limits
        width = high - low
        if not np.isfinite(self.lower):
            self.see(low + width * rng.random((DRAWN_PLACES, len(width))))
        if not np.isfinite(self.lower):
            return
        radius = 0.1
        for _ in range(SEARCH_ROUNDS):
            around = radius * width * rng.normal(size=(PLACES_AROUND, len(width)))
            if not self.see(self.place + around):
                radius /= 2

    @property
    def unit(self) -> float:
        """What tolerances are in parts of."""
        return self.given_unit or abs(self.lower) or 1.0

    def first(self, index: int, earlier: Covering | None, ceiling: float) -> Leaves:
        """Open boxes that cover the domain, with the bound that follows from the first of all."""
        objective = self.enclosed.objectives[index]
        slacks = len(self.enclosed.slacks)
        bound = min(objective.most(self.grid), ceiling)
        if earlier is None:
            boxes = self.grid.first()
            return Leaves.unknown(boxes, np.full(len(boxes), bound), slacks)
        # What is infeasible stays so; of the others nothing is known for another objective.
        known = earlier.leaves[min(index, len(earlier.leaves) - 1)]
        infeasible = known.reason == Reason.INFEASIBLE
        fresh = Leaves.unknown(known.boxes, np.full(len(known), bound), slacks)
        return replace(
            fresh,
            reason=np.where(infeasible, Reason.INFEASIBLE, Reason.OPEN),
            bound=np.where(infeasible, -np.inf, bound),
        )

    def run(self, index: int, leaves: Leaves) -> Leaves:
        """Cover one objective at lower and lower levels, from leaves that cover the domain.

        Raises:
            _Stopped: Time is up, or Ctrl-C; the exception has the leaves so far.
        """
        objective = self.enclosed.objectives[index]
        for above in _levels(*objective.levels, self.tolerance):
            level = self.lower + above * self.unit
            stage = Stage(self.enclosed, objective, self.grid, level)
            leaves = self._descend(stage, leaves, above)
        return leaves

    def _descend(self, stage: Stage, leaves: Leaves, above: float) -> Leaves:
        """Halve boxes until all are closed at a level, which rises where a value is above it.

        Raises:
            _Stopped: See `run`.
        """
        self.highest = -np.inf
        is_open = leaves.bound > stage.level
        closed = [leaves[~is_open]]
        # Ctrl-C finds every box in one of both lists, or in both: one statement takes a box from
        # the second one, after it has got into the first.
        stack: list[Leaves | OpenBoxes] = [leaves[is_open]]
        done = _volume(closed[0].boxes)
        # Where D is small, coefficients and their rounding are.
        gap = above * self.unit * max(stage.least, SMALL_DENOMINATOR * stage.most)
        try:
            while stack:
                if out_of_time() or self.lower > self.most:
                    raise _Stopped(_joined(closed, stack))
                item = stack[-1]
                if isinstance(item, Leaves):
                    stack[-1:] = self._opened(stage, item)
                    continue
                shift = max(0.0, self.lower + above * self.unit - stage.level) * max(
                    stage.least, 0.0
                )
                above_all = stage.above(item)
                known, is_closed, values = stage.close(above_all, shift, gap)
                self.boxes += len(item)
                rest = np.flatnonzero(~is_closed)
                parts: list[OpenBoxes | Leaves] = []
                if len(rest):
                    self._see_corners(stage, above_all, rest, shift)
                    own = replace(
                        item[rest], bound=known.bound[rest], penalties=known.penalties[rest]
                    )
                    for part in stage.split(own, values[rest]):
                        parts.append(part.leaves if stage.is_coarse(part, gap) else part)
                closed.append(known[is_closed])
                stack[-1:] = parts
                done += _volume(known.boxes[is_closed])
                self.progress(above, done / self.grid.parts.prod())
        except KeyboardInterrupt as interrupt:
            raise _Stopped(_joined(closed, stack), interrupt) from None
        return Leaves.joined(closed)

    def _opened(self, stage: Stage, leaves: Leaves) -> "list[Leaves | OpenBoxes]":
        """The first boxes with their coefficients, above the others in a stack."""
        if not len(leaves):
            return []
        rest = leaves[stage.chunk :]
        chunk = stage.opened(leaves[: stage.chunk])
        return [rest, chunk] if len(rest) else [chunk]

    def _see_corners(self, stage: Stage, chunk: OpenBoxes, which: Indices, shift: float) -> None:
        """Look at the corners of boxes, whose coefficients are values."""
        values = corners(chunk.values[which])
        feasible = np.ones(values.shape, dtype=bool)
        for slack in chunk.slacks:
            feasible &= corners(slack[which]) >= 0
        values = np.where(feasible, values, -np.inf)
        box, corner = divmod(int(values.argmax()), values.shape[1])
        wanted = self.lower - stage.level
        # Of a quotient all corners near the largest value may be wanted.
        wanted = max(wanted * (stage.most if wanted < 0 else stage.least), self.highest)
        if not values[box, corner] > wanted:
            return
        self.highest = values[box, corner]
        own = chunk.boxes[which[box : box + 1]]
        side = np.array(np.unravel_index(corner, (2,) * own.depth.shape[1]))
        self.see(self.grid.middles(own) + (2 * side - 1) * self.grid.halves(own))


def _levels(first: float, ratio: float, last: float) -> list[float]:
    """Levels from a first to the last one, each about the same part of the one before."""
    if first <= last:
        return [last]
    steps = max(1, int(np.log(last / first) / np.log(ratio)))
    return np.geomspace(first, last, steps + 1).tolist()


class _Stopped(Exception):
    """A run over boxes has ended early: with leaves, and with Ctrl-C, if that was why."""

    def __init__(self, leaves: Leaves, by: KeyboardInterrupt | None = None) -> None:
        super().__init__("stopped")
        self.leaves = leaves
        self.by = by


def _volume(boxes: Boxes) -> float:
    """Volume of boxes, in boxes of the grid."""
    return float(np.ldexp(1.0, -boxes.depth.sum(axis=1)).sum())


def _joined(closed: list[Leaves], stack: "list[Leaves | OpenBoxes]") -> Leaves:
    """All boxes, once each: those that an interruption has left in both lists are closed."""
    parts = [item if isinstance(item, Leaves) else item.leaves for item in stack]
    leaves = Leaves.joined(closed + parts)
    which = np.concatenate([leaves.boxes.depth, leaves.boxes.place], axis=1)
    _, first = np.unique(which, axis=0, return_index=True)
    return leaves[np.sort(first)]


def cover(
    enclosed: Enclosed,
    tolerance: float,
    known: Array | None = None,
    earlier: Covering | None = None,
    unit: float | None = None,
    most: float = np.inf,
    ceiling: float = np.inf,
    progress: Progress = no_progress,
) -> Covering:
    """Bound objectives over all feasible places of a box, as sharply as the time allows.

    Args:
        enclosed: Objectives, constraints and the box.
        tolerance: Excess of the bound over the largest value that is known, at most.
        known: Places (k, d) where large values are known; without any they are searched.
        earlier: A covering of other objectives over the same box and constraints, whose boxes are
            where this one begins.
        unit: What the tolerance is in parts of; the largest known value by default.
        most: A value above which nobody wants to know more: the covering ends with what it has.
        ceiling: What no objective is above anyway.
        progress: Called with the excess of the present level, and the part of the box that is
            closed at it.

    Raises:
        ValueError: No feasible place was found, or one denominator is not positive.
        CoveringInterrupted: Ctrl-C; the exception has the covering so far.
    """
    began = perf_counter()
    search = _Search(enclosed, tolerance, unit, most, progress)
    if known is None or not search.see(known):
        search.draw()
    if not np.isfinite(search.lower):
        raise ValueError("no feasible place was found; expected one to begin with")
    found: list[Leaves] = []
    stopped: KeyboardInterrupt | None = None
    for index in range(len(enclosed.objectives)):
        leaves = search.first(index, earlier, ceiling)
        if stopped is None:
            try:
                leaves = search.run(index, leaves)
            except _Stopped as early:
                leaves = early.leaves
                stopped = early.by
        found.append(leaves)
    covering = Covering(
        enclosed,
        search.grid,
        tuple(found),
        search.lower,
        search.place,
        perf_counter() - began,
        search.boxes,
    )
    if stopped is not None:
        raise CoveringInterrupted(covering) from stopped
    return covering
