"""The cells of a CSV file as people and their spreadsheets write it."""

import csv
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Union

from edtk.system.errors import UserError
from edtk.system.note import note
from edtk.system.typing import Array
from edtk.tables.plain_numbers import plain_numbers

if TYPE_CHECKING:
    import pandas as pd

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
NAMED_SEPARATOR = re.compile(r"\s*\"?sep=([,;\t])\"?[ \r]*\n")  # a first line for spreadsheets
COMMA = re.compile(r"^[^#\n]*,", re.MULTILINE)  # outside comments
POINT = re.compile(r"\d\.\d")
LEFT_OUT = "\0"  # begins the name of a column without a header and without cells


class PoseFileError(UserError):
    """A file that cannot be read as a table of poses; names the file and the row or column."""


def read_cells(text: str, path: Path) -> Union["pd.DataFrame", dict[str, Array]]:
    """Read a table of numbers, and say in a note what was assumed of its form.

    Columns are separated by commas, or by semicolons or tabs, and then numbers may have decimal
    commas. Rows and columns at the end that are empty are left out; so is the rest of a line after
    a #.

    Args:
        text: The text of the file.
        path: The file, for messages.

    Returns:
        Columns by the names of the header, each of which is there once: finite numbers, or a data
        frame whose columns may hold anything.

    Raises:
        PoseFileError: The header or a row is not that of a table; names it.
    """
    columns = plain_numbers(text)
    if columns is not None:
        return columns
    if "\0" in text:
        row = text.count("\n", 0, text.index("\0")) + 1
        raise PoseFileError("has a null character; expected text", where=path, key=f"line {row}")
    named = NAMED_SEPARATOR.match(text)
    text = text[named.end() :] if named else text
    line = next(_content(text), "")
    separator = named[1] if named else _separator(line)
    header = _header(line, separator, path)
    assumed = [f"{SEPARATORS[separator]} between columns"] if separator != "," else []
    decimal = "."
    if separator != "," and COMMA.search(text, text.index(line) + len(line)):
        decimal = ","
        assumed.append("decimal commas")
    cells = _read_csv(text, path, header, separator, decimal)
    if decimal == ",":
        _require_commas(cells, path)
    cells, empty = _without_empty(cells, path)
    _require_even(cells, text, path, header, separator)
    if assumed or empty:
        note("read with " + ", ".join([*assumed, *empty]), path)
    return cells


def _separator(header: str) -> str:
    """The sign that separates the columns of a header: the most frequent one outside quotes."""
    bare = re.sub(r'"[^"]*"', "", header)
    return max(SEPARATORS, key=bare.count)


def _header(line: str, separator: str, path: Path) -> list[str]:
    """Names of the columns; those at the end that have none are named as left out.

    Raises:
        PoseFileError: A name is missing, or there twice.
    """
    try:
        names = next(_rows(line, separator), [])
    except csv.Error:
        raise PoseFileError("the header has a quote that is not closed", where=path) from None
    names = [name.strip() for name in names]
    if not any(names):
        raise PoseFileError("is no CSV table; expected a header and rows", where=path)
    last = max(i for i, name in enumerate(names) if name)
    for i, name in enumerate(names[: last + 1]):
        if not name:
            message = f"column {i + 1} has no name; expected one in the header"
            raise PoseFileError(message, where=path)
        if name in names[:i]:
            raise PoseFileError(f"column {name!r} is there twice; expected each once", where=path)
    return [name or f"{LEFT_OUT}{i + 1}" for i, name in enumerate(names)]


def _read_csv(
    text: str, path: Path, header: list[str], separator: str, decimal: str
) -> "pd.DataFrame":
    """All rows, as pandas reads them.

    Raises:
        PoseFileError: A row has too many cells, or a quote is not closed; names the row.
    """
    import pandas as pd

    try:
        with warnings.catch_warnings():
            # Pandas only warns of a first row that is longer than the header.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                # Bytes, as pandas would hold four bytes a character of a text.
                io.BytesIO(text.encode("utf-8")),
                sep=separator,
                decimal=decimal,
                names=header,
                header=0,
                skipinitialspace=True,
                comment="#",
                index_col=False,
                low_memory=False,
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        _require_rows(text, path, header, separator)
        reason = str(error).splitlines()[0].strip()
        raise PoseFileError(f"not readable as CSV ({reason})", where=path) from error


def _require_commas(cells: "pd.DataFrame", path: Path) -> None:
    """Check that no cell has a decimal point where others have commas: it may mean thousands.

    Raises:
        PoseFileError: A cell has; names row and column.
    """
    for column in cells.select_dtypes(exclude="number"):
        with_point = cells[column].astype(str).str.contains(POINT)
        if with_point.any():
            row = int(with_point.to_numpy().argmax())
            cell = str(cells[column].iloc[row])
            raise PoseFileError(
                f"{cell!r} has a point, and other cells have decimal commas; expected one of both",
                where=path,
                key=f"row {row + 1}, column {column}",
            )


def _without_empty(cells: "pd.DataFrame", path: Path) -> tuple["pd.DataFrame", list[str]]:
    """The cells without empty rows and columns at the end, and which these were, in words.

    Raises:
        PoseFileError: A column without a name has cells.
    """
    words = []
    unnamed = [i for i, name in enumerate(cells) if str(name).startswith(LEFT_OUT)]
    for i in unnamed:
        if cells.iloc[:, i].notna().any():
            message = f"column {i + 1} has no name; expected one in the header"
            raise PoseFileError(message, where=path)
    if unnamed:
        cells = cells.drop(columns=cells.columns[unnamed])
        words.append(f"{_counted(len(unnamed), 'empty column')} at the end left out")
    if len(cells) and cells.iloc[-1].isna().all():
        filled = cells.notna().any(axis=1).to_numpy()
        rows = int(filled.nonzero()[0].max(initial=-1)) + 1
        words.append(f"{_counted(len(cells) - rows, 'empty row')} at the end left out")
        cells = cells.iloc[:rows]
    return cells, words


def _counted(number: int, thing: str) -> str:
    """So many things: "2 empty rows"."""
    return f"{number} {thing}{'s' * (number > 1)}"


def _require_even(
    cells: "pd.DataFrame", text: str, path: Path, header: list[str], separator: str
) -> None:
    """Check that no row is short, where its last cell is missing.

    Raises:
        PoseFileError: A row is; names it.
    """
    # Pandas fills short rows; only the text tells them from rows with an empty last cell.
    if cells.iloc[:, -1].isna().any():
        _require_rows(text, path, header, separator, len(cells))


def _require_rows(
    text: str, path: Path, header: list[str], separator: str, most: int | None = None
) -> None:
    """Check that all rows, or the first ones, have as many cells as the header.

    Raises:
        PoseFileError: A row has more or fewer, or a quote is not closed; names the row.
    """
    number = 0
    try:
        for number, row in enumerate(_rows(text, separator)):
            if most is not None and number > most:
                return
            if len(row) != len(header):
                raise PoseFileError(
                    f"{len(row)} cells; expected {len(header)}, as in the header",
                    where=path,
                    key=f"row {number}",
                )
    except csv.Error:
        message = "a quote is not closed, or is in the midst of a cell"
        raise PoseFileError(message, where=path, key=f"row {number + 1}") from None


def _rows(text: str, separator: str) -> Iterator[list[str]]:
    """The cells of all rows, the header first."""
    return csv.reader(_content(text), delimiter=separator, skipinitialspace=True, strict=True)


def _content(text: str) -> Iterator[str]:
    """Lines without comments, and without those that are blank."""
    for line in io.StringIO(text, newline=None):  # any line end
        bare = line.partition("#")[0].rstrip("\r\n")
        if bare.strip(" ") and not line.startswith("#"):
            yield bare
