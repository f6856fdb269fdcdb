"""What every command has to keep to, whatever it is given."""

import json
import os
import re
from dataclasses import dataclass
from typing import Any

import click

from edtk.cli import main
from edtk.system.errors import shortened
from tests.fuzz.case import Case
from tests.fuzz.command_lines import VERBS
from tests.fuzz.run_case import Answer
from tests.fuzz.sandbox import Sandbox, Snapshot

LONGEST = 300  # characters of a message
MOST_S = 8.0  # processor time of a case
MOST_MB = 1500.0  # growth of memory in a case
# Exit code of `edtk verify` for a certificate that was read and does not hold, and of commands that
# answered a part.
IN_PART = 1
ANSWER_IN_PART = ("verify", "compensate")
# What `edtk compensate` says of rows of a task, and of lines of a program, that have no answer.
LEFT_OUT = re.compile(r"\d+ rows? left out|line \d+: ")
# Lines that a progress bar writes, and overwrites.
PROGRESS = re.compile(r"\[\d\d:\d\d[],<]|step/s|\d+step ")
# Options and arguments in messages.
PLACE = re.compile(r"--?[a-z]|option|argument|command|STUDY|PLAN|MEASUREMENTS|TASK|K\.json|FILE")
# A file that a mutated one names, by an ending or by what the system says of it.
FILE = re.compile(r"edtk: (\S+\.\w+: |.+: (no such file|is a folder|File name too long))")
OUTPUTS = (
    "--out",
    "--certificate",
    "--chain",
    "--export",
    "--figures",
    "--rest",
    "--table",
    "--timetable",
)
# What a run that failed may leave, because the next one goes on from it.
LINKED = ("nowhere/", "folder/")  # folders to which links of the sandbox lead
KEPT = {"run": ("cases", "certificates"), "bayes": ("h5",), "identify": ("h5",)}


@dataclass(frozen=True)
class Finding:
    """A promise that was not kept.

    Attributes:
        signature: The same for findings that have the same cause, most likely.
        detail: What was seen.
    """

    signature: str
    detail: str


def judge(
    case: Case, answer: Answer, sandbox: Sandbox, before: Snapshot, after: Snapshot
) -> list[Finding]:
    """The promises that a command did not keep in a case."""
    if answer.error:
        return [Finding(f"traceback: {answer.error}", _tail(answer.stderr))]
    found = [*_limits(case, answer)]
    in_part = answer.code == IN_PART and case.verb in ANSWER_IN_PART
    failed = answer.code != 0 and not in_part
    if answer.code not in (0, 2, 130) and not in_part:
        return [*found, Finding(f"exit code {answer.code} of {case.verb}", _tail(answer.stderr))]
    changed = _changed(case, sandbox, before, after)
    lines = messages(answer.stderr)
    # Where a file goes to standard output, the result goes to standard error.
    found += [] if case.prints_a_file else _streams(case, lines)
    if failed:
        found += _failure(case, answer, lines)
        left = [path for path in changed if not _may_stay(case, path)]
    else:
        found += _success(case, answer)
        found += _in_part(case, answer, lines, changed) if in_part else []
        left = [path for path in changed if _is_foreign(case, path)]
    if left:
        what = "changed or left on failure" if failed else "changed although it is no output"
        found.append(Finding(f"file {what}: {case.verb}", ", ".join(map(repr, left[:5]))))
    return found


def _limits(case: Case, answer: Answer) -> list[Finding]:
    """Time and memory."""
    found = []
    if answer.cpu > MOST_S:
        found.append(Finding(f"more than {MOST_S:g} s: {case.verb}", f"{answer.cpu:.1f} s"))
    if answer.growth > MOST_MB:
        found.append(Finding(f"more than {MOST_MB:g} MB: {case.verb}", f"{answer.growth:.0f} MB"))
    return found


def messages(stderr: bytes) -> list[str]:
    """Lines on standard error other than those of a progress bar."""
    lines = stderr.decode("utf-8", "replace").replace("\r", "\n").split("\n")
    return [line for line in lines if line.strip() and not PROGRESS.search(line)]


# What a run says of its largest plan, and where it wrote.
OF_RUN = (
    "wrote ",
    "error by the noise alone: ",
    "error by noise and model ",
    "total expected error ",
    "  ",
)


def _streams(case: Case, lines: list[str]) -> list[Finding]:
    """Every line on standard error is ours, short and printable."""
    found = []
    for line in lines:
        if case.verb == "run" and line.startswith(OF_RUN):
            continue
        if not line.startswith("edtk: "):
            found.append(Finding(f"a line that is not ours: {_pattern(line)}", line[:300]))
        elif len(line) > LONGEST + len("edtk: "):
            found.append(Finding(f"message too long: {_pattern(line)}", line[:400]))
        elif not line.isprintable():
            found.append(Finding(f"message not printable: {_pattern(line)}", repr(line)))
    return found[:1]


def _failure(case: Case, answer: Answer, lines: list[str]) -> list[Finding]:
    """One line that names a place, and nothing on standard output."""
    found = []
    if answer.stdout:
        found.append(Finding(f"standard output on failure: {case.verb}", _tail(answer.stdout)))
    if not lines:
        return [*found, Finding(f"no message: {case.verb}", _tail(answer.stderr))]
    if not _names_a_place(case, lines[-1]):
        found.append(Finding(f"message names no place: {_pattern(lines[-1])}", lines[-1]))
    errors = [line for line in lines if "warning" not in line]
    if len(errors) > 1 and all(line.startswith("edtk: ") for line in errors):
        found.append(Finding(f"more than one line: {_pattern(errors[-1])}", "\n".join(errors[-3:])))
    return found


def _success(case: Case, answer: Answer) -> list[Finding]:
    """Strict JSON where JSON is asked for."""
    if not _asks_for_json(case) or case.prints_a_file:
        return []
    try:
        json.loads(answer.stdout, parse_constant=_reject)
    except ValueError as error:
        return [Finding(f"not strict JSON: {case.verb}", f"{error}: {_tail(answer.stdout)}")]
    return []


def _in_part(case: Case, answer: Answer, lines: list[str], changed: list[str]) -> list[Finding]:
    """Something of an answer in part, and a line that says what is not in it."""
    found = []
    if not answer.stdout.strip() and not changed:
        found.append(Finding(f"nothing of an answer in part: {case.verb}", _tail(answer.stderr)))
    if case.verb == "compensate" and not any(LEFT_OUT.search(line) for line in lines):
        found.append(Finding("nothing says what is left out: compensate", _tail(answer.stderr)))
    return found


def _asks_for_json(case: Case) -> bool:
    """Whether the option --json is given, and not as the value of another one."""
    if case.verb not in VERBS or {"-h", "--help", "--version"} & set(case.words):
        return False
    command = main.commands[case.verb]
    with click.Context(command) as context:
        options, _, _ = command.make_parser(context).parse_args(list(case.words[1:]))
    return bool(options.get("as_json"))


def _reject(constant: str) -> Any:
    """Reject NaN and Infinity.

    Raises:
        ValueError: Always.
    """
    raise ValueError(f"{constant} in JSON")


def _names_a_place(case: Case, line: str) -> bool:
    """Whether a message names a file, an option, or an argument."""
    if PLACE.search(line) or FILE.match(line):
        return True
    names = [word.rpartition("=")[2] for word in case.words[1:]]
    names += [*case.changed, "robot.toml", "robot.urdf", "pub.csv", "exclude.csv", "earlier.json"]
    # A long name is shown by its end, or without its middle.
    shown = [shortened(os.path.normpath(name), 200) for name in names]  # "" is "."
    return any(name[:20] in line or name[-20:] in line for name in shown)


def _changed(case: Case, sandbox: Sandbox, before: Snapshot, after: Snapshot) -> list[str]:
    """Paths that came, went, or have other contents, as the command sees them."""
    differ = [path for path in {**before, **after} if before.get(path) != after.get(path)]
    found = []
    for path in sorted(differ):
        name = sandbox.relative(path)
        old = case.changed.get(name, sandbox.files.get(name))
        is_file = before.get(path, ("",))[0] == after.get(path, ("",))[0] == "file"
        if is_file and old == (sandbox.folder / name).read_bytes():
            continue  # written anew, and the same
        found.append(name)
    return found


def _may_stay(case: Case, path: str) -> bool:
    """Whether a command that fails may leave a file, because another one goes on from it."""
    folders = path.split("/")
    kept = KEPT.get(case.verb, ())
    if case.verb == "run":
        return any(name in folders for name in kept) or path in ("out", "results")
    return path.endswith(kept) if kept else False


def _is_foreign(case: Case, path: str) -> bool:
    """Whether a path belongs to none of the outputs that a command was asked for."""
    if path.rpartition("/")[2].startswith("."):
        return True  # a temporary
    if case.verb == "run":
        return path.startswith("study.toml")
    values = [part for word in case.words for part in (word.partition("=")[2], word)]
    given = [*values, *(word.rpartition("=")[2] for word in case.words)]
    asked = any(word.startswith(OUTPUTS) for word in case.words)
    inside = any(path == _plain(word) or path.startswith(f"{_plain(word)}/") for word in given)
    above = any(_plain(word).startswith(f"{path}/") for word in given)
    inside = inside or "." in map(_plain, given)
    through_link = path in ("plan.csv", "study.toml", "nowhere") or path.startswith(LINKED)
    return not (asked and (inside or above or through_link))


def _plain(path: str) -> str:
    """A path without what does not matter in it."""
    return os.path.normpath(path) if path else path


def _pattern(line: str) -> str:
    """A message without what depends on the case: numbers, names and quoted words."""
    short = re.sub(r"'[^']*'|\"[^\"]*\"|\([^)]*\)", "X", line.removeprefix("edtk: "))
    short = re.sub(r"\S*[./]\S*|[-+]?\d+\S*|[^\x20-\x7e]+", "N", short)
    return " ".join(short.split())[:70]


def _tail(output: bytes) -> str:
    return output[-600:].decode("utf-8", "replace")
