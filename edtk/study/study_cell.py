"""The cell of a study: the robot's bodies, and those of `[scene]`."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from edtk.cell.cell import Cell
from edtk.cell.meshes import open_edges, read_mesh
from edtk.cell.pairs import pairs_to_look_at
from edtk.cell.robot_bodies import (
    default_tool,
    hanging_bodies,
    held,
    merged,
    robot_bodies,
    typed_bodies,
)
from edtk.cell.shapes import Body, Mesh, Shape
from edtk.robots.frames import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.robots.robot_file import RobotAndMore, RobotFile
from edtk.study.schema import Specification
from edtk.study.tables_of_cell import MeshTable, PartTable, PlaneTable, SceneTable
from edtk.system.errors import UserError, note
from edtk.system.typing import Array

TOOL = "tool"  # the frame in which tools are given
TOOL_RADIUS = 0.03  # [m] of a tool that nobody describes


def study_cell(
    keys: Specification, robot: Robot, folder: Path, where: str, fixed: Mapping[int, float]
) -> Cell | None:
    """The cell of a study; None without a `[scene]`.

    Args:
        keys: The keys of the study.
        robot: Its robot, with the tool.
        folder: Folder to which file names are relative.
        where: The study, for messages.
        fixed: Values [rad or m] of the joints that stand, by index.

    Raises:
        UserError: A body, a file or a pair is not as it should be, or two bodies touch always.
    """
    if keys.scene is None:
        return None
    scene = _Scene(keys.scene, robot, folder, where)
    around = scene.bodies()
    own = _own_bodies(keys, robot, folder, where) if keys.scene.bodies else ()
    last = len(robot.chain) - 1
    if keys.scene.bodies and not any(body.carrier == last for body in around):
        tool = default_tool(robot, TOOL_RADIUS)
        own = (*own, *filter(None, (tool,)))
    names = [body.name for body in own]
    for body in around:
        if body.name in names:
            message = f"a part of the robot has the name {body.name!r}; expected another name"
            raise UserError(message, where=where, key="scene")
    bodies = (*own, *around)
    _check_ignored(keys.scene, bodies, where)
    ignored = {frozenset(pair) for pair in keys.scene.ignore}
    try:
        found = pairs_to_look_at(
            robot,
            bodies,
            MILLIMETRE * keys.scene.margin_mm,
            own=set(names),
            ignored=ignored,
            fixed=fixed,
        )
    except ValueError as error:
        raise UserError(str(error), where=where, key="scene") from error
    return Cell(robot, bodies, MILLIMETRE * keys.scene.margin_mm, found.looked_at)


def _own_bodies(keys: Specification, robot: Robot, folder: Path, where: str) -> tuple[Body, ...]:
    """The bodies of the study's robot.

    Raises:
        UserError: It has none, or they cannot be read.
    """
    try:
        found = _described(keys, robot, folder)
    except UserError as error:
        raise UserError(str(error), where=where, key="robot") from error
    if not found:
        message = (
            "the robot has no bodies; expected [[body]] in its file, shapes in its URDF, or "
            "bodies = false"
        )
        raise UserError(message, where=where, key="scene.bodies")
    return found


def _described(keys: Specification, robot: Robot, folder: Path) -> tuple[Body, ...]:
    """The bodies that the study's robot has by its table or its file."""
    if isinstance(keys.robot, dict):
        table = RobotAndMore if keys.robot_name is not None else RobotFile
        tables = table.model_validate(keys.robot).body
        if tables or keys.robot_name is None:
            return typed_bodies(robot, tables)
    assert keys.robot_name is not None
    return robot_bodies(robot, keys.robot_name, folder, base=keys.base_link, tip=keys.tip_link)


def _check_ignored(scene: SceneTable, bodies: tuple[Body, ...], where: str) -> None:
    names = [body.name for body in bodies]
    for i, pair in enumerate(scene.ignore):
        if pair[0] == pair[1]:
            message = f"{pair[0]!r} is named twice; expected two bodies that may touch"
            raise UserError(message, where=where, key=f"scene.ignore.{i}")
        for name in pair:
            if name not in names:
                message = f"no body {name!r}; the cell has {', '.join(names)}"
                raise UserError(message, where=where, key=f"scene.ignore.{i}")


class _Scene:
    """Builds the bodies of a scene; all messages name the study and the key."""

    def __init__(self, scene: SceneTable, robot: Robot, folder: Path, where: str) -> None:
        self.scene = scene
        self.robot = robot
        self.folder = folder
        self.where = where

    def bodies(self) -> tuple[Body, ...]:
        """All bodies, those of one name as one."""
        try:
            found = merged(self._parts())
            hanging = self.scene.hanging
            if hanging is None:
                return found
            last = len(self.robot.chain) - 1
            more = hanging_bodies(
                hanging.name,
                last,
                self.robot.tool[:3, 3],
                rope=MILLIMETRE * hanging.rope_mm,
                radius=MILLIMETRE * hanging.radius_mm,
                height=MILLIMETRE * hanging.height_mm,
                swing=float(np.deg2rad(hanging.swing_deg)),
                rope_radius=MILLIMETRE * hanging.rope_radius_mm,
            )
            return merged((*found, *more))
        except UserError:
            raise
        except ValueError as error:
            raise UserError(str(error), where=self.where, key="scene") from error

    def _parts(self) -> Iterator[Body]:
        for kind in ("box", "cylinder", "capsule", "plane", "mesh"):
            for i, table in enumerate(getattr(self.scene, kind)):
                yield self._body(table, f"scene.{kind}.{i}")

    def _body(self, table: PartTable | PlaneTable, key: str) -> Body:
        """The body of one table."""
        carrier, frame = self._carrier(table, key)
        part = self._part(table, key)
        shapes = held([part], stands=carrier is None)
        meshes = (part,) if isinstance(part, Mesh) else ()
        return Body(table.name, carrier, shapes, "typed", meshes).moved(frame)

    def _part(self, table: PartTable | PlaneTable, key: str) -> Shape | Mesh:
        """The shape or mesh of a table, in the frame in which it is given."""
        if not isinstance(table, MeshTable):
            return table.build()  # type: ignore[union-attr]
        try:
            mesh = read_mesh(self.folder / table.file, table.unit, table.file)
        except UserError as error:
            raise UserError(str(error), where=self.where, key=key) from error
        edges = open_edges(mesh)
        if edges:
            where = f"{edges} edge{'s' if edges > 1 else ''}"
            message = f"{table.file} is open at {where}: its surface counts, not its inside"
            note(f"{key}: {message}", self.where)
        return mesh.moved(table.pose)

    def _carrier(self, table: PartTable | PlaneTable, key: str) -> tuple[int | None, Array]:
        """The joint that carries a part, and the frame (4, 4) of the part in that joint's."""
        if isinstance(table, PlaneTable) or table.joint is None:
            return None, np.eye(4)
        names = self.robot.body_names
        if table.joint in names:
            return names.index(table.joint), np.eye(4)
        if table.joint == TOOL:
            return len(names) - 1, self.robot.flange
        message = f"no joint {table.joint!r}; expected {', '.join(names)} or {TOOL}"
        raise UserError(message, where=self.where, key=f"{key}.joint")
