"""Tables in Markdown."""

from collections.abc import Iterable, Sequence

LEAST_WIDTH = 3  # of a column; a rule needs three characters


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
