"""The two files of a verb that answers a question of design: a table, and what proves it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from edtk.system.atomic_file import Content, write_files
from edtk.verbs.require_output import require_different, require_output

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class TableAndCertificate:
    """Where they go; both may be standard output, `-`, but not at once.

    Attributes:
        out: The table (CSV); None for none.
        certificate: What proves the numbers (JSON); None for none.
    """

    out: Path | str | None
    certificate: Path | str | None

    def require(self, *inputs: Path | str | None) -> None:
        """Check, before long work, that both can be written.

        Args:
            inputs: The files that the call reads; None entries do not count.

        Raises:
            UserError: They are the same file, or one of them is an input or holds measurements.
            OSError: A file cannot be written.
        """
        require_different(out=self.out, certificate=self.certificate)
        for path in (self.out, self.certificate):
            require_output(path, *inputs)

    def write(self, table: Callable[[], "pd.DataFrame"], proof: Callable[[], str]) -> None:
        """Write what was asked for, both files or none.

        Args:
            table: Makes the table.
            proof: Makes the text of the certificate.
        """
        from edtk.tables.csv_text import csv_text

        files: dict[Path, Content] = {}
        if self.out is not None:
            files[Path(self.out)] = csv_text(table())
        if self.certificate is not None:
            files[Path(self.certificate)] = proof()
        write_files(files)
