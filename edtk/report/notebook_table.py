"""Tables for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape

SHOWN = 30  # rows; a notebook is for looking, and to_frame() has them all


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
    body = "".join(f"<tr>{_cells(row)}</tr>" for row in cells[:SHOWN])
    more = [f"and {len(cells) - SHOWN} more rows"] if len(cells) > SHOWN else []
    lines = "".join(f"<div>{escape(note)}</div>" for note in [*more, *notes])
    return (
        f"<table><caption>{escape(caption)}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{lines}"
    )


def _cells(row: Sequence[object]) -> str:
    """The cells of one row."""
    return "".join(f"<td>{escape(str(cell))}</td>" for cell in row)
