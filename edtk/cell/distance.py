"""Distances between segments and convex solids: of many pairs at once, with the direction.

A capsule is what lies within a radius of a segment, so the distance of two capsules is that of
their segments less both radii. The signed distance f of a point x to a convex solid is convex, and
changes by no more than x moves (Boyd and Vandenberghe, Convex Optimization, 8.1): along a segment
it is a convex function of one variable, whose least value is that of the segment. With it a bound
follows from one point: the distance of a segment is that of its middle, less half its length, at
least.

Arrays are component first: points are (3, k), so that each operation runs over contiguous pairs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from criteria.linalg.inverse import TINY
from edtk.system.typing import Array, Indices, Mask

# Signed distance (k,) [m] of points (3, k), and the direction (3, k) in which it grows.
Signed = Callable[[Array, Indices], tuple[Array, Array]]

ACCURACY = 1e-9  # of a distance [m]: far below what is known of any body
# Steps of the search along a segment. A step leaves a quarter of the error of a smooth function at
# most, and kinks are met exactly: fifteen are the rule, from a metre down to the accuracy.
STEPS = 60


@dataclass(frozen=True, eq=False)
class Nearest:
    """How far segments are from other solids, and where.

    Attributes:
        distance: Signed distance (k,) [m]; negative inside a solid.
        normal: Derivatives (3, k) of the distance where the segment moves against the solid: unit
            vectors out of it, or shorter ones where the distance to several faces is the same.
        point: The nearest points (3, k) of the segments, or the deepest ones [m].
    """

    distance: Array
    normal: Array
    point: Array

    def put(self, chosen: Indices, others: "Nearest") -> None:
        """Put others in the place of those that are chosen."""
        self.distance[chosen] = others.distance
        self.normal[:, chosen] = others.normal
        self.point[:, chosen] = others.point


def segment_to_segment(a: Array, b: Array, c: Array, d: Array) -> Nearest:
    """Distances of the segments from a to b and those from c to d, in closed form.

    The squared distance of ``a + s u`` and ``c + t v`` is quadratic. Its least value over the lines
    has ``s = ((u.v)(v.r) - (u.r)(v.v)) / ((u.u)(v.v) - (u.v)^2)`` with r = a - c; s is cut to
    [0, 1], t is the best one for it, and where that is cut too, s the best for the end
    (Ericson, Real-Time Collision Detection, 2005, 5.1.9). Of parallel lines any s begins.

    Args:
        a: One end (3, k) of the first segments [m]; a segment may be a point.
        b: Their other end (3, k).
        c: One end (3, k) of the second segments.
        d: Their other end (3, k).

    Returns:
        Distances, and the nearest points of the first segments.
    """
    u, v, r = b - a, d - c, a - c
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    ur, vr = dot(u, r), dot(v, r)
    s = np.clip((uv * vr - ur * vv) / np.maximum(uu * vv - uv * uv, TINY), 0.0, 1.0)
    t = np.clip((uv * s + vr) / np.maximum(vv, TINY), 0.0, 1.0)
    s = np.clip((uv * t - ur) / np.maximum(uu, TINY), 0.0, 1.0)
    point = a + s * u
    apart = point - (c + t * v)
    distance = np.sqrt(dot(apart, apart))
    crossing = distance < ACCURACY
    if crossing.any():
        # Segments that cross have no direction of their own: they part fastest across both.
        apart = np.where(crossing, _across(u, v), apart)
    return Nearest(distance, unit(apart), point)


def segment_to_plane(a: Array, b: Array, normal: Array, offset: Array) -> Nearest:
    """Distances of segments from a to b (3, k) above half spaces ``normal . x <= offset``."""
    heights = np.stack([dot(normal, a), dot(normal, b)]) - offset
    first = heights[0] <= heights[1]
    return Nearest(heights.min(axis=0), normal + 0.0 * a, np.where(first, a, b))


def segment_to_convex(
    a: Array, b: Array, signed: Signed, beyond: Array | float = np.inf
) -> Nearest:
    """Distances of the segments from a to b to convex solids.

    ``f(t) = signed(a + t (b - a))`` is convex. Its tangents at both ends of a bracket meet at a
    lower bound of its least value, and the search ends where that is as low as the best point. The
    next point is where they meet, which finds kinks, or in turn where the slopes would be zero if
    they were linear, which finds the least value of a parabola.

    Between the ends, the direction is the mean of those at the ends of the bracket along which the
    segment itself is level: at a kink, inside a solid, neither of both is the derivative of the
    least value, and this one is.

    Args:
        a: One end (3, k) of the segments [m], in the frame of the solid.
        b: The other end (3, k).
        signed: Signed distance and direction of points; also takes the indices of their segments.
        beyond: Distances (k,), or one, from which on nobody asks: a segment that is farther has any
            distance above.

    Returns:
        Distances, directions and nearest points.
    """
    beyond = np.broadcast_to(beyond, a.shape[1:])
    every = np.arange(a.shape[1])
    way = b - a
    at_a, at_b = signed(a, every), signed(b, every)
    first = at_a[0] <= at_b[0]
    found = Nearest(
        *(np.where(first, low, high) for low, high in (*zip(at_a, at_b, strict=True), (a, b)))
    )
    bracket = _Bracket(
        _End(np.zeros(len(every)), *at_a, dot(at_a[1], way)),
        _End(np.ones(len(every)), *at_b, dot(at_b[1], way)),
    )
    # Where the distance grows from one end, or falls up to the other, that end is the nearest.
    left = np.flatnonzero((bracket.low.slope < 0) & (bracket.high.slope > 0))
    bracket = bracket.some(left)
    for step in range(STEPS):
        bound, meet = bracket.meeting()
        done = (found.distance[left] - bound <= ACCURACY) | (bound >= beyond[left])
        if done.any():
            over = left[done]
            t, found.normal[:, over] = bracket.some(done).level()
            level, meeting = (a[:, over] + at * way[:, over] for at in (t, meet[done]))
            # A smooth function is least where it is level, one with a kink where tangents meet.
            smooth = signed(level, over)[0] <= found.distance[over] + ACCURACY
            found.point[:, over] = np.where(smooth, level, meeting)
            left, bracket, meet = left[~done], bracket.some(~done), meet[~done]
        if not len(left):
            break
        t = meet if step % 2 else bracket.level()[0]
        own = way[:, left]
        value, normal = signed(a[:, left] + t * own, left)
        found.distance[left] = np.minimum(found.distance[left], value)
        bracket = bracket.narrowed(_End(t, value, normal, dot(normal, own)))
    return found


def segment_to_box(a: Array, b: Array, half: Array, beyond: Array | float = np.inf) -> Nearest:
    """Distances of the segments from a to b to boxes about the origin, along the axes.

    Half the squared distance of ``x = a + t u`` from a box has the slope
    ``sum_i u_i sign(x_i) max(|x_i| - half_i, 0)`` by t. It never falls, and is linear between the
    places where the segment passes the planes of the faces: it is zero between the last of these at
    which it is negative and the next one. Of segments that enter a box, inside of which no square
    tells the depth, the deepest points are searched.

    Args:
        a: One end (3, k) of the segments [m], in the frame of the box.
        b: The other end (3, k).
        half: Half of each edge (3, k) [m].
        beyond: See `segment_to_convex`.
    """
    way = b - a
    steep = np.where(np.abs(way) < TINY, TINY, way)
    t = np.concatenate([(half - a) / steep, (-half - a) / steep, np.zeros((2, a.shape[1]))])
    t[-1] = 1.0
    t = np.sort(np.clip(t, 0.0, 1.0, out=t), axis=0)
    x = a[:, None] + t * way[:, None]
    slope = np.einsum("ck,cmk->mk", way, _outside(x, half[:, None]))
    falling = (slope < 0).sum(axis=0)
    each = np.arange(a.shape[1])
    low, high = np.maximum(falling - 1, 0), np.minimum(falling, len(t) - 1)
    from_low, rise = -slope[low, each], slope[high, each] - slope[low, each]
    share = np.clip(from_low / np.maximum(rise, TINY), 0.0, 1.0)
    at = t[low, each] + share * (t[high, each] - t[low, each])
    point = a + at * way
    apart = _outside(point, half)
    found = Nearest(np.sqrt(dot(apart, apart)), unit(apart), point)
    entering = np.flatnonzero(found.distance < ACCURACY)
    if len(entering):
        ends, sizes = (a[:, entering], b[:, entering]), half[:, entering]
        beyond = np.broadcast_to(beyond, each.shape)[entering]
        deep = segment_to_convex(*ends, lambda x, i: signed_box(x, sizes[:, i]), beyond)
        found.put(entering, deep)
    return found


def _outside(x: Array, half: Array) -> Array:
    """Ways (3, ...) to points (3, ...) from the nearest points of boxes."""
    return np.copysign(np.maximum(np.abs(x) - half, 0.0), x)


class _End(NamedTuple):
    """Points on segments: part of the way t (k,), distance, direction (3, k), and slope by t."""

    t: Array
    value: Array
    normal: Array
    slope: Array

    def some(self, chosen: Indices | Mask) -> "_End":
        """Some of them."""
        return _End(*(one[..., chosen] for one in self))


class _Bracket(NamedTuple):
    """Points with a falling and with a rising distance, between which it is least."""

    low: _End
    high: _End

    def some(self, chosen: Indices | Mask) -> "_Bracket":
        """Some of them."""
        return _Bracket(self.low.some(chosen), self.high.some(chosen))

    def meeting(self) -> tuple[Array, Array]:
        """Where the tangents at both ends meet: their value (k,), and the place t (k,)."""
        low, high = self
        steepening = np.maximum(high.slope - low.slope, TINY)
        rise = low.value - low.slope * low.t - (high.value - high.slope * high.t)
        meet = np.clip(rise / steepening, low.t, high.t)
        return low.value + low.slope * (meet - low.t), meet

    def level(self) -> tuple[Array, Array]:
        """Where the slope is zero if it is linear (k,), and the direction there (3, k)."""
        low, high = self
        share = -low.slope / np.maximum(high.slope - low.slope, TINY)
        normal = low.normal + share * (high.normal - low.normal)
        return low.t + share * (high.t - low.t), normal

    def narrowed(self, inside: _End) -> "_Bracket":
        """The brackets with a point inside as their new low or high end, as its slope says."""
        falls = inside.slope < 0
        low, high = (
            _End(*(np.where(falls, x, y) for x, y in zip(one, other, strict=True)))
            for one, other in ((inside, self.low), (self.high, inside))
        )
        return _Bracket(low, high)


def signed_box(x: Array, half: Array) -> tuple[Array, Array]:
    """Signed distance of points to boxes about the origin, along the axes.

    With ``d = |x| - half`` it is ``|max(d, 0)|`` outside, and the largest d inside.

    Args:
        x: Points (3, ...) [m].
        half: Half of each edge (3, ...) [m].

    Returns:
        Distances (...), and the directions (3, ...) in which they grow.
    """
    distance, direction = _signed_corner(np.abs(x) - half)
    return distance, np.copysign(direction, x)


def signed_cylinder(x: Array, radius: Array, half_height: Array) -> tuple[Array, Array]:
    """Signed distance of points (3, ...) to cylinders about the z-axis, as of a box, by (r, z)."""
    r = np.hypot(x[0], x[1])
    beyond = np.stack([r - radius, np.abs(x[2]) - half_height])
    distance, (outward, up) = _signed_corner(beyond)
    on_axis = r < TINY
    r = np.where(on_axis, 1.0, r)
    cosine = np.where(on_axis, 1.0, x[0] / r)
    return distance, np.stack([outward * cosine, outward * x[1] / r, np.copysign(up, x[2])])


def _signed_corner(beyond: Array) -> tuple[Array, Array]:
    """Signed distance (...) to a corner for how far points are beyond its faces (c, ...) [m].

    Returns:
        Distances, and their derivatives (c, ...) by how far points are beyond.
    """
    outside = np.maximum(beyond, 0.0)
    length = np.sqrt(np.einsum("c...,c...->...", outside, outside))
    deepest = beyond.max(axis=0)
    inside = deepest <= 0
    distance = np.where(inside, deepest, length)
    face = np.arange(len(beyond)).reshape(-1, *[1] * deepest.ndim) == beyond.argmax(axis=0)
    direction = np.where(inside, face, outside / np.maximum(length, TINY))
    return distance, direction


def dot(a: Array, b: Array) -> Array:
    """Sums of products (k,) of vectors (3, k)."""
    return np.asarray(np.einsum("ck,ck->k", a, b))


def unit(v: Array) -> Array:
    """Unit vectors (3, k) along vectors (3, k)."""
    return np.asarray(v / np.maximum(np.sqrt(dot(v, v)), TINY))


def _across(u: Array, v: Array) -> Array:
    """Vectors (3, k) across both of two; where these are parallel, across the first."""
    both = np.cross(u, v, axis=0)
    parallel = dot(both, both) <= ACCURACY**2 * np.maximum(dot(u, u) * dot(v, v), TINY)
    if not parallel.any():
        return both
    # The axis that is the least along u gives a vector that is clearly across it.
    axis = np.eye(3)[:, np.abs(u).argmin(axis=0)]
    one = np.cross(u, axis, axis=0)
    point = dot(u, u) <= TINY
    one = np.where(point, axis, one)
    return np.where(parallel, one, both)
