"""Pairs of bodies: those to look at, those that a joint connects, and those that always touch."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from edtk.cell.cell import Cell, move_against
from edtk.cell.containing import inside, sampled
from edtk.cell.shapes import Body
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.robots.robot_overview import Part, Parts
from edtk.system.typing import Array

POSES = 1024  # in which pairs that always touch are looked for; always the same ones
FIRST_POSES = 32  # of them, which leave few pairs
NEXT_BUT_ONE = 2  # joints between such parts
MESH_POINTS = 10_000  # points of a mesh
MOST_COMPARED = 128  # poses in which meshes are compared
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
        never: Pairs of the arm with one body between them, whose shapes come near each other in
            some poses, and whose meshes never touch in these.
    """

    looked_at: tuple[Pair, ...]
    adjacent: tuple[Pair, ...] = ()
    always: tuple[Pair, ...] = ()
    never: tuple[Pair, ...] = ()


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

    Parts of an arm with one body between them are made to pass close by each other, often by less
    than what shapes stand out of the parts. Where these have meshes, the meshes decide.

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
        if frozenset(pair) in ignored or not move_against(one, other):
            continue
        (adjacent if _are_adjacent(one, other, own) else others).append(pair)
    q = poses_within(robot, fixed or {})
    always = others
    for part in (q[:FIRST_POSES], q):
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
    close = tuple(
        pair
        for pair in others
        if set(pair) <= set(own)
        and _joints_between(*(named[name] for name in pair)) == NEXT_BUT_ONE
    )
    never = _never_touching(Cell(robot, bodies, margin, close), named, q)
    always = [pair for pair in always if pair not in never]
    kept = tuple(pair for pair in others if pair not in {*always, *never})
    return Pairs(kept, tuple(adjacent), tuple(always), never)


def parts_of(robot: Robot, bodies: tuple[Body, ...]) -> Parts:
    """The bodies of a robot and their pairs, for people."""
    found = pairs_to_look_at(robot, bodies, own={body.name for body in bodies})
    parts = tuple(
        Part(
            body.name,
            None if body.carrier is None else robot.body_names[body.carrier],
            body.source,
            len(body.shapes),
            tuple((_numbers(one.start), _numbers(one.end), one.radius) for one in body.capsules),
        )
        for body in bodies
    )
    return Parts(parts, found.adjacent, found.always, found.never)


def _numbers(point: Array) -> tuple[float, ...]:
    return tuple(map(float, point))


def _never_touching(cell: Cell, named: Mapping[str, Body], q: Array) -> tuple[Pair, ...]:
    """Pairs of a cell whose shapes touch in some of the poses q (k, n), and whose meshes do not."""
    distances = cell.distances(q)
    found = []
    for i, pair in enumerate(cell.pairs):
        touching = q[distances[:, i] < cell.margin][:MOST_COMPARED]
        moving, other = sorted((named[name] for name in pair), key=_place, reverse=True)
        if len(touching) and moving.meshes and other.meshes:
            frames = cell.robot.frames(touching, cell.carriers)
            if not _meshes_touch(moving, other, frames):
                found.append(pair)
    return tuple(found)


def _meshes_touch(one: Body, other: Body, frames: Frames) -> bool:
    """Whether the meshes of two bodies touch in any pose, or come so near that one cannot tell.

    The first one moves.

    Two surfaces touch if points of them do. Each point of a surface is near one of its sampled
    points, by at most a distance that the sampling tells. So where no sampled points of both are
    within the sum of these, the surfaces are apart.
    """
    from scipy.spatial import cKDTree

    (first, a), (second, b) = (sampled(_corners(body), MESH_POINTS) for body in (one, other))
    near = a + b
    # Points that are not within the first body's shapes, made larger so much, are farther away.
    around = [replace(capsule, radius=capsule.radius + near) for capsule in one.capsules]
    tree = cKDTree(first)
    outer, inner = (_frames_of(body, frames) for body in (one, other))
    for T in np.linalg.inv(outer) @ inner:
        points = second @ T[:3, :3].T + T[:3, 3]
        points = points[np.any([inside(part, points) for part in around], axis=0)]
        if np.isfinite(tree.query(points, distance_upper_bound=near)[0]).any():
            return True
    return False


def _corners(body: Body) -> Array:
    """All triangles (f, 3, 3) of a body [m]."""
    return np.concatenate([mesh.triangles for mesh in body.meshes])


def _frames_of(body: Body, frames: Frames) -> Array:
    """Frames (k, 4, 4) of a body's carrier in the world [m]."""
    T = np.tile(np.eye(4), (frames.position.shape[-1], 1, 1))
    if body.carrier is not None:
        rotation, origin = frames.bodies[body.carrier]
        T[:, :3, :3] = np.moveaxis(rotation, (0, 1), (-1, -2))
        T[:, :3, 3] = origin.T
    return T


def poses_within(robot: Robot, fixed: Mapping[int, float], count: int = POSES) -> Array:
    """Poses (k, n) anywhere within the limits of the joints [rad or m], some joints fixed.

    They are the same ones in each call.
    """
    lower, upper = robot.limits
    q = lower + (upper - lower) * np.random.default_rng(0).random((count, robot.n))
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
    return abs(_place(one) - _place(other))


def _place(body: Body) -> int:
    """Index of the joint that carries a body; one before the first for what stands."""
    return WORLD if body.carrier is None else body.carrier


def _hangs_there(one: Body, other: Body) -> bool:
    """Whether one body hangs at the other one, or behind the next joint."""
    hangs = (one.hangs_at is None) != (other.hangs_at is None)
    return hangs and _joints_between(one, other) <= 1
