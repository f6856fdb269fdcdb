"""Seconds and peak memory of a function, each call in a process of its own."""

import multiprocessing as mp
import platform
import resource
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Measured:
    """The outcome of a call.

    Attributes:
        answer: What the function returned; None where it failed.
        peak_mb: Peak memory of its process [MB].
        failure: Why there is no answer, or "".
    """

    answer: Any
    peak_mb: float
    failure: str = ""


def measure(function: Callable[..., Any], *args: Any, limit: float = 600.0) -> Measured:
    """Call a function of a module in a fresh process, for at most `limit` seconds.

    A process of its own has no memory of the calls before, and can be ended.
    """
    context = mp.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_call, args=(there, function, args))
    process.start()
    there.close()
    try:
        if not here.poll(limit):
            return Measured(None, 0.0, f"> {limit:g} s")
        return here.recv()
    except EOFError:
        return Measured(None, 0.0, "died")
    finally:
        process.kill()
        process.join()


def _call(pipe: Connection, function: Callable[..., Any], args: tuple[Any, ...]) -> None:
    try:
        answer = function(*args)
        failure = ""
    except Exception as error:
        answer = None
        failure = type(error).__name__
    # The peak is in bytes on macOS, and in kilobytes on Linux.
    unit = 1e6 if sys.platform == "darwin" else 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    pipe.send(Measured(answer, peak, failure))


def machine() -> str:
    """Processor, number of cores and Python, as far as the system tells."""
    name = platform.processor()
    cores = 0
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        name = names[0] if names else name
        cores = len(names)
    python = f"Python {platform.python_version()}"
    return f"{name or platform.machine()}, {cores or mp.cpu_count()} cores, {python}"
