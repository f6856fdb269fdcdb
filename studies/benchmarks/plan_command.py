"""What a user waits for: the whole command `edtk plan`, and its stages.

`python studies/benchmarks/plan_command.py` writes plan_command.md beside this file, in some
minutes. `--before DIR` names a checkout of another commit, whose command then runs in turn with
this one's. The studies are those of three robots; their files are written into a folder of their
own, so that both commits read the same.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from measure import machine
from tqdm import tqdm

from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SIZES = (3, 5, 12)
REPEATS = 2
# Progress tells when the search over all poses begins and ends, and when plans are searched for.
STAGES = """
import json, sys
from time import perf_counter
began = perf_counter()
from edtk.verbs.plan import plan
from edtk.verbs.load_study import load_study
loaded = perf_counter()
study = load_study(sys.argv[1])
read = perf_counter()
marks = {}
def progress(label, number):
    marks["bound" if label.startswith("bound") else "plan"] = perf_counter()
found = plan(study, int(sys.argv[2]), progress=progress)
ended = perf_counter()
print(json.dumps([loaded - began, read - loaded, marks["bound"] - read,
                  marks["plan"] - marks["bound"], ended - marks["plan"]]))
"""


def studies(folder: Path) -> dict[str, Path]:
    """Files of the studies, by the names of their robots."""
    sys.path.insert(0, str(HERE.parent))
    from fault_robots import robots

    paths = {}
    for name, study in robots().items():
        paths[name.split(",")[0]] = path = folder / f"{len(paths)}.toml"
        path.write_text(study.to_toml(path), encoding="utf-8")
    return paths


def run(root: Path, arguments: list[str]) -> tuple[float, float, str]:
    """Seconds, seconds of processors, and output of Python with the package of a checkout."""
    since = perf_counter()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *arguments],
        # Python looks for modules in the folder where it begins first.
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    work = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return perf_counter() - since, work, done.stdout


def command(root: Path, study: Path, size: int) -> tuple[float, float, dict[str, Any]]:
    """Seconds of the command, seconds of processors, and its answer."""
    words = ["-m", "edtk", "plan", str(study), "--size", str(size), "--json"]
    seconds, work, text = run(root, words)
    return seconds, work, json.loads(text)


def row(name: str, study: Path, size: int, before: Path | None) -> list[object]:
    """Least seconds, and values, of one question; with the stages of one more run."""
    roots = [ROOT] if before is None else [before, ROOT]
    runs: dict[Path, list[tuple[float, float]]] = {root: [] for root in roots}
    values = {}
    for _ in range(REPEATS):
        # In turn, so that a machine that gets slower slows both down alike.
        for root in roots:
            seconds, work, answer = command(root, study, size)
            runs[root].append((seconds, work))
            values[root] = answer["value"]
    stages = json.loads(run(ROOT, ["-c", STAGES, str(study), str(size)])[2])
    own = np.min(runs[ROOT], axis=0)
    cells = [name, size, f"{1e3 * values[ROOT]:.6g}", *(f"{number:.2f}" for number in own)]
    cells += [f"{stage:.2f}" for stage in stages]
    if before is not None:
        earlier = np.min(runs[before], axis=0)
        cells += [f"{1e3 * values[before]:.6g}", *(f"{number:.2f}" for number in earlier)]
        cells += [f"{ratio:.2f}" for ratio in own / earlier]
    return cells


HEADER = ("robot", "m", "rho0 [mm]", "command", "work")
HEADER += ("imports", "study", "bound", "plan", "rest")
BEFORE = ("rho0 before [mm]", "command before", "work before", "ratio", "ratio of work")


def page(rows: list[list[object]], commit: str, load: float) -> str:
    """The report, as Markdown; the load is the mean number of programs that waited or ran."""
    header = HEADER + BEFORE if commit else HEADER
    compared = (
        f" Before is commit {commit}, run in turn with this one on the same files."
        if commit
        else ""
    )
    return (
        "# What a user waits for\n\n"
        "`python studies/benchmarks/plan_command.py` wrote this file.\n\n"
        "Seconds of the whole command `edtk plan STUDY --size m` on all cores, and the work of all "
        "its processes [s of a processor], which other programs on the machine disturb less: the "
        f"least of {REPEATS}; {machine()}, with a load of {load:.0f}. "
        "The stages are seconds of one more run: imports, reading the study, the bound over all "
        "poses, the search for the plan, "
        f"and the rest: rounding, errors to expect, the budget.{compared}\n\n"
        f"{markdown_table(header, rows)}"
    )


def main() -> None:
    """Measure, and write plan_command.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, help="a checkout of another commit")
    before = parser.parse_args().before
    commit = ""
    if before is not None:
        asked = ["git", "-C", str(before), "rev-parse", "--short", "HEAD"]
        commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    with tempfile.TemporaryDirectory() as folder:
        cases = [(*item, m) for item in studies(Path(folder)).items() for m in SIZES]
        rows = [row(*case, before) for case in tqdm(cases, file=sys.stderr)]
    write_text(HERE / "plan_command.md", page(rows, commit, os.getloadavg()[2]))


if __name__ == "__main__":
    main()
