"""Runs many cases in processes that may die."""

import contextlib
import faulthandler
import json
import os
import resource
import select
import signal
import tempfile
import time
import traceback
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tests.fuzz.case import make_case
from tests.fuzz.judge import MOST_S, judge
from tests.fuzz.run_case import run_case
from tests.fuzz.same_again import same_again
from tests.fuzz.sandbox import Sandbox
from tests.fuzz.worlds import Files

Outcome = dict[str, Any]  # number, kind, verb, code, cpu, words and findings; or the bare number

BATCH = 250  # cases of one process
MOST_ADDRESSES = 6 * 1024**3  # bytes that a process may ask for
MOST_ON_DISK = 200 * 1024**2  # bytes of one file
PATIENCE_S = 120.0  # by the clock, after which a case is taken to hang
GRACE_S = 2  # between the signal that prints where a slow case is, and the end


class _Child:
    """A process that runs a batch of cases and tells of each."""

    def __init__(self, numbers: Sequence[int], worlds: dict[str, Files], folder: Path) -> None:
        self.left = deque(numbers)
        self.said = b""
        self.last = time.monotonic()
        # Where the process is when it takes too long, or dies.
        self.black_box = tempfile.TemporaryFile()  # noqa: SIM115
        self.pipe, writing = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self.pipe)
            try:
                _serve(numbers, worlds, folder / str(numbers[0]), writing, self.black_box.fileno())
            except Exception:
                traceback.print_exc()  # a fault of the fuzzer's own
            finally:
                os._exit(0)
        os.close(writing)

    def fileno(self) -> int:
        """The pipe, for `select`."""
        return self.pipe

    def read(self) -> tuple[list[Outcome], bool]:
        """Outcomes that have come, and whether the process has ended."""
        chunk = os.read(self.pipe, 1 << 20)
        *lines, self.said = (self.said + chunk).split(b"\n")
        self.last = time.monotonic()
        outcomes = [json.loads(line) for line in lines]
        for _ in outcomes:
            self.left.popleft()
        return outcomes, not chunk

    def end(self) -> str:
        """Wait for the process; the reason if it did not end by itself."""
        os.close(self.pipe)
        _, status = os.waitpid(self.pid, 0)
        if not os.WIFSIGNALED(status):
            return ""
        number = os.WTERMSIG(status)
        reason = f"more than {MOST_S:g} s" if number in (24, 9) else signal.Signals(number).name
        self.black_box.seek(0)
        trace = self.black_box.read().decode("utf-8", "replace")
        return f"{reason} in {_deepest(trace)}"


def run_cases(numbers: Sequence[int], worlds: dict[str, Files], workers: int) -> Iterator[Outcome]:
    """Run cases, several at a time; a case that kills its process is told of like any other.

    Args:
        numbers: Of the cases.
        worlds: The valid files of each world.
        workers: Processes at a time.
    """
    batches = deque(numbers[i : i + BATCH] for i in range(0, len(numbers), BATCH))
    children: list[_Child] = []
    with tempfile.TemporaryDirectory(prefix="edtk-fuzz-", dir=_in_memory()) as folder:
        try:
            while batches or children:
                while batches and len(children) < workers:
                    children.append(_Child(batches.popleft(), worlds, Path(folder)))
                yield from _news(children, batches, worlds)
        finally:
            for child in children:
                os.kill(child.pid, signal.SIGKILL)
                child.end()


def _in_memory() -> str | None:
    """A folder in memory, where there is one: each case writes and removes a dozen files."""
    folder = "/dev/shm"
    return folder if os.access(folder, os.W_OK) else None


def _news(
    children: list[_Child], batches: deque[Sequence[int]], worlds: dict[str, Files]
) -> Iterator[Outcome]:
    """Outcomes that come within a second; what a dead process left undone becomes a batch again."""
    ready, _, _ = select.select(children, [], [], 1.0)
    for child in ready:
        outcomes, ended = child.read()
        yield from outcomes
        if ended:
            children.remove(child)
            reason = child.end() or "the process ended"
            if child.left:
                yield _dead(child.left.popleft(), worlds, reason)
            if child.left:
                batches.appendleft(list(child.left))
    for child in children:
        if time.monotonic() - child.last > PATIENCE_S:
            os.kill(child.pid, signal.SIGKILL)


def _dead(number: int, worlds: dict[str, Files], reason: str) -> Outcome:
    """The outcome of a case that killed its process."""
    case = make_case(number, worlds)
    return {
        "number": number,
        "kind": case.kind,
        "verb": case.verb,
        "code": "killed",
        "cpu": MOST_S if "more than" in reason else 0.0,
        "words": case.words,
        "findings": [[f"killed: {reason}", ""]],
    }


def _serve(
    numbers: Sequence[int], worlds: dict[str, Files], root: Path, pipe: int, black_box: int
) -> None:
    """Run the cases of a batch in a folder, and write the outcome of each as a line."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_ADDRESSES, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (MOST_ON_DISK, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    faulthandler.enable(black_box)
    faulthandler.register(signal.SIGXCPU, black_box, chain=True)
    sandboxes: dict[str, Sandbox] = {}
    root.mkdir()
    for number in numbers:
        outcome = run_number(number, worlds, sandboxes, root)
        os.write(pipe, json.dumps(outcome).encode() + b"\n")


def run_number(
    number: int, worlds: dict[str, Files], sandboxes: dict[str, Sandbox], root: Path
) -> Outcome:
    """Run one case in the sandbox of its world, which is built if need be."""
    case = make_case(number, worlds)
    if case.world not in sandboxes:
        sandboxes[case.world] = Sandbox(root / case.world, worlds[case.world])
        sandboxes[case.world].build()
    sandbox = sandboxes[case.world]
    sandbox.change(case.changed)
    before = sandbox.snapshot()
    _allow(MOST_S)
    answer = run_case(case.words, sandbox.folder)
    after = sandbox.snapshot()
    findings = judge(case, answer, sandbox, before, after)
    findings += same_again(case, answer, sandbox, before, after)
    os.chdir(root)
    if before == sandbox.snapshot():
        sandbox.restore(case.changed)
    else:
        sandbox.build()
    return {
        "number": number,
        "kind": case.kind,
        "verb": case.verb,
        "code": answer.code,
        "cpu": round(answer.cpu, 4),
        "words": case.words,
        "findings": [[finding.signature, finding.detail] for finding in findings],
    }


def _allow(seconds: float) -> None:
    """Let this process use some more time of the processor, and no more."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime + seconds) + 1
    with contextlib.suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))


def _deepest(trace: str) -> str:
    """The deepest place of edtk in what faulthandler wrote."""
    for line in trace.splitlines():
        for room in ("/edtk/", "/criteria/"):
            if room in line and '", line ' in line:
                file = line.split(room, 1)[1].split('"')[0]
                return f"{room[1:]}{file}:{line.rpartition(' in ')[2]}"
    return "an unknown place"
