"""The cells of CSV files as people and their spreadsheets write them, and tables as CSV."""

import csv
import io
import re
import warnings
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from edtk.system.errors import UserError, note
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

MOST_BYTES = 64_000  # of a file that is read here; in larger ones pandas is faster, import included
DIGITS_OF_DOUBLE = 15
TEXT_MARK = "'"  # before a cell that a spreadsheet shall take as text, as OWASP recommends
MANY = 1000  # rows from which printing is to be fast
BLOCK = 10_000  # rows printed at a time
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
LEFT_OUT = "\0"  # begins the name of a column without a header and without cells


TEXT = re.compile(r"[\x20-\x7e\n]*")  # no tab and no lone carriage return
NAME = re.compile(r"[A-Za-z]\w*")
# At most fifteen digits and a small exponent: such a number is a whole one below 2^53, times or
# over an exact power of ten, and every correct reader makes the same float of it. Beyond, pandas
# and Python may differ in the last digit.
NUMBER = re.compile(r"[+-]?(\d+)(?:\.(\d+))?(?:[eE][+-]?0*[0-7])?")
# Pandas reads a column of whole numbers as such, in which a negative zero has no sign.
NEGATIVE_ZERO = re.compile(r"-0+")


def plain_numbers(text: str) -> dict[str, Array] | None:
    """Read the text of a CSV file if it is so plain that every reader reads the same from it.

    That is: small, a header of distinct names, as many cells in each row, and each cell an
    unquoted decimal number. Lines that begin with # and empty lines are skipped.

    Args:
        text: The whole text.

    Returns:
        Columns by name, or None where a full reader of CSV is needed, if only for its messages.
    """
    lines = _lines(text)
    if lines is None or len(lines) < 2:
        return None
    rows = [[cell.lstrip(" ") for cell in line.split(",")] for line in lines]
    header = rows[0]
    if len(set(header)) < len(header) or not all(map(NAME.fullmatch, header)):
        return None
    cells = rows[1:]
    if any(len(row) != len(header) for row in cells):
        return None
    if not all(_is_plain(cell) for row in cells for cell in row):
        return None
    values = np.array([[float(cell) for cell in row] for row in cells])
    return {name: values[:, j].copy() for j, name in enumerate(header)}


def _lines(text: str) -> list[str] | None:
    """Lines with content, or None where the text is long or not plain."""
    if len(text) > MOST_BYTES:
        return None
    text = text.replace("\r\n", "\n")
    if not TEXT.fullmatch(text):
        return None
    return [line for line in text.split("\n") if line and not line.startswith("#")]


def _is_plain(cell: str) -> bool:
    """Whether every reader makes the same number of a cell."""
    match = NUMBER.fullmatch(cell)
    if match is None or NEGATIVE_ZERO.fullmatch(cell):
        return False
    digits = match.group(1) + (match.group(2) or "")
    return len(digits) <= DIGITS_OF_DOUBLE


# A spreadsheet runs a cell that begins with one of these; blanks before them do not help.
FORMULA = re.compile(r"\s*[=+\-@]|[\t\r]")

QUOTED = re.compile(r'[",\r\n]')  # in text that CSV has between quotes


def csv_text(table: "pd.DataFrame", digits: int = 10) -> str:
    """Write a table as CSV, with a header, without an index.

    Text that a spreadsheet would run as a formula begins with an apostrophe; numbers stay numbers.

    Args:
        table: The table.
        digits: Significant digits of a number that is not whole.
    """
    safe = table.set_axis([_as_text(name) for name in table.columns], axis="columns")
    for i, kind in enumerate(table.dtypes):
        if kind.kind not in "iufb":
            cells = table.iloc[:, i].tolist()
            known = {cell: _as_text(cell) for cell in set(cells)}  # most repeat
            safe.isetitem(i, [known[cell] for cell in cells])
    columns = [safe.iloc[:, i] for i in range(safe.shape[1])]
    formats = [_format(column, digits) for column in columns]
    if len(table) < MANY or "" in formats:
        text = safe.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n")
        return str(text)
    header = str(safe.iloc[:0].to_csv(index=False, lineterminator="\n"))
    line = ",".join(formats) + "\n"
    values = [column.tolist() for column in columns]
    parts = [header]
    for first in range(0, len(table), BLOCK):
        block = list(zip(*(column[first : first + BLOCK] for column in values), strict=True))
        parts.append(line * len(block) % tuple(chain.from_iterable(block)))
    return "".join(parts)


def _format(column: "pd.Series", digits: int) -> str:
    """How each cell of a column is printed; empty where cells differ in that.

    Printing many rows by one format takes a fifth of the time that pandas takes.
    """
    kind = column.dtype.kind
    if kind in "iu":
        return "%d"
    if kind == "f":
        return f"%.{digits}g" if np.isfinite(column.to_numpy()).all() else ""
    cells = column.unique().tolist() if kind != "b" else [None]
    plain = all(isinstance(cell, str) and cell and not QUOTED.search(cell) for cell in cells)
    return "%s" if plain else ""


def _as_text(cell: Any) -> Any:
    """A cell that no spreadsheet runs; anything but text stays as it is."""
    return TEXT_MARK + cell if isinstance(cell, str) and FORMULA.match(cell) else cell


NAMED_SEPARATOR = re.compile(r"\s*\"?sep=([,;\t])\"?[ \r]*\n")  # a first line for spreadsheets
COMMA = re.compile(r"^[^#\n]*,", re.MULTILINE)  # outside comments
POINT = re.compile(r"\d\.\d")
# What a spreadsheet writes where a formula fails: no comment, with which the row would be gone.
SPREADSHEET_ERROR = re.compile(
    r"(?:^|[,;\t]) *\"?(?P<cell>#(?:N/A|REF!|DIV/0!|VALUE!|NAME\?|NUM!|NULL!|SPILL!))",
    re.MULTILINE,
)


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
    failed = SPREADSHEET_ERROR.search(text)
    if failed is not None:
        row = text.count("\n", 0, failed.start("cell")) + 1
        message = f"'{failed['cell']}' is an error of a spreadsheet; expected a number"
        raise PoseFileError(message, where=path, key=f"line {row}")
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
