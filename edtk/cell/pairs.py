"""Pairs of bodies: those to look at, those that a joint connects, and those that always touch."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from edtk.cell.cell import Cell
from edtk.cell.shapes import Body
from edtk.robots.robot import Robot
from edtk.system.typing import Array

POSES = 1024  # in which pairs that always touch are looked for; always the same ones
FIRST = 32  # of them, which leave few pairs
WORLD = -1  # what stands moves with the joint before the first one

Pair = tuple[str, str]


@dataclass(frozen=True)
class Pairs:
    """Names of the two bodies of each pair of a cell that can move against each other.

    Attributes:
        looked_at: Pairs whose distance counts.
        adjacent: Pairs that a joint connects: they are parts of one arm, and touch there.
        always: Other pairs of the arm that are nearer than the margin in each pose that was looked
            at: their shapes overlap where the parts themselves are near each other.
    """

    looked_at: tuple[Pair, ...]
    adjacent: tuple[Pair, ...] = ()
    always: tuple[Pair, ...] = ()


def pairs_to_look_at(
    robot: Robot,
    bodies: tuple[Body, ...],
    margin: float = 0.0,
    *,
    own: Collection[str],
    ignored: Collection[frozenset[str]] = (),
    fixed: Mapping[int, float] | None = None,
) -> Pairs:
    """Sort the pairs of bodies of a cell.

    Two bodies are adjacent if both belong to the arm and one joint lies between them. What the arm
    carries belongs to it, but for a weight that hangs; what stands does, if it is the robot's own.
    A rope touches the body that it hangs from, which is no mistake.

    Args:
        robot: The robot.
        bodies: All bodies of the cell.
        margin: Distance that is to be kept [m].
        own: Names of the bodies that are the robot's own.
        ignored: Pairs that may touch.
        fixed: Values [rad or m] of the joints that stand, by index.

    Raises:
        ValueError: A pair that is not the robot's own touches in each pose that was looked at.
    """
    adjacent: list[Pair] = []
    others: list[Pair] = []
    for one, other in combinations(bodies, 2):
        pair = (one.name, other.name)
        if frozenset(pair) in ignored or one.carrier == other.carrier:
            continue
        (adjacent if _are_adjacent(one, other, own) else others).append(pair)
    q = poses_within(robot, fixed or {})
    always = others
    for part in (q[:FIRST], q):
        distances = Cell(robot, bodies, margin, tuple(always)).distances(part)
        touching = np.all(distances < margin, axis=0).tolist()
        always = [pair for pair, touches in zip(always, touching, strict=True) if touches]
    named = {body.name: body for body in bodies}
    for first, second in always:
        if not {first, second} <= set(own) and not _hangs_there(named[first], named[second]):
            message = (
                f"{first!r} and {second!r} touch in each of {len(q)} poses; expected another "
                f'place, or ignore = [["{first}", "{second}"]]'
            )
            raise ValueError(message)
    looked_at = tuple(pair for pair in others if pair not in always)
    return Pairs(looked_at, tuple(adjacent), tuple(always))


def poses_within(robot: Robot, fixed: Mapping[int, float], count: int = POSES) -> Array:
    """Poses (k, n) that fill the limits of the joints evenly [rad or m], some joints fixed."""
    from scipy.stats import qmc

    lower, upper = robot.limits
    q = lower + (upper - lower) * qmc.Sobol(robot.n, seed=0).random(count)
    for joint, value in fixed.items():
        q[:, joint] = value
    possible = robot.bounds.coupled.hold(q)
    return np.asarray(q[possible] if possible.any() else q)


def _are_adjacent(one: Body, other: Body, own: Collection[str]) -> bool:
    """Whether two bodies belong to the arm, and one joint lies between them."""
    if any(body.carrier is None and body.name not in own for body in (one, other)):
        return False
    return one.hangs_at is None and other.hangs_at is None and _joints_between(one, other) == 1


def _joints_between(one: Body, other: Body) -> int:
    """How many joints of the chain lie between two bodies."""
    places = [WORLD if body.carrier is None else body.carrier for body in (one, other)]
    return abs(places[0] - places[1])


def _hangs_there(one: Body, other: Body) -> bool:
    """Whether one body hangs at the other one, or behind the next joint."""
    hangs = (one.hangs_at is None) != (other.hangs_at is None)
    return hangs and _joints_between(one, other) <= 1
