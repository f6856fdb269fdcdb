"""The URDF that a xacro file describes."""

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from edtk.model.robot_from_dict import RobotFileError
from edtk.system.errors import UserError
from edtk.system.parse_xml import parse_xml
from edtk.system.read_text import read_text

PACKAGE = "package.xml"  # names a folder as a package


def urdf_of_xacro(path: Path, where: str) -> str:
    """Expand the macros of a xacro file, by the package `xacro` of ROS itself.

    Arguments have their defaults. A package is looked for in the folders above the file, and beside
    these, where ROS is not there to find it. Xacro evaluates the expressions of the file, and reads
    the files that it includes.

    Args:
        path: The file.
        where: How messages name it.

    Raises:
        RobotFileError: One line: the package is not installed, or cannot expand the file.
    """
    try:
        import xacro  # type: ignore[import-untyped]
    except ModuleNotFoundError:
        message = (
            "is a xacro file, which needs the extra edtk[xacro]; expected that, or the URDF that "
            "`xacro FILE > FILE.urdf` makes of it"
        )
        raise RobotFileError(message, where=where) from None
    try:
        parse_xml(read_text(path), where)  # refuses a DOCTYPE, whose entities may be of any size
    except UserError as error:
        raise RobotFileError(error.message, where=where, key=error.key) from error
    try:
        # It prints warnings, and the places of errors, for which a line has no room.
        with redirect_stderr(io.StringIO()), _packages_above(path):
            return str(xacro.process_file(str(path), mappings={}, verbosity=0).toxml())
    except Exception as error:  # whatever an expression of the file may raise
        # Xacro writes an error that it does not expect twice, with its class.
        bare = getattr(error, "exc", None) if str(error).startswith("<class") else error
        words = " ".join(str(bare).split()) or type(error).__name__
        raise RobotFileError(f"cannot be expanded: {words}", where=where) from error


@contextmanager
def _packages_above(path: Path) -> Iterator[None]:
    """Let `$(find NAME)` mean a folder above the file, or beside one, where ROS is not there."""
    from xacro import substitution_args

    if find_spec("ament_index_python") is not None:
        yield
        return

    def found(name: str) -> str:
        for folder in path.resolve().parents:
            for place in (folder, folder / name):
                if place.name == name and (place / PACKAGE).exists():
                    return str(place)
        raise LookupError(f"no package {name!r} in the folders above the file")

    # There is no other way to say where packages are.
    before: Any = substitution_args._eval_find
    names: Any = substitution_args._eval_dict
    substitution_args._eval_find = found
    names["find"] = found
    try:
        yield
    finally:
        substitution_args._eval_find = before
        names["find"] = before
