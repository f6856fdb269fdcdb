"""One HTML file without outside links: a verdict, sections, tables and pictures."""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from edtk.report.png import png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 120
STYLE = """
:root { color-scheme: light dark; --line: #8884; --good: #00795c; --warn: #b35900; --bad: #b3261e; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin-top: 2rem; }
.verdict { border-left: .4rem solid; border-radius: .3rem; padding: .6rem 1rem; background: #8881; }
.verdict p { margin: .3rem 0; }
.verdict p:first-child { font-size: 1.15rem; font-weight: 600; }
.good { border-color: var(--good); }
.usable { border-color: var(--warn); }
.bad { border-color: var(--bad); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid var(--line); }
th, td { text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; background: white; border-radius: .3rem; }
figcaption, footer { font-size: .9rem; opacity: .8; }
"""


@dataclass(frozen=True)
class Page:
    """A page for a desk or a phone.

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
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{title}</title>\n<link rel="icon" href="data:,">\n'
            f"<style>{STYLE}</style>\n</head>\n"
            f"<body>\n<h1>{title}</h1>\n{body}\n</body>\n</html>\n"
        )


def verdict(level: str, lines: Sequence[str]) -> str:
    """A box with the verdict: "good", "usable" or "bad", the first line the most important."""
    text = "".join(f"<p>{escape(line)}</p>" for line in lines)
    return f'<div class="verdict {level}" id="verdict" data-level="{level}">{text}</div>'


def heading(text: str) -> str:
    """The heading of a section."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str) -> str:
    """Plain text."""
    return f"<p>{escape(text)}</p>"


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table that scrolls sideways where the screen is narrow."""
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(f"<tr>{_cells(row)}</tr>" for row in rows)
    return (
        f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _cells(row: Sequence[object]) -> str:
    """The cells of one row."""
    return "".join(f"<td>{escape(str(cell))}</td>" for cell in row)


def picture(figure: "Figure", caption: str) -> str:
    """A figure inside the page; its caption is also for those who do not see it."""
    data = base64.b64encode(png(figure, DPI)).decode("ascii")
    text = escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def footer(text: str) -> str:
    """The line at the bottom, which tells where the numbers come from."""
    return f"<footer><p>{escape(text)}</p></footer>"
