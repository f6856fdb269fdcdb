"""Runs one command line in this process, as if it were the only one."""

import contextlib
import gc
import io
import os
import resource
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from edtk.cli import main

ROOMS = ("/edtk/", "/criteria/")


@dataclass(frozen=True)
class Answer:
    """What a command did.

    Attributes:
        code: Exit code.
        stdout: Standard output.
        stderr: Standard error.
        error: Place and class of an exception that nobody caught; empty if there is none.
        cpu: Processor time [s].
        growth: By how much the peak of memory grew [MB].
    """

    code: int
    stdout: bytes
    stderr: bytes
    error: str
    cpu: float
    growth: float


def run_case(words: tuple[str, ...], folder: Path) -> Answer:
    """Run a command line in a folder, with standard output and error in files.

    Descriptors 1 and 2 themselves lead to the files, so that what libraries print in C is seen.
    """
    os.chdir(folder)
    peak = _peak()
    began = time.process_time()
    with _captured() as (stdout, stderr):
        code, error = _run(words)
    cpu = time.process_time() - began
    # A cycle of one case is not left for another one to be blamed for.
    gc.collect(0)
    return Answer(code, _read(stdout), _read(stderr), error, cpu, _peak() - peak)


def _run(words: tuple[str, ...]) -> tuple[int, str]:
    """Exit code, and the place of an exception that nobody caught."""
    with warnings.catch_warnings():
        # As a user sees them, but each time, and not only the first time in this process.
        warnings.simplefilter("always")
        for ignored in (DeprecationWarning, PendingDeprecationWarning, ImportWarning):
            warnings.simplefilter("ignore", ignored)
        warnings.simplefilter("ignore", ResourceWarning)
        try:
            main(args=list(words), prog_name="edtk")
        except SystemExit as end:
            return (end.code, "") if isinstance(end.code, int) else (int(bool(end.code)), "")
        except BaseException as error:
            return 1, f"{type(error).__name__} in {_place(error)}"
    return 0, ""


def _place(error: BaseException) -> str:
    """The deepest line of edtk, or of its criteria, that an exception came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if any(room in frame.filename for room in ROOMS)]
    if not ours:
        return "edtk/cli.py"
    file = ours[-1].filename
    room = next(room for room in ROOMS if room in file)
    return f"{room[1:]}{file.rpartition(room)[2]}:{ours[-1].name}"


@contextlib.contextmanager
def _captured() -> Iterator[tuple[int, int]]:
    """Descriptors of the files to which standard output and error go."""
    sys.stdout.flush()
    sys.stderr.flush()
    own = sys.stdout, sys.stderr
    kept = os.dup(1), os.dup(2)
    files = os.memfd_create("stdout"), os.memfd_create("stderr")
    for descriptor, file in zip((1, 2), files, strict=True):
        os.dup2(file, descriptor)
    sys.stdout = _stream(1, "strict")
    sys.stderr = _stream(2, "backslashreplace")
    try:
        yield files
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
                stream.detach()
        sys.stdout, sys.stderr = own
        for descriptor, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)


def _stream(descriptor: int, errors: str) -> io.TextIOWrapper:
    """A stream as Python opens it when it starts in a terminal of UTF-8."""
    raw = open(descriptor, "wb", closefd=False)  # noqa: SIM115
    return io.TextIOWrapper(raw, encoding="utf-8", errors=errors, line_buffering=descriptor == 2)


def _read(file: int) -> bytes:
    """All bytes of a file, which is then closed."""
    with open(file, "rb") as stream:
        stream.seek(0)
        return stream.read()


def _peak() -> float:
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
