"""The check that an empty sheet overwrites nothing."""

from pathlib import Path

from edtk.calibration.is_filled import is_filled
from edtk.system.errors import UserError


def require_empty(path: Path) -> None:
    """Check that an existing file is a sheet that has not been filled in.

    Raises:
        UserError: The file is no sheet, or has measurements in it; it is not to be overwritten.
    """
    if not path.exists() or not path.stat().st_size:
        return
    filled = is_filled(path)
    if filled is None:
        raise UserError("exists and is not an empty sheet; expected another file", where=path)
    if filled:
        message = "has measurements in it; expected another file for the empty sheet"
        raise UserError(message, where=path)
