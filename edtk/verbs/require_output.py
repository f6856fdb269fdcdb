"""Files that a verb writes: checked before the work, so that no result is lost in the end."""

import os
from itertools import combinations
from pathlib import Path

from edtk.system.atomic_file import STANDARD_OUTPUT, is_standard_output, require_writable
from edtk.system.errors import ArgumentError, UserError


def require_output(path: Path | str | None, *inputs: Path | str | None) -> None:
    """Check, before long work, that a file can be written.

    The file must be neither an input of the same call nor a sheet with measurements in it.

    Args:
        path: The file to write; None and standard output (`-`) are always fine.
        inputs: The files that the call reads; None entries do not count.

    Raises:
        UserError: The file is an input, or holds measurements.
        OSError: The file cannot be written.
    """
    if path is None or Path(path) == STANDARD_OUTPUT:
        return
    if any(other is not None and _same(path, other) for other in inputs):
        raise UserError("is read by this command; expected another file to write", where=path)
    require_writable(path)
    if Path(path).exists():
        from edtk.calibration.is_filled import is_filled

        if is_filled(Path(path)):
            raise UserError("has measurements in it; expected another file to write", where=path)


def require_different(**outputs: Path | str | None) -> None:
    """Check that the files that a call writes are not the same.

    Args:
        outputs: The files by argument; None entries do not count.

    Raises:
        ArgumentError: Two arguments name the same file.
    """
    given = {argument: path for argument, path in outputs.items() if path is not None}
    for first, second in combinations(given, 2):
        both_printed = is_standard_output(given[first]) and is_standard_output(given[second])
        if both_printed or _same(given[first], given[second]):
            raise ArgumentError(
                "another output goes there, too; expected a place of its own",
                argument=second,
                given=given[second],
            )


def require_file(path: Path | str | None) -> None:
    """Check that an output is no standard output: it is read as well.

    Raises:
        UserError: It is standard output.
    """
    if path is not None and Path(path) == STANDARD_OUTPUT:
        raise UserError("is standard output; expected a file", where=path)


def require_folder(path: Path | str | None) -> None:
    """Check that an output of several files is no standard output.

    Raises:
        UserError: It is standard output.
    """
    if path is not None and Path(path) == STANDARD_OUTPUT:
        raise UserError("is standard output; expected a folder for several files", where=path)


def _same(first: Path | str, second: Path | str) -> bool:
    """Whether two paths lead to the same file, through links or not."""
    return os.path.realpath(first) == os.path.realpath(second)
