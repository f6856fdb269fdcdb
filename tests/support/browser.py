"""What a headless browser makes of a report."""

import re
import shutil
import subprocess
from collections.abc import Sequence
from html import escape
from pathlib import Path

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
FRAMES = """<!doctype html><title></title><body>{}<script>
function seen(frame) {{
  const page = frame.contentDocument;
  const drawings = [...page.querySelectorAll('figure svg')];
  const shown = drawings.filter(drawing => drawing.getBoundingClientRect().width > 100).length;
  const letters = drawings.flatMap(drawing => [...drawing.querySelectorAll('text')].map(
    text => parseFloat(getComputedStyle(text).fontSize) * drawing.getScreenCTM().a));
  const verdict = page.getElementById('verdict').getBoundingClientRect();
  return [shown, drawings.length, verdict.height > 20 && verdict.top < 400,
    page.documentElement.scrollWidth <= frame.contentWindow.innerWidth,
    Math.min(...letters) >= 9, frame.contentWindow.innerWidth].join(' ');
}}
addEventListener('load', () => {{
  document.title = [...document.querySelectorAll('iframe')].map(seen).join(', ');
}});</script></body>"""
WIDTHS = (1280, 390)


def in_browser(pages: Sequence[str], folder: Path) -> list[str]:
    """For each page, at desk and phone width, what a script outside the page finds in it.

    All pages are frames of one, since a browser takes a second to start. The script is the outer
    page's, because a report's own policy forbids scripts; the report is shown as it is written.

    Args:
        pages: Their HTML.
        folder: Where a file may be written.

    Returns:
        Number of pictures that are shown, of all pictures, whether the verdict is at the top,
        nothing is wider than the screen and all letters can be read, and the width.
    """
    texts = [escape(text) for text in pages]
    frames = [
        f'<iframe width="{width}" height="900" frameborder="0" srcdoc="{page}"></iframe>'
        for page in texts
        for width in WIDTHS
    ]
    path = folder / "report.html"
    path.write_text(FRAMES.format("".join(frames)), encoding="utf-8")
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        f"--user-data-dir={folder}",
        "--window-size=1300,900",
        "--virtual-time-budget=5000",
        "--dump-dom",
    ]
    assert CHROMIUM is not None
    command = [CHROMIUM, *options, str(path)]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "CONSOLE" not in answer.stderr, answer.stderr
    return re.search("<title>(.*)</title>", answer.stdout)[1].split(", ")
