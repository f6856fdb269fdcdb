"""Tables in Markdown."""

from collections.abc import Iterable, Sequence


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table with columns padded to one width; numbers are right-aligned, text left-aligned."""
    cells = [[str(c).replace("|", "\\|") for c in row] for row in rows]
    widths = [
        max(3, len(h), *(len(r[i]) for r in cells)) if cells else max(3, len(h))
        for i, h in enumerate(header)
    ]
    right = [i > 0 and all(_numeric(r[i]) for r in cells) for i in range(len(header))]

    def line(row: Sequence[str]) -> str:
        pairs = zip(row, widths, right, strict=True)
        return "| " + " | ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in pairs) + " |"

    rule = (
        "|"
        + "|".join(
            f"{'-' * (w + 1)}:" if r else "-" * (w + 2) for w, r in zip(widths, right, strict=True)
        )
        + "|"
    )
    return "\n".join([line(header), rule, *map(line, cells)]) + "\n"


def _numeric(cell: str) -> bool:
    """Whether a cell reads as a number, a percentage, or an empty place."""
    digits = cell.rstrip(" %").lstrip("-+").replace(".", "", 1)
    return cell in ("", "-", "inf", "nan") or digits[:1].isdigit()
