"""Ways: legs from pose to pose that are free, directly or by via poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from edtk.cell.cell import Cell
from edtk.cell.legs import Legs, least_gap, prove_legs
from edtk.system.typing import Array, Indices, Mask

# Of the planner: rounds in which each of two trees grows in turn by so many legs, and how far one
# reaches, as a share of the time that the arm takes from one end of its ranges to the other.
PLANNER_ROUNDS = 60
BRANCHES = 16
STRETCH = 0.35
UNKNOWN, FREE, TOUCHES, NOT_PROVED = range(4)
VERDICTS = ("unknown", "free", "touches", "not proved")
SHORT_LEG = 1e-9  # of a leg: shorter ones are not divided by
LEAST_GAIN = 1e-9  # relative: what is not more is rounding


@dataclass(frozen=True, eq=False)
class Speeds:
    """How fast joints turn or slide when the arm drives from pose to pose.

    All joints begin and end together, so that the one that takes longest decides:
    ``max_j |b_j - a_j| / v_j``. That is a metric: no way by another pose is quicker.

    Attributes:
        of: Speed of each joint (n,) [rad/s or m/s].
    """

    of: Array

    def seconds(self, a: Array, b: Array) -> Array:
        """Time of the legs from a (..., n) to b (..., n) [s]."""
        return np.asarray((np.abs(b - a) / self.of).max(axis=-1))


@dataclass(frozen=True, eq=False)
class Leg:
    """What is known of one leg.

    Attributes:
        start: Where it begins (n,) [rad or m].
        end: Where it ends (n,) [rad or m].
        verdict: "free", "touches" or "not proved".
        clearance: Least distance less the margin that was found on it [m]; see `Legs`.
        pair: The names of the two bodies that have it; None where there is nothing to look at.
        t: Where on the leg that is, from 0 to 1.
    """

    start: Array
    end: Array
    verdict: str
    clearance: float
    pair: tuple[str, str] | None
    t: float


@dataclass(frozen=True, eq=False)
class Way:
    """Free legs from a pose to another one.

    Attributes:
        legs: The legs, each from where the one before ends.
        seconds: How long it takes to drive them [s].
    """

    legs: tuple[Leg, ...]
    seconds: float

    @property
    def q(self) -> Array:
        """All poses (s, n), both ends and the via poses between them [rad or m]."""
        return np.array([self.legs[0].start, *(leg.end for leg in self.legs)])

    @property
    def via(self) -> Array:
        """The via poses (s - 2, n) [rad or m]."""
        return self.q[1:-1]

    @property
    def nearest(self) -> Leg:
        """The leg on which bodies are nearest."""
        return min(self.legs, key=lambda leg: leg.clearance)

    @property
    def clearance(self) -> float:
        """Least distance less the margin that was found on it [m]."""
        return self.nearest.clearance


@dataclass(frozen=True, eq=False)
class DrivenWay:
    """How an arm gets from one row of a plan to another one.

    Attributes:
        rows: Indices of both rows, None for home.
        direct: What is known of the direct leg.
        way: The free way that it takes; None where none was found.
    """

    rows: tuple[int | None, int | None]
    direct: Leg
    way: Way | None

    @property
    def nearest(self) -> Leg:
        """The leg on which bodies are nearest: of the way, or the one that is not free."""
        return self.direct if self.way is None else self.way.nearest


class Roadmap:
    """Poses and the legs between them, which are proved when they are asked for.

    No leg leads to a pose in which something touches.

    A way between two poses is looked for among all poses of the map, by time: the quickest way over
    legs that are not known to touch is looked at, its legs are proved, and so on until all of it is
    free (Bohlin and Kavraki, Path Planning Using Lazy PRM, 2000). Where the map has none, two trees
    grow from both poses until they meet (Kuffner and LaValle, RRT-Connect, 2000), and the poses
    where they do join the map. The same poses and seed give the same ways.
    """

    def __init__(
        self,
        cell: Cell | None,
        q: Array,
        speeds: Speeds,
        limits: Sequence[Array],
        seed: int = 0,
    ) -> None:
        """Make a map of poses, without any leg.

        Args:
            cell: What legs may touch; None for a robot that nothing surrounds.
            q: The poses (k, n) [rad or m].
            speeds: How fast the joints are.
            limits: Lower and upper limits (2, n) of via poses [rad or m]; later ones of several are
                tried where no way is found within those before.
            seed: Seed of the planner.
        """
        self.cell = cell
        self.speeds = speeds
        self.limits = limits
        self.seed = seed
        self.q = np.zeros((0, q.shape[1]))
        self.shut = np.zeros(0, dtype=bool)
        self.state = np.zeros((0, 0), dtype=int)
        self.gap = np.zeros((0, 0))
        self.pair = np.zeros((0, 0), dtype=int)
        self.t = np.zeros((0, 0))
        self.seconds = np.zeros((0, 0))
        self._apart: set[tuple[int, int]] = set()
        self._add(q)

    def _add(self, q: Array) -> Indices:
        """Add poses; returns their numbers."""
        before = len(self.q)
        self.q = np.concatenate([self.q, q])
        shut = np.zeros(len(q), dtype=bool)
        if self.cell is not None:
            shut = self.cell.clearance(q).least < least_gap(self.cell)
        self.shut = np.concatenate([self.shut, shut])
        more = ((0, len(q)), (0, len(q)))
        names = ("state", "pair", "t")
        for name in names:
            setattr(self, name, np.pad(getattr(self, name), more))
        self.gap = np.pad(self.gap, more, constant_values=np.inf)
        self.seconds = self.speeds.seconds(self.q[:, None], self.q)
        np.fill_diagonal(self.state, FREE)
        return np.arange(before, len(self.q))

    def prove(self, a: Indices, b: Indices) -> None:
        """Find out of the legs between poses (k,) and poses (k,) whether they are free."""
        low, high = np.minimum(a, b), np.maximum(a, b)
        asked = np.unique(np.stack([low, high], axis=1)[self.state[low, high] == UNKNOWN], axis=0)
        if not len(asked):
            return
        low, high = asked.T
        if self.cell is None:
            self.state[low, high] = self.state[high, low] = FREE
            return
        self._enter(low, high, prove_legs(self.cell, self.q[low], self.q[high]))

    def _enter(self, a: Indices, b: Indices, legs: Legs) -> None:
        """Take over what is known of legs."""
        for i, j, t in ((a, b, legs.t), (b, a, 1 - legs.t)):
            self.state[i, j] = [VERDICTS.index(verdict) for verdict in legs.verdict]
            self.gap[i, j] = legs.clearance
            self.pair[i, j] = legs.pair
            self.t[i, j] = t

    def way(self, a: int, b: int) -> Way | None:
        """The quickest way between two poses, by their numbers; None where none was found."""
        places = self._places(a, b)
        if places is None:
            return None
        legs = tuple(self.leg(i, j) for i, j in pairwise(places))
        return Way(legs, float(self.seconds[places[:-1], places[1:]].sum()))

    def leg(self, a: int, b: int) -> Leg:
        """What is known of the leg between two poses, by their numbers."""
        self.prove(np.array([a]), np.array([b]))
        pair = None
        if self.cell is not None and self.cell.pairs:
            pair = self.cell.pairs[self.pair[a, b]]
        clearance, t = float(self.gap[a, b]), float(self.t[a, b])
        return Leg(self.q[a], self.q[b], VERDICTS[self.state[a, b]], clearance, pair, t)

    def _places(self, a: int, b: int) -> list[int] | None:
        """Numbers of the poses of the quickest way."""
        if self.shut[[a, b]].any():
            return None
        places = self._known(a, b)
        if places is not None or self._is_apart(a, b):
            return places
        tries = (self._connect(a, b, limits) for limits in self.limits)
        found = next((via for via in tries if via is not None), None)
        if found is None:
            self._apart.add((a, b))
            return None
        between = self._add(found)
        chain = np.concatenate([[a], between, [b]])
        self.prove(chain[:-1], chain[1:])
        return self._known(a, b)

    def _known(self, a: int, b: int) -> list[int] | None:
        """The quickest way by poses of the map, all legs of which are proved."""
        while True:
            places = _quickest(np.where(self.state > FREE, np.inf, self.seconds), a, b)
            if places is None:
                return None
            first, second = np.array(places[:-1]), np.array(places[1:])
            if (self.state[first, second] == FREE).all():
                return places
            self.prove(first, second)

    def _is_apart(self, a: int, b: int) -> bool:
        """Whether the planner found no way between two poses from which these can be reached."""
        from scipy.sparse.csgraph import connected_components

        region = connected_components(self.state == FREE, directed=False)[1]
        return any({region[i], region[j]} == {region[a], region[b]} for i, j in self._apart)

    def _connect(self, a: int, b: int, limits: Array) -> Array | None:
        """Via poses (s, n) within limits of a free way that the planner found, or None."""
        rng = np.random.default_rng([self.seed, a, b])
        trees = _Tree(self.q[a]), _Tree(self.q[b])
        ends = self.q[[a, b]]
        lower, upper = (
            np.minimum(limits[0], ends.min(0)),
            np.maximum(limits[1], ends.max(0)),
        )
        stretch = STRETCH * float(self.speeds.seconds(lower, upper))
        for turn in range(PLANNER_ROUNDS):
            grown, other = trees[turn % 2], trees[1 - turn % 2]
            drawn = lower + (upper - lower) * rng.random((BRANCHES, len(lower)))
            new = self._grow(grown, drawn, stretch)
            if not len(new):
                continue
            # Each new pose looks for the other tree, all the way.
            seconds = self.speeds.seconds(grown.q[new][:, None], other.q)
            nearest = seconds.argmin(axis=1)
            met = np.flatnonzero(self._free(grown.q[new], other.q[nearest]))
            if len(met):
                best = met[seconds.min(axis=1)[met].argmin()]
                branches = grown.branch(new[best]), other.branch(nearest[best])
                first, second = branches if turn % 2 == 0 else branches[::-1]
                return np.concatenate([first[1:], second[:0:-1]])
        return None

    def _grow(self, tree: "_Tree", drawn: Array, stretch: float) -> Indices:
        """Grow a tree towards drawn poses (k, n); returns the numbers of what was added."""
        seconds = self.speeds.seconds(drawn[:, None], tree.q)
        parent = seconds.argmin(axis=1)
        share = np.minimum(1.0, stretch / np.maximum(seconds.min(axis=1), stretch * SHORT_LEG))
        start = tree.q[parent]
        end = start + share[:, None] * (drawn - start)
        free = self._free(start, end)
        return tree.add(end[free], parent[free])

    def _free(self, a: Array, b: Array) -> Mask:
        """Which legs (k,) are proved free, to poses that joints which are coupled can take."""
        assert self.cell is not None
        bounds = self.cell.robot.bounds.coupled
        lower, upper = bounds.limits
        values = bounds.values(b)
        free = ((values >= lower) & (values <= upper)).all(axis=1) & self.cell.free(b)
        free[free] = prove_legs(self.cell, a[free], b[free]).free
        return np.asarray(free)


class _Tree:
    """Poses, each but the first with the one from which a free leg leads to it."""

    def __init__(self, root: Array) -> None:
        self.q = root[None]
        self.parent = np.full(1, -1)

    def add(self, q: Array, parent: Indices) -> Indices:
        """Add poses (k, n) behind their parents (k,); returns their numbers."""
        before = len(self.q)
        self.q = np.concatenate([self.q, q])
        self.parent = np.concatenate([self.parent, parent])
        return np.arange(before, len(self.q))

    def branch(self, tip: int) -> Array:
        """The poses (s, n) from the first one to another."""
        places = [int(tip)]
        while self.parent[places[-1]] >= 0:
            places.append(int(self.parent[places[-1]]))
        return np.asarray(self.q[places[::-1]])


def _quickest(seconds: Array, a: int, b: int) -> list[int] | None:
    """The quickest way between two places (Dijkstra 1959), of the fewest legs among equal ones.

    Args:
        seconds: Time of each leg (k, k) [s]; inf where there is none.
        a: Where it begins.
        b: Where it ends.
    """
    time = seconds[a].copy()
    before = np.full(len(time), a)
    done = np.zeros(len(time), dtype=bool)
    done[a] = True
    while True:
        at = int(np.where(done, np.inf, time).argmin())
        if done[at] or not np.isfinite(time[at]):
            return None
        if at == b:
            break
        done[at] = True
        by = time[at] + seconds[at]
        sooner = by < time - LEAST_GAIN * time[at]
        time[sooner] = by[sooner]
        before[sooner] = at
    places = [b]
    while places[-1] != a:
        places.append(int(before[places[-1]]))
    return places[::-1]
