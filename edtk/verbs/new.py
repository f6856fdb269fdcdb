"""`edtk.new`: a study of a robot to begin with."""

import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from edtk.robots.load_robot import builtin_robots, end_of_arm, load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import ControllerTable
from edtk.study.new_study import first_choices, new_study_text
from edtk.study.study import Study, load_study
from edtk.study.study_toml import read_toml, relative_path
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError
from edtk.system.fields import first_error
from edtk.system.files import write_text
from edtk.system.parsing import parse_toml
from edtk.verbs.inputs import errors_in, links_by_flags, require_file, require_output

LEAST_KG = 1e-3
MOST_KG = 1e5
Limits = dict[str, tuple[float, float]]


@checked
def new(
    robot: Path | str,
    out: Path | str,
    *,
    base: str | None = None,
    tip: str | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    controller: Path | str | None = None,
    payload: float | None = None,
    force: bool = False,
) -> Study:
    """Write a study of a robot that runs as it is, with what must be decided marked in it.

    Tool, load, space and test pose suit the robot's size; "DECIDE:" marks what only the engineer
    knows.

    Args:
        robot: Name of a built-in robot, or the path of a robot's file (TOML or URDF).
        out: File to write (TOML); it names the robot's file relative to its own folder.
        base: Link of a URDF that stands in the world; defaults to its root.
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only. The
            joints of a gripper are left out.
        limits: Lower and upper limit by joint [deg; mm for a prismatic joint], in place of those of
            the file, which may leave them open.
        controller: File (TOML) with a table `controller`, as `edtk.controller` writes it: how the
            controller counts the joints. Poses of the study are then in its values.
        payload: Mass that the robot may carry, with everything on its flange [kg]: its weight is
            the load. Defaults to what any arm of this reach carries.
        force: Whether a file that exists is replaced.

    Returns:
        The study, as it was written.

    Raises:
        UserError: The robot cannot be read, or the file exists.
    """
    require_file(out)
    path = Path(out)
    is_builtin = str(robot) in builtin_robots()
    with errors_in(path), links_by_flags():
        require_output(path, None if is_builtin else robot, controller)
        if path.exists() and not force:
            raise UserError("exists; expected a new file, or --force to replace it", where=path)
        given = dict(limits or {})
        if payload is not None and not LEAST_KG <= payload <= MOST_KG:
            message = f"expected a mass from {LEAST_KG:g} to {MOST_KG:g} kg"
            raise ArgumentError(message, argument="payload", given=payload)
        tip, left_out = (tip, ()) if tip is not None else end_of_arm(str(robot), base)
        arm = _load(str(robot), base, tip, given)
        if controller is not None:
            arm = replace(arm, controller=_controller(Path(controller)).build(arm, str(controller)))
        name = str(robot) if is_builtin else relative_path(Path(robot), path.parent)
        if not name.isprintable():
            message = "its name has characters that a study cannot hold; expected a plain one"
            raise UserError(message, where=robot)
        file = _in_a_comment(path.name)
        text = new_study_text(
            arm,
            first_choices(arm, payload),
            name,
            file,
            (base, tip),
            given,
            controller is not None,
            left_out,
        )
        Study(folder=path.parent, **parse_toml(text))  # nothing is written that does not run
        write_text(path, text)
    return load_study(path)


def _in_a_comment(name: str) -> str:
    """A file's name as a comment may hold it, and as a shell reads it."""
    return shlex.quote("".join(c if c.isprintable() else "?" for c in name))


def _controller(path: Path) -> ControllerTable:
    """The table of a file, beside which there may be others.

    Raises:
        UserError: The file is not valid, or has no such table.
    """
    content, _ = read_toml(path)
    if "controller" not in content:
        raise UserError("has no table [controller]", where=path)
    try:
        return ControllerTable.model_validate(content["controller"])
    except ValidationError as error:
        key, message = first_error(error, ControllerTable)
        key = f"controller.{key}".rstrip(".")
        raise UserError(message, where=path, key=key) from None


def _load(name: str, base: str | None, tip: str | None, limits: Limits) -> Robot:
    """The robot, with limits in degrees and millimetres.

    Raises:
        UserError: It cannot be read, or its limits are open and not given.
    """
    try:
        # Which joints slide is known only when the file has been read.
        in_degrees = {joint: np.deg2rad(pair).tolist() for joint, pair in limits.items()}
        robot = load_robot(name, base=base, tip=tip, limits=in_degrees)
        slides = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
        if not slides & set(limits):
            return robot
        lengths = {
            joint: (np.array(limits[joint]) / 1e3).tolist() for joint in slides & set(limits)
        }
        return load_robot(name, base=base, tip=tip, limits=in_degrees | lengths)
    except UserError as error:
        if error.key != "limits":
            raise
        message = f"{error.message.partition('; expected')[0]}; expected --limit NAME LOWER UPPER"
        raise UserError(message, where=error.where, key="limits") from error
