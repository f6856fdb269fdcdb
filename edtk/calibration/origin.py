"""Where a calibration comes from: its file, and what was asked for."""

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from edtk.tables.pose_table import Table


@dataclass(frozen=True)
class Origin:
    """The file of the measurements as it was read, and options that the fit does not show.

    Attributes:
        sha256: Of the file, in hex digits; empty for a pipe, which cannot be read twice, and for a
            data frame.
        changed: When the file was changed last, "2026-11-22 09:16:27 UTC"; empty likewise. A
            report has this instead of its own date, so that the same run writes the same bytes.
        linear: Whether the linear model was asked for.
        as_is: Whether the sheet was to be taken as it is.
    """

    sha256: str = ""
    changed: str = ""
    linear: bool = False
    as_is: bool = False

    @classmethod
    def of(cls, path: Table, linear: bool, as_is: bool) -> "Origin":
        """Look at a file that has just been read.

        Args:
            path: The file, or a pipe; or a data frame, which has no file.
            linear: Whether the linear model was asked for.
            as_is: Whether the sheet was to be taken as it is.
        """
        if not isinstance(path, str | Path) or not Path(path).is_file():
            return cls(linear=linear, as_is=as_is)
        with Path(path).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        seconds = int(Path(path).stat().st_mtime)
        changed = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC"
        return cls(digest, changed, linear, as_is)
