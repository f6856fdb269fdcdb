"""One HTML file without outside links: a verdict, sections, tables and pictures."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from edtk.report.page_style import PAGE_STYLE
from edtk.report.svg import svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDE = 430.0  # px, beyond which a picture has a row of its own and scrolls on a phone
MOST_ENLARGED = 1.25
# What a browser may load: styles and pictures in the file itself, and nothing else. Text of a study
# or a sheet that would pass for HTML could neither run nor ask anybody for anything.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


@dataclass(frozen=True)
class Page:
    """A page for a desk, a phone or paper.

    Attributes:
        title: Heading, and the text on the browser's tab.
        parts: Pieces of HTML in order, as the functions of this module make them.
    """

    title: str
    parts: tuple[str, ...] = ()

    def html(self) -> str:
        """The file's text."""
        title = escape(self.title)
        body = "\n".join(self.parts)
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{title}</title>\n<link rel="icon" href="data:,">\n'
            f"<style>{PAGE_STYLE}</style>\n</head>\n"
            f"<body>\n<h1>{title}</h1>\n{body}\n</body>\n</html>\n"
        )


def verdict(level: str, lines: Sequence[str]) -> str:
    """A box with the verdict: "good", "usable" or "bad", the first line the most important."""
    text = "".join(map(paragraph, lines))
    return f'<div class="verdict {level}" id="verdict" data-level="{level}">{text}</div>'


def section(title: str, *parts: str) -> str:
    """A section of two columns where the screen has room for them."""
    return "\n".join(["<section>", f"<h2>{escape(title)}</h2>", *parts, "</section>"])


def paragraph(text: str) -> str:
    """Plain text, across all columns; no line breaks inside a number such as 1.2e-08."""
    whole = re.sub(r"[\d.]+e[-+]\d+", r'<span class="number">\g<0></span>', escape(text))
    return f"<p>{whole}</p>"


def table(
    header: Sequence[str], rows: Iterable[Sequence[object]], words: int = 0, full: bool = False
) -> str:
    """A table that scrolls sideways in its own box where the screen is narrow.

    Args:
        header: Names of the columns, with units.
        rows: Their cells.
        words: Number of columns at the end that hold sentences, which may break.
        full: Whether the table takes all columns of the section.
    """
    first = len(header) - words
    # The name of a column may break before its unit, not inside.
    names = [
        re.sub(r"\[.*\]", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), n)
        for n in header
    ]
    head = "".join(_cell("th", name, i >= first) for i, name in enumerate(names))
    lines = ("".join(_cell("td", c, i >= first) for i, c in enumerate(row)) for row in rows)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    # A box that scrolls can be reached and moved by keys.
    columns = " full" if full else ""
    return (
        f'<div class="box{columns}" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def facts(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Names with what there is to say of each, which breaks into lines."""
    body = "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in rows)
    return f"<div><h3>{escape(title)}</h3><dl>{body}</dl></div>"


def _cell(kind: str, content: object, words: bool) -> str:
    """One cell."""
    style = ' class="words"' if words else ""
    return f"<{kind}{style}>{escape(str(content))}</{kind}>"


def picture(figure: "Figure", caption: str) -> str:
    """A figure inside the page; its caption is also for those who do not see it."""
    drawing, width = svg(figure)
    text = escape(caption)
    # A wide one would be too small to read on a phone: there it scrolls.
    wide = width > WIDE
    least = f"min-width:{width:.0f}px;" if wide else ""
    style = f"{least}max-width:{MOST_ENLARGED * width:.0f}px"
    columns = ' class="full"' if wide else ""
    labelled = drawing.replace("<svg", f'<svg role="img" aria-label="{text}" style="{style}"', 1)
    return (
        f'<figure{columns}><div class="box" tabindex="0">{labelled}</div>'
        f"<figcaption>{text}</figcaption></figure>"
    )
