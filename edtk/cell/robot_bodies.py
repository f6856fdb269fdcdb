"""The bodies of a robot: of its URDF, typed in its file, or the defaults of a built-in one; and
the load that hangs and swings below it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from edtk.cell.containing import containing
from edtk.cell.shapes import Body, Capsule, Source
from edtk.cell.urdf_bodies import SIDES, urdf_bodies
from edtk.robots.frames import MILLIMETRE
from edtk.robots.load_robot import TOML, URDF, robot_content
from edtk.robots.robot import Robot
from edtk.robots.robot_file import BodyTable, RobotFile, RobotFileError
from edtk.robots.urdf.load_urdf import XACRO
from edtk.system.typing import Array

ARC = 8  # points of the arc on which the weight's lower rim swings
CAPSULES_OF_WEIGHT = 4  # capsules that hold all places of the weight
TIGHT_SWING = 0.01  # [m], see `containing`


def robot_bodies(
    robot: Robot,
    name: str,
    folder: Path | None = None,
    *,
    base: str | None = None,
    tip: str | None = None,
) -> tuple[Body, ...]:
    """The bodies of a robot that is built in or has a file.

    Args:
        robot: The robot.
        name: Its name, or the path of its file.
        folder: The folder to which a relative path is relative; defaults to the current one.
        base: Link of a URDF that stands in the world.
        tip: Link of a URDF that carries the tool.

    Returns:
        The bodies; none where a file in TOML has no `[[body]]`.

    Raises:
        RobotFileError: The file, a shape or a mesh cannot be read.
    """
    if name.endswith((URDF, XACRO)):
        return urdf_bodies((folder or Path()) / name, base, tip, name)
    tables = RobotFile.model_validate(robot_content(name, folder)).body
    source: Source = "typed" if name.endswith(TOML) else "default"
    return typed_bodies(robot, tables, source, f"robot {name}")


def typed_bodies(
    robot: Robot, tables: Sequence[BodyTable], source: Source = "typed", where: str | None = None
) -> tuple[Body, ...]:
    """The bodies of `[[body]]`: capsules of one name are one body.

    Raises:
        RobotFileError: A joint does not exist, or one body is on two joints.
    """
    for i, table in enumerate(tables):
        if table.joint is not None and table.joint not in robot.body_names:
            names = ", ".join(robot.body_names)
            message = f"no joint {table.joint!r}; this robot has {names}"
            raise RobotFileError(message, where=where, key=f"body.{i}.joint")
    capsules = [
        (
            table.name,
            None if table.joint is None else robot.body_names.index(table.joint),
            Capsule(
                MILLIMETRE * np.array(table.from_mm),
                MILLIMETRE * np.array(table.to_mm),
                MILLIMETRE * table.radius_mm,
            ),
        )
        for table in tables
    ]
    try:
        found = merged(
            Body(name, carrier, (capsule,), source) for name, carrier, capsule in capsules
        )
    except ValueError as error:
        raise RobotFileError(str(error), where=where, key="body") from error
    return tuple(body if body.carrier is not None else body.moved(robot.base) for body in found)


def merged(bodies: Iterable[Body]) -> tuple[Body, ...]:
    """Bodies of one name as one.

    Raises:
        ValueError: Two of one name are moved by different joints, or one of them hangs from a
            point alone.
    """
    found: dict[str, Body] = {}
    for body in bodies:
        first = found.setdefault(body.name, body)
        if first is body:
            continue
        if first.carrier != body.carrier:
            message = "is moved by two joints; expected one joint, or two names"
            raise ValueError(f"body {body.name!r}: {message}")
        if first.hangs_at is not body.hangs_at:
            message = "hangs, and a part that its joint turns has this name; expected two names"
            raise ValueError(f"body {body.name!r}: {message}")
        shapes = (*first.shapes, *body.shapes)
        meshes = (*first.meshes, *body.meshes)
        found[body.name] = replace(first, shapes=shapes, meshes=meshes)
    return tuple(found.values())


def default_tool(robot: Robot, radius: float) -> Body | None:
    """A capsule from the flange to the tool point; None where the one is the other."""
    ends: tuple[Array, Array] = (robot.flange[:3, 3], robot.tool[:3, 3])
    if np.allclose(*ends):
        return None
    return Body("tool", len(robot.chain) - 1, (Capsule(*ends, radius),), "default")


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
    shapes = containing(weight, TIGHT_SWING, CAPSULES_OF_WEIGHT)
    found = [Body(name, carrier, shapes, "typed", hangs_at=point)]
    if rope:
        parts = np.linspace(0.0, 1.0, 2 if swing == 0 else CAPSULES_OF_WEIGHT + 1)
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
