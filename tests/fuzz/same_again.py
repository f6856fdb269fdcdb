"""The same input has the same answer, to the last byte."""

import re

from tests.fuzz.case import Case
from tests.fuzz.judge import Finding, messages
from tests.fuzz.run_case import Answer, run_case
from tests.fuzz.sandbox import Sandbox, Snapshot

EVERY = 20  # cases of which one is run again
# Times, which differ, and options that let them decide or write them to a file.
TIME = re.compile(
    rb'"seconds": ([-+.e\d]+|\{[^}]*\})|\b\d+(\.\d+)? s\b|\d{4}-\d\d-\d\d \d\d:\d\d(:\d\d)?'
)
BY_TIME = ("--budget", "--export")

Outputs = dict[str, bytes]


def same_again(
    case: Case, first: Answer, sandbox: Sandbox, before: Snapshot, after: Snapshot
) -> list[Finding]:
    """Run a case again, on files that are as before, and compare everything that came out.

    Args:
        case: The case, which has just been run.
        first: Its answer.
        sandbox: The folder, as the case left it.
        before: The folder before the case.
        after: The folder after it.
    """
    if case.number % EVERY or any(word.startswith(BY_TIME) for word in case.words):
        return []
    files = _outputs(sandbox, before, after)
    sandbox.build()
    sandbox.change(case.changed)
    before = sandbox.snapshot()
    second = run_case(case.words, sandbox.folder)
    others = _outputs(sandbox, before, sandbox.snapshot())
    pairs = {
        "exit code": (str(first.code).encode(), str(second.code).encode()),
        "standard output": (first.stdout, second.stdout),
        "standard error": tuple(_said(answer) for answer in (first, second)),
        **{name: (files.get(name, b""), others.get(name, b"")) for name in files | others},
    }
    for name, (one, other) in pairs.items():
        if TIME.sub(b"", one) != TIME.sub(b"", other):
            return [Finding(f"another answer to the same: {case.verb}", name)]
    return []


def _said(answer: Answer) -> bytes:
    """Standard error without progress, which depends on the clock."""
    return "\n".join(messages(answer.stderr)).encode()


def _outputs(sandbox: Sandbox, before: Snapshot, after: Snapshot) -> Outputs:
    """Contents of the files that are new or other than before, by name."""
    return {
        sandbox.relative(path): sandbox.read(path)
        for path, state in after.items()
        if state[0] == "file" and before.get(path) != state
    }
