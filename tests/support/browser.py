"""What a headless browser makes of a report, and of a page whose script runs."""

import base64
import json
import os
import re
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

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


SECONDS = 30  # that the browser has for an answer
OFFLINE = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--hide-scrollbars",
    "--force-device-scale-factor=1",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--remote-debugging-pipe",
)

# Becomes a program whose descriptors 3 and 4 are two that it was given.
WITH_PIPES = """
import os, sys
heard, said = (int(number) for number in sys.argv[1:3])
os.dup2(heard, 103)
os.dup2(said, 104)
os.dup2(103, 3)
os.dup2(104, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Browser:
    """A headless chromium without a network, spoken to by its DevTools protocol over two pipes.

    Messages are JSON, each ended by a zero byte; the browser reads descriptor 3 and writes 4.

    Attributes:
        requests: Addresses that pages have asked for, the page's own file among them.
        complaints: What pages wrote to the console, and errors of their scripts.
    """

    def __init__(self, folder: Path) -> None:
        assert CHROMIUM is not None
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._number = 0
        self._left = b""
        heard, self._write = os.pipe()
        self._read, said = os.pipe()
        command = [CHROMIUM, *OPTIONS, f"--user-data-dir={folder}", "about:blank"]
        begun = [sys.executable, "-S", "-E", "-c", WITH_PIPES, str(heard), str(said), *command]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(
            begun, pass_fds=(heard, said), stdin=quiet, stdout=quiet, stderr=quiet
        )
        os.close(heard)
        os.close(said)
        self._session = ""
        pages = self.call("Target.getTargets")["targetInfos"]
        target = next(one["targetId"] for one in pages if one["type"] == "page")
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Network.emulateNetworkConditions", **OFFLINE)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *error: object) -> None:
        self._session = ""
        self.call("Browser.close")
        self._process.wait(SECONDS)
        os.close(self._read)
        os.close(self._write)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask the browser, and wait for its answer."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _next(self) -> dict[str, Any]:
        """The next message, of which events are kept."""
        until = time.monotonic() + SECONDS
        while b"\0" not in self._left:
            left = until - time.monotonic()
            assert left > 0, "the browser does not answer"
            assert select.select([self._read], [], [], left)[0], "the browser does not answer"
            self._left += os.read(self._read, 1 << 20)
        text, _, self._left = self._left.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        given = message.get("params", {})
        match message.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(given["request"]["url"])
            case "Runtime.consoleAPICalled":
                self.complaints.append(" ".join(str(one.get("value")) for one in given["args"]))
            case "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(given["exceptionDetails"]))
            case "Log.entryAdded" if given["entry"]["level"] == "error":
                self.complaints.append(given["entry"]["text"])
        return message

    def open(self, path: Path, width: int = 1280, height: int = 900, dark: bool = False) -> None:
        """Load a page, on a screen of that size [px], in a light or a dark scheme."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=path.absolute().as_uri())
        while self.run("document.readyState") != "complete":
            time.sleep(0.01)
        self.settle()

    def settle(self) -> None:
        """Wait until the page has drawn what it was asked to."""
        twice = "new Promise(f => requestAnimationFrame(() => requestAnimationFrame(() => f(1))))"
        self.run(twice)

    def run(self, expression: str) -> Any:
        """The value of an expression of JavaScript in the page."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def press(self, key: str, shift: bool = False) -> None:
        """Press a key."""
        given: dict[str, Any] = {"key": key, "code": key, "modifiers": 8 if shift else 0}
        if len(key) == 1:
            given["text"] = key
        self.call("Input.dispatchKeyEvent", type="keyDown", **given)
        self.call("Input.dispatchKeyEvent", type="keyUp", **given)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Move the mouse with its left button down."""
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        for kind, (x, y) in (
            ("mousePressed", start),
            ("mouseMoved", end),
            ("mouseReleased", end),
        ):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)

    def picture(self, path: Path) -> None:
        """Write what is to be seen (PNG)."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))
