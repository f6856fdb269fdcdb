"""Robots by name: those that ship with edtk, and files of the same form."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from edtk.model.robot import Robot
from edtk.model.robot_from_dict import RobotFileError, robot_from_dict
from edtk.system.errors import UserError
from edtk.system.parse_toml import MOST_MB, parse_toml
from edtk.system.read_text import read_text


def builtin_robots() -> tuple[str, ...]:
    """Names of the robots that ship with edtk."""
    names = [file.name for file in _builtin_folder().iterdir()]
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load_robot(name: str, folder: Path | None = None) -> Robot:
    """Read a built-in robot by its name, or a robot file (TOML) by its path.

    The keys of a file are those of `edtk.model.robot_from_dict`.

    Args:
        name: One of `builtin_robots()`, or a path ending in ".toml".
        folder: The folder to which a relative path is relative; defaults to the current one.

    Raises:
        RobotFileError: No such robot, or its file is not valid; one line that says where.
    """
    if name.endswith(".toml"):
        content = _content(name, folder or Path())
    elif name in builtin_robots():
        content = parse_toml((_builtin_folder() / f"{name}.toml").read_text(encoding="utf-8"))
    else:
        raise RobotFileError(
            f"unknown robot {name!r}; built in: {', '.join(builtin_robots())}; "
            "or give a path to a .toml file"
        )
    return robot_from_dict(content, where=f"robot {name}")


def _content(name: str, folder: Path) -> dict[str, Any]:
    """The keys of a robot file."""
    where = f"robot file {folder / name}"
    try:
        text = read_text(folder / name, MOST_MB)
        where = f"robot {name}"
        return parse_toml(text)
    except UserError as error:
        raise RobotFileError(error.message, where=where, key=error.key) from error


def _builtin_folder() -> Traversable:
    return files("edtk.model") / "robots"
