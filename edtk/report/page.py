"""One HTML file without outside links: a verdict, sections, tables and pictures."""

import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.report.figures import BLUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The shadows at the edges of a box that scrolls are the cue that there is more: two covers in the
# colour of the page move with the content and hide them where there is none.
# Of a picture [inch]: letters can be read on a phone, and on a desk two have room.
PICTURE_WIDTH = 4.4
PAGE_STYLE = """
:root { color-scheme: light dark; --page: #fff; --ink: #1b1b1b; --line: #8886; --shade: #0007;
  --good: #00795c; --usable: #b35900; --bad: #b3261e; --blue: #0072b2; }
@media (prefers-color-scheme: dark) { :root { --page: #17191c; --ink: #e8e8e8; --shade: #fff9;
  --good: #3fbf98; --usable: #f0983e; --bad: #f2766d; --blue: #4ba6dd; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 80rem; margin: 0 auto; padding: 1rem;
  background: var(--page); color: var(--ink); overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin: 1.5rem 0 0; }
h3 { font-size: 1rem; margin: .5rem 0; }
.verdict { border-left: .4rem solid; border-radius: .3rem; padding: .6rem 1rem; background: #8881; }
.verdict p { margin: .3rem 0; }
.verdict p:first-child { font-size: 1.15rem; font-weight: 600; }
.good { border-color: var(--good); }
.usable { border-color: var(--usable); }
.bad { border-color: var(--bad); }
section { display: grid; gap: .75rem 1.5rem; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 32rem), 1fr)); }
section > * { min-width: 0; margin-bottom: 0; }
h2, section > p, .full { grid-column: 1 / -1; }
section > p { margin: 0; }
p { max-width: 60rem; }
.number { white-space: nowrap; }
.box { overflow-x: auto; background:
  linear-gradient(to right, var(--page) 60%, transparent) left / 1.5rem 100% no-repeat local,
  linear-gradient(to left, var(--page) 60%, transparent) right / 1.5rem 100% no-repeat local,
  linear-gradient(to right, var(--shade), transparent) left / .7rem 100% no-repeat scroll,
  linear-gradient(to left, var(--shade), transparent) right / .7rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .5rem; border-bottom: 1px solid var(--line); vertical-align: top; }
th, td { text-align: right; white-space: nowrap; }
th { vertical-align: bottom; white-space: normal; }
th:first-child, td:first-child, .words { text-align: left; }
td.words { white-space: normal; min-width: 11rem; }
dl { display: grid; grid-template-columns: minmax(6rem, auto) 1fr; gap: .25rem 1rem; margin: 0; }
dt { opacity: .8; } dd { margin: 0; min-width: 0; overflow-wrap: anywhere; }
figure { margin: 0; }
svg { display: block; width: 100%; height: auto; }
svg text { fill: currentColor; }
figcaption { font-size: .9rem; opacity: .8; }
@media print {
  :root { color-scheme: light; --page: #fff; --ink: #000; --good: #00795c; --usable: #b35900;
    --bad: #b3261e; --blue: #0072b2; }
  body { font-size: 10pt; padding: 0; max-width: none; }
  section { display: block; }
  section > * { margin-top: .5rem; }
  figure, .verdict, .box, p, tr, dl { break-inside: avoid; }
  h2, h3, section > p { break-after: avoid; }
  .box { overflow: visible; background: none; }
  th, td { white-space: normal; padding: .15rem .4rem; font-size: 8.5pt; }
  svg { min-width: 0 !important; max-width: 11cm !important; max-height: 22cm; }
  .full svg { max-width: 17cm !important; }
}
"""
QUALITY = {
    "good": "Good calibration.",
    "usable": "Usable calibration, with a warning.",
    "bad": "Do not use this calibration yet.",
}
MANY_POINTS = 500  # points of a line, beyond which dots of a raster take less room than a drawing
RASTER_DPI = 110  # of such rasters
PX = 96  # of CSS, an inch
WIDE = 430.0  # px, beyond which a picture has a row of its own and scrolls on a phone
MOST_ENLARGED = 1.25
# What a browser may load: styles and pictures in the file itself, and nothing else. Text of a study
# or a sheet that would pass for HTML could neither run nor ask anybody for anything.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


# Names of elements come from their content and this salt, so that the same figure is the same text.
SETTINGS: dict[Any, str] = {"svg.fonttype": "none", "svg.hashsalt": "edtk"}
NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))


def svg(figure: "Figure") -> tuple[str, float]:
    """Draw a figure as SVG that takes its text colour from the page, on no background.

    Returns:
        The element, and its width [px of CSS].
    """
    import matplotlib
    from matplotlib.lines import Line2D

    for line in figure.findobj(Line2D):
        if np.size(line.get_xdata()) > MANY_POINTS:
            line.set_rasterized(True)
    buffer = io.StringIO()
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(buffer, format="svg", transparent=True, dpi=RASTER_DPI, metadata=NO_METADATA)
    text = buffer.getvalue()
    text = text[text.index("<svg") :].replace("#000000", "currentColor")
    # A page has a brighter blue in the dark.
    text = text.replace(BLUE.lower(), "var(--blue)")
    # Inside a page the element needs neither names of dialects nor a version.
    text = re.sub(r' (?:xmlns(?::xlink)?|version)="[^"]*"', "", text)
    return _without_unused_names(text).strip(), PX * figure.get_figwidth()


def _without_unused_names(text: str) -> str:
    """The drawing without names that nothing in it refers to: those of other figures are alike."""
    used = set(re.findall(r'#([^")]+)["\)]', text))
    return re.sub(r' id="([^"]*)"', lambda name: name[0] if name[1] in used else "", text)


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


def sentence(text: str, names: tuple[str, ...] = ()) -> str:
    """A text with a full stop, unless it asks, and a capital, unless it begins with a name."""
    begun = text if text.startswith(names) else f"{text[:1].upper()}{text[1:]}"
    return begun if begun.endswith(("?", ".")) else f"{begun}."


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
