"""How long do exact plans of 40 poses among 100,000 take, and how near to their bound do they come?

    python studies/benchmarks/exact_poses.py

writes exact_poses.md beside this file. Each plan is made in a process of its own on one thread;
candidates are drawn before the clock starts, and a call is a first one, with all that it loads and
with the relaxation that proves the bound.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads, here and in the processes

import sys
from pathlib import Path
from time import perf_counter, process_time

import click
from general import geometry_problem
from measure import Measured, machine, measure
from tqdm import tqdm

import edtk
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
CRITERIA = ("D", "A", "rho0")
SEEDS = (0,)
POSES = 100_000
SIZE = 40
ASKED_S = 60.0  # of one core that does nothing else
LIMIT_S = 3000.0


def plan(name: str, seed: int) -> tuple[int, float, float, float, int]:
    """Parameters, seconds by the clock and of the processor, share above the bound, and starts."""
    problem, rho0 = geometry_problem(POSES)
    criterion = rho0 if name == "rho0" else name
    start = perf_counter()
    busy = process_time()
    found = edtk.plan(problem, SIZE, criterion, seed)
    seconds = perf_counter() - start
    above = found.cost / found.lower_bound.cost - 1.0
    return problem.p, seconds, process_time() - busy, above, found.starts


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=HERE,
    help="Folder for the results.",
)
def main(out: Path) -> None:
    """Measure, and write exact_poses.md; ends with code 1 if a plan takes too long."""
    cases = [(name, seed) for name in CRITERIA for seed in SEEDS]
    found = [measure(plan, *case, limit=LIMIT_S) for case in tqdm(cases, unit="plan")]
    write_text(out / "exact_poses.md", _report(cases, found))
    late = any(m.answer is None or m.answer[2] > ASKED_S for m in found)
    sys.exit(1 if late else 0)


def _report(cases: list[tuple[str, int]], found: list[Measured]) -> str:
    """The table as Markdown."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    rows = []
    for (name, seed), m in zip(cases, found, strict=True):
        cells = [m.failure] * 5
        if m.answer is not None:
            p, seconds, busy, above, starts = m.answer
            times = [f"{seconds:.0f} s", f"{busy:.0f} s"]
            cells = [str(p), *times, f"{100 * above:.2f} %", str(starts)]
        rows.append([name, str(seed), *cells, f"{m.peak_mb:.0f} MB"])
    header = [
        "criterion",
        "seed",
        "parameters",
        "clock",
        "processor",
        "above the bound",
        "starts",
        "peak memory",
    ]
    return f"""# Exact plans of {SIZE} poses among {POSES:,}

{machine()}, one thread, load average {load:.1f} while it ran, which stretches the time by the
clock. Written by `exact_poses.py` beside this file; it ends with code 1 if a plan takes more than
{ASKED_S:.0f} s of the processor, which were asked.

KUKA KR 270 with geometry and springs, three markers, half of the poses loaded, blocks of 9 rows.
No plan of this size can be below the bound, which weights that are no whole numbers nearly reach.

{markdown_table(header, rows)}"""


if __name__ == "__main__":
    main()
