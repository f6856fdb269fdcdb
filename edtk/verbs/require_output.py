"""Files that a verb writes: checked before the work, so that no result is lost in the end."""

from pathlib import Path

from edtk.system.atomic_file import require_writable
from edtk.system.errors import UserError


def require_output(path: Path | str | None, *inputs: Path | str | None) -> None:
    """Check, before long work, that a file can be written.

    The file must be neither an input of the same call nor a sheet with measurements in it.

    Args:
        path: The file to write; None is always fine.
        inputs: The files that the call reads; None entries do not count.

    Raises:
        UserError: The file is an input, or holds measurements.
        OSError: The file cannot be written.
    """
    if path is None:
        return
    path = Path(path)
    if any(other is not None and path.resolve() == Path(other).resolve() for other in inputs):
        raise UserError("is read by this command; expected another file to write", where=path)
    require_writable(path)
    if path.exists():
        from edtk.calibration.is_filled import is_filled

        if is_filled(path):
            raise UserError("has measurements in it; expected another file to write", where=path)
