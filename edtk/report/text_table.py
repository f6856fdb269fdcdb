"""Tables for terminals."""

from collections.abc import Iterable, Sequence

GAP = "  "


def text_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a table whose first column is aligned to the left and the others to the right."""
    lines = [list(header), *([str(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(GAP.join(_cells(line, widths)).rstrip() for line in lines)


def name_width(names: Iterable[str], least: int) -> int:
    """Width of a column of names at the left: `least`, or more where a name would fill it."""
    return max(least, *(len(name) + len(GAP) for name in names))


def number_columns(header: Sequence[str], rows: Iterable[Sequence[str]], least: int) -> list[str]:
    """Lines of columns that are aligned to the right, the header first.

    Args:
        header: Names of the columns.
        rows: Their cells.
        least: Width of a column, gap included; it is wider where a name or a cell would fill it.
    """
    lines = [list(header), *map(list, rows)]
    widths = [
        max(least, *(len(cell) + len(GAP) for cell in column))
        for column in zip(*lines, strict=True)
    ]
    return [
        "".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in lines
    ]


def _cells(line: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Cells of one line, padded."""
    first, *others = zip(line, widths, strict=True)
    return [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
