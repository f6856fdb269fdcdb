"""Tables for terminals."""

from collections.abc import Iterable, Sequence

GAP = "  "


def text_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a table whose first column is aligned to the left and the others to the right."""
    lines = [list(header), *([str(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(GAP.join(_cells(line, widths)).rstrip() for line in lines)


def _cells(line: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Cells of one line, padded."""
    first, *others = zip(line, widths, strict=True)
    return [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
