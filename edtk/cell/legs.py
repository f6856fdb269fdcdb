"""Legs: ways from pose to pose with all joints in step, proved free or found to touch.

A controller that moves from pose a to pose b (PTP) turns its joints in proportion: the poses on the
way are ``q(t) = a + t (b - a)``, t from 0 to 1, whatever the profile of its speed. Of two solids
one, a capsule, is carried by a joint j, and the other by a joint i before it or by the world. Seen
from i, where the other one rests, a point p of the capsule moves with

    p'  = sum_k x_k' a_k x (p - o_k)                        i < k <= j,
    p'' = sum_k sum_l x_k' x_l' a_k x (a_l x (p - o_l))     k the earlier one of both,

where the axis a_k goes through o_k, and x' are the rates of the joints in t; a sliding joint has
``x_k' a_k`` in place of a vector product. As ``|p - o_l|`` is at most the length of the links
behind l, there is a bound A on |p''| in all poses. Let m be the unit vector along the shortest way
from the other solid to the capsule, at t. No point of the other one is beyond the plane across m
there, so that the gap g, the distance less the margin, has with both ends p_e of the capsule's
middle line

    g(t + s) >= min_e (g(t) + m . (p_e - p) + s m . p_e') - A s^2/2.

That is conservative advancement (Mirtich, Impulse-based Dynamic Simulation, 1996; Zhang, Lee and
Kim, Continuous Collision Detection, 2006), with the motion bounded to second order along m. It
proves an interval of t about each pose that is looked at; what is left is divided until all is
proved, or a pose is found that touches. Pairs are left out that a lower bound of their distance and
their speed ``max_e |p_e'|`` prove.
"""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from edtk.cell.cell import Cell, Near, Placed, Solids
from edtk.robots.frames import Frames, cross
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices, Mask

# Of the margin [m]: a pose that a search has brought to the margin, and that the controller's
# digits have moved, stands less than this below it. Without a margin nothing may be missing.
TOLERANCE = 5e-4
RESOLUTION = 2e-5  # [m]: a leg whose least gap is so near to what is asked is not proved
# By how much the least gap of a leg may be below the one that is told [m, -].
ABOUT = 1e-3
SHARE = 0.1
FIRST_INTERVALS = 6  # intervals of a leg at first
MOST_PIECES = 8  # into which the rest on one side of a pose is divided at once
LONGER = 1.5  # times the step at one pose, which is hoped for at the next
AT_ONCE = 4096  # poses of one call


@dataclass(frozen=True, eq=False)
class Legs:
    """What is known of some legs.

    Attributes:
        verdict: "free", "touches" or "not proved" (k,).
        clearance: Least distance less the margin that was found on each (k,) [m]. On a free leg no
            pose has less than this by more than a millimetre, or a tenth where that is more.
        pair: The pair of bodies (k,) that has it, of `Cell.pairs`.
        t: Where on the leg that is (k,), from 0 to 1.
    """

    verdict: NDArray[np.str_]
    clearance: Array
    pair: Indices
    t: Array

    @property
    def free(self) -> Mask:
        """Which legs are proved free (k,)."""
        return np.asarray(self.verdict == "free")


def least_gap(cell: Cell) -> float:
    """The gap below which bodies touch [m]: `TOLERANCE` below none, or the margin if it is less."""
    return -min(TOLERANCE, cell.margin)


def prove_legs(cell: Cell, a: Array, b: Array) -> Legs:
    """Prove legs free, or find where they touch.

    A leg is free where no pair of bodies is nearer than the margin less `TOLERANCE`, or than
    nothing where the margin is smaller. It touches where a pose is found in which one is. It is not
    proved where the least gap is within `RESOLUTION` of that.

    Args:
        cell: The bodies.
        a: Where each leg begins (k, n) [rad or m].
        b: Where it ends (k, n).
    """
    return _Proof(cell, np.atleast_2d(a), np.atleast_2d(b)).run()


@dataclass(frozen=True, eq=False)
class _Motion:
    """How fast the capsules of a cell move, seen from the solids to which they may come near.

    A view is a capsule, seen from a joint or the world. A weight that hangs moves as the point does
    from which it hangs, and does not turn: seen from there another capsule moves as it does seen
    from the world, less the motion of that point.

    Attributes:
        robot: The arm.
        solids: The shapes of the cell.
        capsule: The capsule (w,) of each view; -1 for none, which does not move.
        own: The joint (w,) that moves it; -1 for none.
        seen_from: The joint (w,) from which it is seen; -1 for the world.
        view: The view (p,) of the solid of each pair that moves seen from the other one.
        less: The view (p,) of the other one where it hangs, else that of none.
        second_moves: Whether the one that moves is the second one of the pair (p,).
    """

    robot: Robot
    solids: Solids
    capsule: Indices
    own: Indices
    seen_from: Indices
    view: Indices
    less: Indices
    second_moves: Mask

    @classmethod
    def of(cls, cell: Cell) -> "_Motion":
        """The motion of a cell's capsules."""
        solids = cell.solids
        first, lines = solids.first, solids.kinds[0]
        second = np.full(len(first), -1)
        second[lines] = solids.second[lines]
        carrier, other = (np.where(one < 0, -1, solids.carriers[one]) for one in (first, second))
        hangs, other_hangs = solids.hangs[first], (second >= 0) & solids.hangs[second]
        hanging = hangs | other_hangs
        second_moves = np.where(hanging, ~other_hangs & (other >= 0), other > carrier)
        moving = np.where(second_moves, second, first)
        resting = np.where(second_moves, first, second)
        views = np.stack([np.where(hanging, -1, np.minimum(carrier, other)), moving])
        none = np.full(len(first), -1)
        others = np.stack([none, np.where(hanging & (other >= 0), resting, -1)])
        both = np.concatenate([views, others], axis=1)
        (seen_from, capsule), view = np.unique(both, axis=1, return_inverse=True)
        view, less = view.reshape(2, -1)
        own = np.where(capsule < 0, -1, solids.carriers[capsule])
        return cls(cell.robot, solids, capsule, own, seen_from, view, less, second_moves)

    def velocities(self, frames: Frames, ends: Array, rates: Array) -> Array:
        """Velocities of the ends of all views in poses (2, 3, w, m) [m], for t from 0 to 1.

        With ``w = sum x_k' a_k`` and ``u = sum x_k' o_k x a_k`` over the joints up to a body, its
        point p has the velocity ``u + w x p``; those of two bodies are subtracted.

        Args:
            frames: The poses.
            ends: Where both ends of all capsules are (2, 3, K, m) [m].
            rates: By how much the variables of all joints change in a leg (N, m) [rad or m].
        """
        x = rates[:, None]
        slides = frames.prismatic[:, None, None]
        moving = x * frames.axes
        turns = np.where(slides, 0.0, moving)
        moves = np.where(slides, moving, cross(frames.origins, turns))
        # The world does not move: it comes first, so that the joint -1 is at 0.
        w, u = np.zeros((2, 1 + len(turns), *turns.shape[1:]))
        np.cumsum(turns, axis=0, out=w[1:])
        np.cumsum(moves, axis=0, out=u[1:])
        turn = (w[self.own + 1] - w[self.seen_from + 1]).swapaxes(0, 1)
        move = (u[self.own + 1] - u[self.seen_from + 1]).swapaxes(0, 1)
        at = ends[:, :, self.capsule]
        for k in np.flatnonzero(self._hangs):
            at[:, :, k] = self.solids.anchor(frames, int(self.capsule[k]))
        return move + cross(turn[None], at)

    @cached_property
    def _hangs(self) -> Mask:
        """Which views (w,) are of capsules that hang."""
        return np.asarray((self.capsule >= 0) & self.solids.hangs[self.capsule])

    @cached_property
    def _beyond(self) -> Array:
        """How far what moves a view is from the origin of its joint, at most (w,) [m]."""
        solids = self.solids
        ends = np.stack([solids.start, solids.end])
        far = np.linalg.norm(ends, axis=-1).max(axis=0)
        far = np.where(solids.hangs, np.linalg.norm(solids.anchors, axis=-1), far)
        return np.asarray(far[self.capsule])

    @cached_property
    def _between(self) -> Mask:
        """Which joints (w, N) move a view: those behind where it is seen from, up to its own."""
        joints = np.arange(len(self.robot.chain))
        return (joints > self.seen_from[:, None]) & (joints <= self.own[:, None])

    @cached_property
    def _reach(self) -> Array:
        """How far the ends of a view can be from the origin of each joint (w, N) [m]."""
        chain = self.robot.chain
        links = [float(np.linalg.norm(joint.origin[:3, 3])) for joint in chain]
        slides = [max(map(abs, one.limits)) if one.kind == "prismatic" else 0.0 for one in chain]
        behind = np.cumsum([0.0, *(a + b for a, b in zip(links, slides, strict=True))])
        reach = behind[self.own + 1][:, None] - behind[1:] + self._beyond[:, None]
        return np.where(self._between, reach, 0.0)

    def bends(self, rates: Array) -> Array:
        """Bounds on the accelerations of the ends of all views, in any pose.

        ``sum_l |x_l'| |p - o_l| (|x_l'| + 2 sum_{k < l} |x_k'|)`` over the joints between both
        bodies, where k turns; of a joint l that slides, ``2 |x_l'| sum_{k < l} |x_k'|``.

        Args:
            rates: By how much the variables of all joints change in a leg (k, N) [rad or m].

        Returns:
            Bounds (w, k) [m], for t from 0 to 1.
        """
        slides = self.robot.chain_slides
        x = np.abs(rates)[:, None] * self._between
        turning = np.where(slides, 0.0, x)
        before = np.cumsum(turning, axis=-1) - turning
        terms = np.where(slides, 2 * x * before, x * self._reach * (x + 2 * before))
        return np.asarray(terms.sum(axis=-1).T)


# Motions of cells that are in use: people and planners ask for one leg after another.
_motions: WeakKeyDictionary[Cell, _Motion] = WeakKeyDictionary()


class _Proof:
    """The proof of some legs on its way: intervals that are left, and the least gaps so far."""

    def __init__(self, cell: Cell, a: Array, b: Array) -> None:
        self.cell = cell
        self.motion = _motions.get(cell) or _motions.setdefault(cell, _Motion.of(cell))
        self.a = a
        self.way = b - a
        ties = cell.robot.ties
        self.rates = self.way if ties is None else self.way @ ties.matrix.T
        self.bends = self.motion.bends(self.rates)
        self.least_allowed = least_gap(cell)
        self.gap = np.full(len(a), np.inf)
        self.pair = np.zeros(len(a), dtype=int)
        self.t = np.zeros(len(a))
        self.stuck = np.zeros(len(a), dtype=bool)

    def run(self) -> Legs:
        """Look at intervals until none is left."""
        edges = np.linspace(0.0, 1.0, FIRST_INTERVALS + 1)
        # Both ends are poses that people ask about: they are looked at themselves.
        low, high = np.append([0.0, 1.0], edges[:-1]), np.append([0.0, 1.0], edges[1:])
        legs = len(self.a) if self.cell.pairs else 0
        leg = np.repeat(np.arange(legs), len(low))
        low, high = (np.tile(one, legs) for one in (low, high))
        while True:
            done = self.stuck | (self.gap < self.least_allowed)
            going_on = ~done[leg]
            leg, low, high = leg[going_on], low[going_on], high[going_on]
            if not len(leg):
                break
            rest = self._look(leg[:AT_ONCE], low[:AT_ONCE], high[:AT_ONCE])
            leg = np.concatenate([rest[0], leg[AT_ONCE:]])
            low = np.concatenate([rest[1], low[AT_ONCE:]])
            high = np.concatenate([rest[2], high[AT_ONCE:]])
        free = np.where(self.stuck, "not proved", "free")
        verdict = np.where(self.gap < self.least_allowed, "touches", free)
        return Legs(verdict, self.gap, self.pair, self.t)

    def _asked(self, leg: Indices) -> Array:
        """The gap (m,) that is to be proved for legs (m,) that were looked at [m]."""
        gap = self.gap[leg]
        told = gap - np.maximum(ABOUT, SHARE * gap)
        return np.maximum(told, self.least_allowed)

    def _look(self, leg: Indices, low: Array, high: Array) -> tuple[Indices, Array, Array]:
        """Look at the middles of intervals; what they do not prove is left."""
        t, half = (low + high) / 2, (high - low) / 2
        q = self.a[leg] + t[:, None] * self.way[leg]
        frames = self.cell.frames(q)
        solids, motion = self.cell.solids, self.motion
        placed = solids.placed(frames)
        velocity = motion.velocities(frames, np.stack(placed), self.rates[leg].T)
        bends = self.bends[:, leg]
        speed = np.sqrt(np.einsum("ecwm,ecwm->ewm", velocity, velocity).max(axis=0))
        wander = speed * half + bends * half**2 / 2
        wander = wander[motion.view] + wander[motion.less]
        # One distance a pose tells about how much is to be proved, before all others are taken.
        bounds = solids.bounds(placed)
        self._keep_least(leg, t, solids.exactly(placed, bounds.argmin(axis=0), np.arange(len(q))))
        floor = self._asked(leg) + self.cell.margin
        pair, pose = np.nonzero(bounds < floor + wander)
        near = solids.exactly(placed, pair, pose)
        self._keep_least(leg, t, near)
        view, less = motion.view[near.pair], motion.less[near.pair]
        height, pace = self._beyond_planes(near, placed, velocity)
        room = height - self._asked(leg[near.pose])
        bend = bends[view, near.pose] + bends[less, near.pose]
        forward, back = _step(room, pace, bend), _step(room, -pace, bend)
        going_on = np.minimum(forward, back) < half[near.pose]
        further = going_on & (wander[near.pair, near.pose] >= RESOLUTION)
        missing, divisible = np.zeros((2, len(leg)), dtype=bool)
        missing[near.pose[going_on]] = True
        divisible[near.pose[further]] = True
        self.stuck[leg[missing & ~divisible]] = True
        sides = []
        for step, sign in ((forward, 1.0), (back, -1.0)):
            reach = np.full(len(leg), np.inf)
            np.minimum.at(reach, near.pose, step)
            left = np.flatnonzero(reach < half)
            sides.append(_divided(leg[left], t[left], half[left], reach[left], sign))
        rest, low, high = (np.concatenate(both) for both in zip(*sides, strict=True))
        return rest, low, high

    def _beyond_planes(self, near: Near, placed: Placed, velocity: Array) -> tuple[Array, Array]:
        """How far the ends of capsules are beyond the planes that bound the other solids.

        Returns:
            The gaps (2, k) of both ends [m], and their slopes (2, k) by t.
        """
        solids, motion = self.cell.solids, self.motion
        pair, pose, found = near
        ends, view = np.stack(placed), motion.view[pair]
        moving = ends[:, :, motion.capsule[view], pose]
        behind = motion.second_moves[pair]
        normal = np.where(behind, -found.normal, found.normal)
        height = np.einsum("ck,eck->ek", normal, moving - found.point) + found.distance
        # The plane that bounds a capsule touches the farther one of its ends.
        lines = np.flatnonzero(pair < solids.kinds[0].stop)
        first, second = solids.first[pair[lines]], solids.second[pair[lines]]
        still = ends[:, :, np.where(behind[lines], first, second), pose[lines]]
        apart = moving[:, None, :, lines] - still
        along = np.einsum("ck,efck->efk", normal[:, lines], apart).min(axis=1)
        height[:, lines] = along - solids.radius[first] - solids.radius[second]
        relative = velocity[:, :, view, pose] - velocity[:, :, motion.less[pair], pose]
        pace = np.einsum("ck,eck->ek", normal, relative)
        return height - self.cell.margin, pace

    def _keep_least(self, leg: Indices, t: Array, near: Near) -> None:
        """Take over smaller gaps of some poses."""
        gap = near.nearest.distance - self.cell.margin
        of = leg[near.pose]
        order = np.lexsort((gap, of))
        first = order[np.unique(of[order], return_index=True)[1]]
        better = first[gap[first] < self.gap[of[first]]]
        self.gap[of[better]] = gap[better]
        self.pair[of[better]] = self.cell.solids.bodies[near.pair[better]]
        self.t[of[better]] = t[near.pose[better]]


def _step(room: Array, pace: Array, bend: Array) -> Array:
    """The largest s (k,) with ``room + pace s - bend s^2/2 >= 0`` for both ends (2, k).

    Nothing where an end has no room; infinite where it never ends. Of both forms of the root the
    one is taken in which nothing cancels.
    """
    root = np.sqrt(pace**2 + 2 * bend * np.maximum(room, 0.0))
    toward = pace < 0
    above = np.where(toward, 2 * room, pace + root)
    below = np.where(toward, root - pace, bend)
    step = np.divide(above, below, out=np.full_like(room, np.inf), where=below > 0)
    return np.asarray(np.where(room > 0, step, 0.0).min(axis=0))


def _divided(
    leg: Indices, t: Array, half: Array, reach: Array, sign: float
) -> tuple[Indices, Array, Array]:
    """What a step does not prove on one side of poses, in pieces that the next ones may prove."""
    rest = half - reach
    pieces = np.ceil(rest / np.maximum(2 * LONGER * reach, rest / MOST_PIECES)).astype(int)
    which = np.repeat(np.arange(len(leg)), pieces)
    place = np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    width = rest[which] / pieces[which]
    start = t[which] + sign * (reach[which] + place * width)
    end = start + sign * width
    return leg[which], np.minimum(start, end), np.maximum(start, end)
