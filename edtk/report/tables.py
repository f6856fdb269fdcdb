"""Tables for terminals, notebooks and Markdown."""

import math
from collections.abc import Iterable, Sequence
from html import escape

GAP = "  "
SHOWN = 30  # rows; a notebook is for looking, and to_frame() has them all
MOST_LINES = 60  # of a table for a terminal, of which --json and --out have all
LEAST_WIDTH = 3  # of a column; a rule needs three characters


def number(x: float) -> str:
    """Four digits; a dash for NaN."""
    return "-" if math.isnan(x) else f"{x:.4g}"


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:.1f} %" if share >= 0.001 else f"{100 * share:.1g} %"


def text_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a table whose first column is aligned to the left and the others to the right."""
    lines = [list(header), *([str(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(GAP.join(_cells(line, widths)).rstrip() for line in lines)


def left_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table whose columns are all aligned to the left."""
    lines = [header, *rows]
    widths = [name_width(column, 0) for column in zip(*lines, strict=True)]
    return ["".join(map(str.ljust, line, widths)).rstrip() for line in lines]


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


def notebook_table(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[object]], notes: Sequence[str] = ()
) -> str:
    """Write a table in HTML, all text escaped.

    Args:
        caption: The line above it.
        header: Names of the columns.
        rows: Cells; of very many rows the first ones are shown.
        notes: Lines below it.
    """
    cells = list(rows)
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(f"<tr>{_html_cells(row)}</tr>" for row in cells[:SHOWN])
    more = [f"and {len(cells) - SHOWN} more rows"] if len(cells) > SHOWN else []
    lines = "".join(f"<div>{escape(note)}</div>" for note in [*more, *notes])
    return (
        f"<table><caption>{escape(caption)}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{lines}"
    )


def _html_cells(row: Sequence[object]) -> str:
    """The cells of one row."""
    return "".join(f"<td>{escape(str(cell))}</td>" for cell in row)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a table with columns padded to one width.

    Columns of numbers are aligned to the right, others to the left.
    """
    header = [_cell(name) for name in header]
    cells = [[_cell(cell) for cell in row] for row in rows]
    columns = list(zip(*cells, strict=True)) or [()] * len(header)
    widths = [
        max(LEAST_WIDTH, len(name), *map(len, column))
        for name, column in zip(header, columns, strict=True)
    ]
    right = [i > 0 and all(map(_is_numeric, column)) for i, column in enumerate(columns)]

    def line(row: Sequence[str]) -> str:
        aligned = (
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(row, widths, right, strict=True)
        )
        return f"| {' | '.join(aligned)} |"

    rules = (
        f"{'-' * (width + 1)}:" if to_right else "-" * (width + 2)
        for width, to_right in zip(widths, right, strict=True)
    )
    return "\n".join([line(header), f"|{'|'.join(rules)}|", *map(line, cells)]) + "\n"


def _cell(value: object) -> str:
    """A cell in which no other begins."""
    return str(value).replace("|", "\\|")


def _is_numeric(cell: str) -> bool:
    """Whether a cell reads as a number, a percentage, or an empty place."""
    digits = cell.rstrip(" %").lstrip("-+").replace(".", "", 1)
    return cell in ("", "-", "inf", "nan") or digits[:1].isdigit()
