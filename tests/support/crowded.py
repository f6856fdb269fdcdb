"""Arms among shapes of each kind, close enough that many poses and most ways touch something."""

import numpy as np

from edtk.cell.cell import Cell, every_pair
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Plane
from edtk.robots.rotations import transform


def skeleton(robot, radius):
    """A capsule for each body of an arm, from its joint half the way to the next one."""
    count = len(robot.chain)
    frames = robot.frames(np.zeros(robot.n), range(count))
    places = [frames.bodies[j][1] for j in range(count)] + [frames.position]
    bodies = []
    for j in range(count):
        along = frames.bodies[j][0] @ (places[j + 1] - places[j]) / 2
        bodies.append(Body(f"link{j + 1}", j, (Capsule(np.zeros(3), along, radius),)))
    return bodies


def around(reach):
    """One body of each kind of shape that stands still, about an arm of such a reach [m]."""
    turned = transform([0.2 * reach, -0.5 * reach, 0.3 * reach], [0.3, 0.2, 0.9])
    half = reach * np.array([0.1, 0.2, 0.1])
    rail = np.array([[-0.4, 0.5, 0.7], [0.4, 0.5, 0.7]]) * reach
    return [
        Body("table", None, (Box(transform([0.6 * reach, 0.1 * reach, 0.1 * reach]), half),)),
        Body("column", None, (Cylinder(turned, 0.08 * reach, 0.4 * reach),)),
        Body("floor", None, (Plane(np.array([0.0, 0.1, 1]), -0.6 * reach),)),
        Body("rail", None, (Capsule(rail[0], rail[1], 0.03 * reach),)),
    ]


def hanging(robot):
    """A weight that hangs from the last joint, and one from the joint before; they do not turn."""
    last = len(robot.chain) - 1
    shape = Capsule(np.array([0.02, 0, -0.05]) * robot.reach, np.array([0, 0, -0.1]), 0.05)
    places = {last: np.array([0.1, 0.05, -0.1]), last - 1: np.array([0.0, 0.1, 0.1])}
    return [
        Body(f"weight{joint + 1}", joint, (shape,), hangs_at=place)
        for joint, place in places.items()
    ]


def crowded(robot, margin=0.01, apart=3, weights=False):
    """A cell of an arm, whose bodies so many joints apart are looked at.

    Args:
        robot: The arm.
        margin: The margin [m].
        apart: Number of joints between two links of a pair, at least.
        weights: Whether weights hang from it.
    """
    bodies = [*skeleton(robot, 0.03 * robot.reach), *around(robot.reach)]
    bodies += hanging(robot) if weights else []
    number = {body.name: body.carrier for body in bodies if body.carrier is not None}
    pairs = tuple(
        (one, other)
        for one, other in every_pair(bodies)
        if one not in number or other not in number or abs(number[other] - number[one]) >= apart
    )
    return Cell(robot, tuple(bodies), margin, pairs)


def free_poses(cell, count, seed=0):
    """Random poses (count, n) in which nothing touches."""
    rng = np.random.default_rng(seed)
    lower, upper = cell.robot.limits
    drawn = lower + (upper - lower) * rng.random((50 * count, cell.robot.n))
    found = drawn[cell.free(drawn)][:count]
    assert len(found) == count
    return found
