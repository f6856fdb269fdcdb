"""The bodies of a robot: of its URDF, typed in its file, or the defaults of a built-in one."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from edtk.cell.shapes import Body, Capsule, Source
from edtk.cell.urdf_bodies import urdf_bodies
from edtk.robots.frames import MILLIMETRE
from edtk.robots.load_robot import TOML, URDF, robot_content
from edtk.robots.robot import Robot
from edtk.robots.robot_file import BodyTable, RobotFile, RobotFileError
from edtk.robots.urdf.load_urdf import XACRO
from edtk.system.typing import Array


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
