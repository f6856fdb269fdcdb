"""Robots by name: those that ship with edtk, and files of the same form."""

from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from edtk.robots.robot import Robot
from edtk.robots.robot_file import RobotFileError, robot_from_dict, told_at
from edtk.robots.urdf.load_urdf import XACRO, arm_in, load_urdf
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.parsing import MOST_STUDY_MB, parse_toml

TOML = ".toml"
URDF = ".urdf"


def builtin_robots() -> tuple[str, ...]:
    """Names of the robots that ship with edtk."""
    names = [file.name for file in _builtin_folder().iterdir()]
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


@checked
def load_robot(
    name: Path | str,
    folder: Path | None = None,
    *,
    base: str | None = None,
    tip: str | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> Robot:
    """Read a built-in robot by its name, or a robot file (TOML, URDF or xacro) by its path.

    The keys of a TOML file are those of `edtk.robots.robot_file`.

    Args:
        name: One of `builtin_robots()`, or a path ending in ".toml", ".urdf" or ".xacro".
        folder: The folder to which a relative path is relative; defaults to the current one.
        base: Link of a URDF that stands in the world; defaults to its root.
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only.
        limits: Lower and upper limits by joint, in place of those of the file [rad or m].

    Raises:
        RobotFileError: No such robot, or its file is not valid; one line that says where.
    """
    name = str(name)
    if name.endswith((URDF, XACRO)):
        path = (folder or Path()) / name
        return _limited(load_urdf(path, base, tip, limits, name), limits)
    for key, link in (("base_link", base), ("tip_link", tip)):
        if link is not None:
            message = f"has no links; {link!r} goes with a URDF file"
            raise RobotFileError(message, where=f"robot {name}", key=key)
    content = robot_content(name, folder)
    return _limited(robot_from_dict(content, where=f"robot {name}"), limits)


def end_of_arm(name: str, base: str | None = None) -> tuple[str | None, tuple[str, ...]]:
    """The link at which the arm of a URDF ends, and the joints of its end effector beyond it.

    Args:
        name: The robot's path.
        base: Name of the base link; defaults to the root.

    Returns:
        None and no joints where there is no such link, and of other files, see `arm_of`.
    """
    return arm_in(Path(name), base, name) if name.endswith((URDF, XACRO)) else (None, ())


def robot_content(name: str, folder: Path | None = None) -> dict[str, Any]:
    """The keys of a built-in robot, or of a robot file in TOML, unchecked.

    Raises:
        RobotFileError: There is no such robot, or its file cannot be read.
    """
    if name.endswith(TOML):
        return _content(name, folder or Path())
    if name in builtin_robots():
        return parse_toml((_builtin_folder() / f"{name}.toml").read_text(encoding="utf-8"))
    raise RobotFileError(
        f"unknown robot {name!r}; built in: {', '.join(builtin_robots())}; "
        "or give a path to a .toml, .urdf or .xacro file"
    )


def _limited(robot: Robot, limits: Mapping[str, tuple[float, float]] | None) -> Robot:
    with told_at(None, "limits"):
        return robot.with_limits(limits or {})


def _content(name: str, folder: Path) -> dict[str, Any]:
    """The keys of a robot file."""
    where = f"robot file {folder / name}"
    try:
        text = read_text(folder / name, MOST_STUDY_MB)
        where = f"robot {name}"
        content = parse_toml(text)
    except UserError as error:
        raise RobotFileError(error.message, where=where, key=error.key) from error
    if "robot" in content:
        own = f"; its robot is {content['robot']}" if isinstance(content["robot"], str) else ""
        message = f"this is a study{own}; expected a robot's file, or the name of a robot"
        raise RobotFileError(message, where=where)
    return content


def _builtin_folder() -> Traversable:
    return files("edtk.robots") / "builtin"
