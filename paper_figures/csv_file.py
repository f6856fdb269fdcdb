"""Data frames as files."""

from pathlib import Path

import pandas as pd

from edtk.system.files import write_text


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """Write a table atomically, with seven significant digits."""
    write_text(path, table.to_csv(index=False, float_format="%.7g", lineterminator="\n"))
