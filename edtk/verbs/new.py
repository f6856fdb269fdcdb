"""`edtk.new`: a study of a robot to begin with."""

import os
from pathlib import Path

from edtk.model.load_robot import builtin_robots, load_robot
from edtk.study.first_choices import first_choices
from edtk.study.new_study_text import new_study_text
from edtk.study.study import Study, load_study
from edtk.system.atomic_file import write_text
from edtk.system.errors import UserError
from edtk.verbs.inputs import errors_in
from edtk.verbs.require_output import require_file, require_output


def new(
    robot: Path | str,
    out: Path | str,
    *,
    base: str | None = None,
    tip: str | None = None,
    force: bool = False,
) -> Study:
    """Write a study of a robot that runs as it is, with what must be decided marked in it.

    Tool, load, space and test pose suit the robot's size; "DECIDE:" marks what only the engineer
    knows.

    Args:
        robot: Name of a built-in robot, or the path of a robot's file (TOML or URDF).
        out: File to write (TOML); it names the robot's file relative to its own folder.
        base: Link of a URDF that stands in the world; defaults to its root.
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only.
        force: Whether a file that exists is replaced.

    Returns:
        The study, as it was written.

    Raises:
        UserError: The robot cannot be read, or the file exists.
    """
    require_file(out)
    path = Path(out)
    is_builtin = str(robot) in builtin_robots()
    with errors_in(path):
        require_output(path, None if is_builtin else robot)
        if path.exists() and not force:
            raise UserError("exists; expected a new file, or --force to replace it", where=path)
        arm = load_robot(str(robot), base=base, tip=tip)
        name = str(robot) if is_builtin else _relative(Path(robot), path.parent)
        text = new_study_text(arm, first_choices(arm), name, path.name, (base, tip))
        write_text(path, text)
    return load_study(path)


def _relative(path: Path, folder: Path) -> str:
    """A path as a file in the folder names it."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # no relative path leads to another drive
        return path.absolute().as_posix()
