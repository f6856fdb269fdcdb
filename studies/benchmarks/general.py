"""How large may a linear model be? Gaussian rows, geometry of a robot, and a million pose blocks.

    python studies/benchmarks/general.py

writes general.md beside this file. Each case runs in a process of its own on one thread; candidates
are drawn before the clock starts, and a call is a first one, with all that it has to load. A direct
model is one cvxpy program with a variable for every candidate, in whitened parameters.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads, here and in the processes

from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import click
import cvxpy as cp
import numpy as np
from measure import Measured, machine, measure
from tqdm import tqdm

import edtk
from criteria.linalg.inverse import whitener
from edtk import Problem, Study, criteria, load_study, relax
from edtk.design.candidate_source import CandidateSource
from edtk.report.tables import markdown_table
from edtk.robots.robot_file import robot_to_dict
from edtk.system.files import write_files

HERE = Path(__file__).parent
STUDY = HERE.parent / "kr270_milling.toml"
TEN = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0")
POSES = 1_000_000
PASSES = 5  # beside each criterion; the fastest of all counts
ASKED = 150  # passes for all ten
LIMIT_S = 100.0


@dataclass(frozen=True)
class Case:
    """Gaussian candidates: parameters, candidates, rows of each, a criterion, and what was asked.

    Attributes:
        p: Number of parameters.
        n: Number of candidates.
        rows: Rows of a candidate.
        name: Criterion.
        asked: Seconds and gap that the toolkit was asked for; "" for none.
    """

    p: int
    n: int
    rows: int
    name: str
    asked: str = ""


CASES = (
    Case(10, 100_000, 1, "D"),
    Case(10, 100_000, 1, "A"),
    Case(20, 10_000, 1, "D"),
    Case(20, 10_000, 1, "E"),
    Case(30, 10_000, 1, "E", "30 s, 1e-4"),
    Case(30, 10_000, 1, "G", "30 s, 1e-4"),
    Case(30, 100_000, 1, "D", "5 s, 1e-6"),
    Case(30, 100_000, 1, "A", "5 s, 1e-6"),
    Case(30, 100_000, 1, "O5", "5 s, 1e-6"),
    Case(60, 10_000, 1, "D"),
    Case(100, 10_000, 10, "D", "60 s, 1e-6"),
    Case(100, 10_000, 10, "A", "60 s, 1e-6"),
)
DIRECT = (
    *(Case(p, 5_000, 1, name) for p in (5, 10) for name in "DAE"),
    *(Case(20, 2_000, 1, name) for name in "DE"),
)
LATER = 7  # calls after the first one, each of a new problem
GEOMETRY = ("D", "A", "rho0", "E")


def gaussian(case: Case) -> Problem:
    """Candidates of independent normal rows."""
    rows = np.random.default_rng(0).normal(size=(case.n, case.rows, case.p))
    return Problem(rows)


def ours(case: Case) -> tuple[float, float, float, int, float]:
    """Seconds of the first call, seconds of the processor, gap, support points, and cost."""
    problem = gaussian(case)
    criterion = criteria.create(case.name)
    start = perf_counter()
    busy = process_time()
    answer = relax(problem, criterion)
    seconds = perf_counter() - start
    return seconds, process_time() - busy, answer.gap, len(answer.support), answer.cost


def later(case: Case) -> tuple[float, float, float]:
    """Seconds of the processor of a call after others, the median; its gap and cost."""
    criterion = criteria.create(case.name)
    relax(gaussian(case), criterion)
    times = []
    for _ in range(LATER):
        problem = gaussian(case)
        busy = process_time()
        answer = relax(problem, criterion)
        times.append(process_time() - busy)
    return median(times), answer.gap, answer.cost


def direct(case: Case) -> tuple[float, float]:
    """Seconds of the processor and cost of one large cvxpy model, by Clarabel."""
    _direct(replace(case, n=50))  # cvxpy loads its solvers at the first call
    busy = process_time()
    cost = _direct(case)
    return process_time() - busy, cost


def _direct(case: Case) -> float:
    """Solve the large model; its cost."""
    problem = gaussian(case)
    criterion = criteria.create(case.name)
    T = whitener(problem.mean)
    w = cp.Variable(problem.n, nonneg=True)
    rows = (T.T @ problem.blocks() @ T).reshape(problem.n, -1)
    M = cp.reshape(rows.T @ w, T.shape, order="C")
    M = 0.5 * (M + M.T)
    size = float(criterion.cost(problem.mean))
    objective, constraints = criterion.formulation(M, cp.sum(w), T, size)
    cp.Problem(cp.Minimize(objective), constraints).solve(solver="CLARABEL")
    weights = np.maximum(w.value, 0.0)
    return float(criterion.cost(problem.information(weights / weights.sum())))


def geometry_problem(n: int) -> tuple[Problem, criteria.Criterion]:
    """Geometry and springs of the KR 270 from so many poses, and rho0 of 20 of them."""
    robot = load_study(STUDY).robot
    markers = {"A": [90, 10, 50], "B": [-30, 70, 40], "C": [0, -60, 100]}
    study = Study(
        robot=robot_to_dict(robot),
        measurement={"sigma_mm": 0.05},
        parameters={"geometry": "all", "compliance": list(robot.joint_names[1:4])},
        load={"F_N": [0, 0, -2500]},
        marker=[{"name": name, "position_mm": place} for name, place in markers.items()],
    )
    rng = np.random.default_rng(0)
    lower, upper = np.clip(robot.limits, -np.pi, np.pi)
    q = rng.uniform(lower, upper, (n, robot.n))
    wrench = np.zeros((n, 6))
    wrench[::2, 2] = -2500.0
    found = edtk.geometry_problem(study, q, wrench)
    return found.problem, found.rho0(q[:20], wrench[0])


def geometry(name: str, n: int) -> tuple[int, float, float, int]:
    """Geometry and springs of the KR 270: parameters, seconds, gap and support points."""
    problem, rho0 = geometry_problem(n)
    criterion = rho0 if name == "rho0" else criteria.create(name)
    start = perf_counter()
    answer = relax(problem, criterion)
    return problem.p, perf_counter() - start, answer.gap, len(answer.support)


def passes(n: int) -> tuple[float, dict[str, tuple[float, float]]]:
    """Seconds of the processor of a pricing pass, and of each criterion with its gap."""
    study = load_study(STUDY)
    problem = CandidateSource(study.space, (study.specification.seed, 0)).take(n).problem
    P = np.ascontiguousarray(problem.packed)
    z = np.random.default_rng(0).normal(size=len(P))
    one = np.inf
    found = {}
    for name in TEN:
        one = min(one, *(_seconds(lambda: z @ P) for _ in range(PASSES)))
        criterion = study.criterion(name)
        relax(problem, criterion)
        times = []
        for _ in range(3):
            start = process_time()
            answer = relax(problem, criterion)
            times.append(process_time() - start)
        found[name] = (min(times), answer.gap)
    return one, found


def _seconds(call: object) -> float:
    """Seconds of the processor, which other programs disturb less than those of the clock."""
    start = process_time()
    call()
    return process_time() - start


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=HERE,
    help="Folder for the results.",
)
def main(out: Path) -> None:
    """Measure, and write general.md."""
    with tqdm(total=len(CASES) + 2 * len(DIRECT) + len(GEOMETRY) + 1, unit="case") as bar:

        def done(measured: Measured) -> Measured:
            bar.update()
            return measured

        large = [done(measure(ours, case, limit=LIMIT_S)) for case in CASES]
        mine = [done(measure(later, case, limit=LIMIT_S)) for case in DIRECT]
        others = [done(measure(direct, case, limit=LIMIT_S)) for case in DIRECT]
        robots = [done(measure(geometry, name, 10_000, limit=LIMIT_S)) for name in GEOMETRY]
        million = done(measure(passes, POSES, limit=LIMIT_S))
    write_files({out / "general.md": _report(large, mine, others, robots, million)})


def _report(
    large: list[Measured],
    mine: list[Measured],
    others: list[Measured],
    robots: list[Measured],
    million: Measured,
) -> str:
    """All tables as Markdown."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return "\n".join(
        [
            "# How large may a linear model be?\n",
            f"{machine()}, one thread, load average {load:.1f} while it ran. Written by "
            "`general.py` beside this file.\n",
            "## Gaussian rows\n",
            "Seconds of a first call by the clock and of the processor, with all that it loads. "
            "The bound is proved over all candidates; the support has those with weight. What was "
            "asked for, seconds and gap, stands last.\n",
            _large(large),
            "## Beside a direct cvxpy model\n",
            "The direct model is one program with a variable for every candidate, by Clarabel with "
            f"cvxpy's default settings; of edtk it is the median of {LATER} calls after a first "
            "one, each of a new problem. Seconds of the processor; solvers are loaded before.\n",
            _beside(mine, others),
            "## Geometry and springs of a robot\n",
            "KUKA KR 270, three markers, 10,000 candidate poses of which half are loaded, blocks "
            "of 9 rows.\n",
            _robots(robots),
            "## A million pose blocks\n",
            "KUKA KR 270, 5 parameters. Seconds of the processor, the least of three calls after a "
            "first one. A pass is the time of one product `z @ P`, which prices every pose once; "
            f"{ASKED} passes were asked for, for all ten criteria together.\n",
            _million(million),
        ]
    )


def _large(found: list[Measured]) -> str:
    rows = []
    for case, m in zip(CASES, found, strict=True):
        cells = [m.failure] * 4
        if m.answer is not None:
            seconds, busy, gap, support, _ = m.answer
            cells = [f"{seconds:.1f} s", f"{busy:.1f} s", f"{gap:.0e}", str(support)]
        size = [str(case.p), f"{case.n:,}", str(case.rows), case.name]
        rows.append([*size, *cells, f"{m.peak_mb:.0f} MB", case.asked])
    header = [
        "parameters",
        "candidates",
        "rows",
        "criterion",
        "clock",
        "processor",
        "proved gap",
        "support",
        "peak memory",
        "asked",
    ]
    return markdown_table(header, rows)


def _beside(mine: list[Measured], others: list[Measured]) -> str:
    rows = []
    for case, m, other in zip(DIRECT, mine, others, strict=True):
        seconds, gap, cost = m.answer
        cells = [other.failure, "-", "-"]
        if other.answer is not None:
            theirs, their_cost = other.answer
            cells = [f"{theirs:.2f} s", f"{their_cost / cost - 1:.0e}", f"{theirs / seconds:.0f}"]
        rows.append(
            [str(case.p), f"{case.n:,}", case.name, f"{seconds:.4f} s", f"{gap:.0e}", *cells]
        )
    header = [
        "parameters",
        "candidates",
        "criterion",
        "edtk",
        "proved gap",
        "direct model",
        "its cost above edtk's",
        "ratio",
    ]
    return markdown_table(header, rows)


def _robots(found: list[Measured]) -> str:
    rows = []
    for name, m in zip(GEOMETRY, found, strict=True):
        cells = [m.failure] * 4
        if m.answer is not None:
            p, seconds, gap, support = m.answer
            cells = [str(p), f"{seconds:.1f} s", f"{gap:.0e}", str(support)]
        rows.append([name, *cells])
    return markdown_table(["criterion", "parameters", "clock", "proved gap", "support"], rows)


def _million(m: Measured) -> str:
    if m.answer is None:
        return m.failure + "\n"
    one, found = m.answer
    rows = [
        [name, f"{seconds:.3f} s", f"{seconds / one:.0f}", f"{gap:.0e}"]
        for name, (seconds, gap) in found.items()
    ]
    total = sum(seconds for seconds, _ in found.values())
    rows.append(["all ten", f"{total:.2f} s", f"{total / one:.0f}", ""])
    rows.append(["one pass", f"{one:.4f} s", "1", ""])
    return markdown_table(["criterion", "processor", "passes", "proved gap"], rows)


if __name__ == "__main__":
    main()
