"""Small files of plain numbers, read without the second that importing pandas can take."""

import re

import numpy as np

from edtk.system.typing import Array

MOST_BYTES = 64_000  # of a file that is read here; in larger ones pandas is faster, import included
TEXT = re.compile(r"[\x20-\x7e\n]*")  # no tab and no lone carriage return
NAME = re.compile(r"[A-Za-z]\w*")
# At most fifteen digits and a small exponent: such a number is a whole one below 2^53, times or
# over an exact power of ten, and every correct reader makes the same float of it. Beyond, pandas
# and Python may differ in the last digit.
NUMBER = re.compile(r"[+-]?(\d+)(?:\.(\d+))?(?:[eE][+-]?0*[0-7])?")
MOST_DIGITS = 15
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
    return len(digits) <= MOST_DIGITS
