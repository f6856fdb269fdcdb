"""Outcomes of a campaign in tables."""

import datetime
from collections import Counter, defaultdict
from collections.abc import Iterable

from edtk.version import __version__

CODES = (0, 1, 2, 130)


class Tally:
    """Outcomes so far.

    Attributes:
        cells: Numbers of cases by kind of input, command and exit code.
        groups: Findings by signature: the number of each case, and what was seen.
        cpu: Processor time [s].
        times: Processor time by kind of input and command [s].
        slowest: Time and number of the slowest case.
    """

    def __init__(self) -> None:
        self.cells: Counter[tuple[str, str, object]] = Counter()
        self.groups: dict[str, list[tuple[int, str]]] = defaultdict(list)
        self.cpu = 0.0
        self.times: Counter[tuple[str, str]] = Counter()
        self.slowest = (0.0, -1)

    def add(self, outcome: dict) -> list[str]:
        """Count one outcome; the signatures that it is the first to have."""
        new = [signature for signature, _ in outcome["findings"] if signature not in self.groups]
        self.cells[outcome["kind"], outcome["verb"], outcome["code"]] += 1
        self.cpu += outcome["cpu"]
        self.times[outcome["kind"], outcome["verb"]] += outcome["cpu"]
        self.slowest = max(self.slowest, (outcome["cpu"], outcome["number"]))
        for signature, detail in outcome["findings"]:
            self.groups[signature].append((outcome["number"], detail))
        return new

    @property
    def cases(self) -> int:
        """Number of cases."""
        return self.cells.total()

    @property
    def findings(self) -> int:
        """Number of findings."""
        return sum(map(len, self.groups.values()))


def findings_table(tally: Tally) -> str:
    """Groups of findings, the largest first: how many, which cases, and one of the messages."""
    lines = []
    for signature, found in sorted(tally.groups.items(), key=lambda item: -len(item[1])):
        numbers = ", ".join(str(number) for number, _ in sorted(found)[:4])
        lines.append(f"{len(found):6d}  {signature}\n        cases {numbers}")
        lines += [f"        | {line[:220]}" for line in found[0][1].splitlines()[-3:]]
    return "\n".join(lines)


def record(tally: Tally, first: int) -> str:
    """What was run, as Markdown: kinds of input, commands, and how they ended."""
    today = datetime.date.today().isoformat()
    head = [
        "# What was run",
        "",
        "Written by `python -m tests.fuzz --record`; each number is one of cases.",
        "",
        f"edtk {__version__}, {today}: {tally.cases} cases from number {first} on, "
        f"{tally.findings} findings, {tally.cpu:.0f} s of processor time, "
        f"the slowest case {tally.slowest[0]:.1f} s.",
        "",
        "Exit 0: answered. 1: a certificate that was read and does not hold. 2: refused in one "
        "line. 130: interrupted.",
        "",
    ]
    by_kind = _table("kind of input", tally, lambda key: key[0])
    by_verb = _table("command", tally, lambda key: key[1])
    both = _table("kind of input and command", tally, lambda key: f"{key[0]}: {key[1]}")
    return "\n".join([*head, *by_kind, "", *by_verb, "", *both, ""])


def _table(title: str, tally: Tally, name) -> Iterable[str]:
    """Numbers of cases and of exit codes, by some name."""
    counts: dict[str, Counter[object]] = defaultdict(Counter)
    for key, count in tally.cells.items():
        counts[name(key)][key[2]] += count
    codes = [code for code in (*CODES, "killed") if any(row[code] for row in counts.values())]
    rows = [f"| {title} | cases | {' | '.join(f'exit {code}' for code in codes)} |"]
    rows.append(f"|---|{'---:|' * (1 + len(codes))}")
    for label, row in sorted(counts.items()):
        numbers = " | ".join(str(row[code]) for code in codes)
        rows.append(f"| {label} | {row.total()} | {numbers} |")
    return rows
