"""A weight on a rope that hangs from a point of the arm, and all places where it swings to."""

from itertools import pairwise

import numpy as np

from edtk.cell.containing import containing
from edtk.cell.shapes import Body, Capsule
from edtk.system.typing import Array

SIDES = 24  # of the prism around what is round
ARC = 8  # points of the arc on which the weight's lower rim swings
MOST = 4  # capsules that hold all places of the weight
TIGHT = 0.01  # [m], see `containing`


def hanging_bodies(
    name: str,
    carrier: int,
    point: Array,
    *,
    rope: float,
    radius: float,
    height: float,
    swing: float,
    rope_radius: float,
) -> tuple[Body, ...]:
    """The weight, and its rope, in all places to which they swing about the point.

    Rope and weight, an upright cylinder, swing as one by up to an angle to every side. What is at a
    distance d from the point and at an angle a from the rope gets to all angles up to
    ``a + swing``, at the same d. So both sweep bodies of revolution about the vertical, which
    capsules hold.

    Args:
        name: Name of the weight; that of the rope follows from it.
        carrier: Index of the joint that carries the point.
        point: The point (3,) in the frame of that joint [m].
        rope: Length of the rope [m]; there is no rope if it is 0.
        radius: Radius of the weight [m].
        height: Its height [m].
        swing: The angle [rad].
        rope_radius: Radius of the rope [m].
    """
    weight = _swept_weight(rope, radius, height, swing)
    shapes = containing(weight, TIGHT, MOST)
    found = [Body(name, carrier, shapes, "typed", hangs_at=point)]
    if rope:
        parts = np.linspace(0.0, 1.0, 2 if swing == 0 else MOST + 1)
        capsules = [
            _part_of_cone(rope, swing, low, high, rope_radius)
            for low, high in pairwise(parts.tolist())
        ]
        more = Body(f"rope of {name}", carrier, tuple(capsules), "typed", hangs_at=point)
        found.append(more)
    return tuple(found)


def _part_of_cone(rope: float, swing: float, low: float, high: float, radius: float) -> Capsule:
    """A capsule that holds a rope between two shares of its length, wherever it swings.

    It is about the vertical. A point at the distance d from the top swings to heights
    ``d cos(swing) .. d`` below it, and ``d sin(swing)`` to the side. Of the capsule between the
    heights ``low cos(swing)`` and ``high`` of these points with the radius ``high sin(swing)`` and
    that of the rope, each is within.
    """
    down = np.array([0.0, 0.0, -1.0])
    top = low * rope * np.cos(swing) * down
    return Capsule(top, high * rope * down, high * rope * np.sin(swing) + radius)


def _swept_weight(rope: float, radius: float, height: float, swing: float) -> Array:
    """Triangles (f, 3, 3) that enclose all places of the weight, the point at the origin [m]."""
    inner = np.array([rope, 0.0])
    upper, lower = np.array([rope, radius]), np.array([rope + height, radius])
    angle = np.arctan2(lower[1], lower[0])
    far = float(np.linalg.norm(lower))
    deepest = far * np.cos(max(angle - swing, 0.0))
    # The rim's arc, by points beyond it that the polygon of chords holds.
    turns = np.linspace(angle + swing, max(angle - swing, 0.0), ARC if swing else 1)
    step = (turns[0] - turns[-1]) / max(len(turns) - 1, 1)
    beyond = far / np.cos(step / 2)
    arc = beyond * np.column_stack([np.cos(turns), np.sin(turns)])
    outline = [_turned(inner, swing), _turned(upper, swing), *arc, np.array([deepest, 0.0])]
    # Where it swings past the vertical, the top of the other side is lowest in the middle.
    outline.insert(0, np.array([rope * np.cos(swing), 0.0]))
    profile = np.array(outline)
    profile[:, 1] /= np.cos(np.pi / SIDES)
    return _revolved(profile)


def _turned(point: Array, angle: float) -> Array:
    """A point (depth, side) turned away from the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def _revolved(profile: Array) -> Array:
    """Triangles of a surface of revolution about the vertical, of points (depth, side)."""
    angle = 2 * np.pi * np.arange(SIDES + 1) / SIDES
    depth = np.broadcast_to(-profile[:, 0], (SIDES + 1, len(profile)))
    side = np.outer(np.cos(angle), profile[:, 1]), np.outer(np.sin(angle), profile[:, 1])
    grid = np.stack([*side, depth], axis=-1)
    a, b = grid[:-1, :-1], grid[1:, :-1]
    c, d = grid[:-1, 1:], grid[1:, 1:]
    one = np.stack([a, b, c], axis=-2).reshape(-1, 3, 3)
    return np.concatenate([one, np.stack([b, d, c], axis=-2).reshape(-1, 3, 3)])
