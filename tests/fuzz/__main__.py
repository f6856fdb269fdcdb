"""`python -m tests.fuzz`: run cases, and say which promises were not kept."""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from threadpoolctl import threadpool_limits

from tests.fuzz.campaign import run_cases, run_number
from tests.fuzz.case import kind_of, make_case
from tests.fuzz.findings import Tally, findings_table, record
from tests.fuzz.run_case import run_case
from tests.fuzz.sandbox import Sandbox
from tests.fuzz.worlds import WORLDS, Files, world


def main() -> int:
    """Run one case, or many; exit code 1 if there are findings."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--case", type=int, help="run this one alone, and show everything")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--cases", type=int, default=2000, help="number of cases")
    parser.add_argument("--kind", default="", help="only kinds of input that have this in them")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="end after them")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--record", type=Path, help="write the table of what was run (Markdown)")
    parser.add_argument("--times", type=int, default=0, help="show so many of the slowest kinds")
    given = parser.parse_args()
    worlds = {name: world(name) for name in WORLDS}
    if given.case is not None:
        return _show(given.case, worlds)
    tally = Tally()
    end = time.monotonic() + given.seconds
    every = range(given.first, given.first + given.cases)
    numbers = [number for number in every if given.kind in kind_of(number)]
    try:
        for outcome in run_cases(numbers, worlds, given.workers):
            for signature in tally.add(outcome):
                print(f"\rcase {outcome['number']}: {signature}", file=sys.stderr)
            if sys.stderr.isatty() or tally.cases % 1000 == 0:
                progress = f"{tally.cases} of {len(numbers)} cases, {tally.findings} findings"
                print(f"\r{progress}", end="", file=sys.stderr, flush=True)
            if time.monotonic() > end:
                break
    except KeyboardInterrupt:
        print("\rinterrupted; this is what was run", file=sys.stderr)
    print(file=sys.stderr)
    print(findings_table(tally) if tally.groups else "no findings")
    print(f"{tally.cases} cases, {tally.cpu:.0f} s, slowest {tally.slowest}")
    for (kind, verb), seconds in tally.times.most_common(given.times):
        print(f"{seconds:8.2f} s  {kind}: {verb}")
    if given.record is not None:
        given.record.write_text(record(tally, given.first), encoding="utf-8")
    return int(bool(tally.groups))


def _show(number: int, worlds: dict[str, Files]) -> int:
    """Run one case in a folder that stays, and print all about it."""
    case = make_case(number, worlds)
    kept = Sandbox(Path(tempfile.mkdtemp(prefix="edtk-fuzz-case-")), worlds[case.world])
    kept.build()
    kept.change(case.changed)
    print(f"cd {str(kept.folder)!r}\nedtk {' '.join(map(repr, case.words))}")
    for name, content in case.changed.items():
        print(f"--- {name}\n{content[:3000] if content is not None else 'missing'!r}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        sandbox = Sandbox(Path(folder), worlds[case.world])
        sandbox.build()
        sandbox.change(case.changed)
        answer = run_case(case.words, sandbox.folder)
        os.chdir("/")
        outcome = run_number(number, worlds, {}, Path(folder))
    print(f"--- stdout\n{answer.stdout[-2000:].decode('utf-8', 'replace')}")
    print(f"--- stderr\n{answer.stderr[-3000:].decode('utf-8', 'replace')!r}")
    print(f"--- exit {answer.code}, {answer.cpu:.3f} s, {answer.growth:.0f} MB, {answer.error}")
    for signature, detail in outcome["findings"]:
        print(f"finding: {signature}: {detail[:300]!r}")
    return int(bool(outcome["findings"]))


if __name__ == "__main__":
    # The cases are small, and the processes are many.
    with threadpool_limits(1):
        code = main()
    sys.exit(code)
