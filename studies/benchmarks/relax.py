"""How fast is the relaxation? Direct cvxpy models and edtk side by side, in one run.

    python studies/benchmarks/relax.py

writes relax.md and relax.png beside this file, for the KUKA KR 270. Candidates are drawn before the
clock starts, and every number is a median. A direct model has one variable for every candidate, in
whitened parameters, and cvxpy's default settings; of its solvers the fastest that comes within 1e-3
of the proved optimum counts. edtk closes a proved gap of 1e-6.
"""

from collections.abc import Iterable
from pathlib import Path
from statistics import median
from time import perf_counter

import click
import cvxpy as cp
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from measure import Measured, machine, measure
from tqdm import tqdm

from criteria.linalg.inverse import whitener
from edtk import Problem, Study, load_study, relax
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.report.figures import png
from edtk.report.tables import markdown_table
from edtk.system.files import write_files

HERE = Path(__file__).parent
STUDY = HERE.parent / "kr270_milling.toml"
COMPARED = ("A", "D", "E", "rho0")
TEN = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0")
DIRECT_SIZES = (1_000, 5_000, 20_000)
SIZES = (100_000, 1_000_000)
STREAMED = 10_000_000
REPEATS = 5
SOLVERS = ("CLARABEL", "SCS")
ACCURATE = 1e-3  # relative to the proved optimum
LIMIT_S = 180.0  # for a direct model
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def direct(name: str, n: int, solver: str) -> tuple[float, float]:
    """Seconds and cost of one large cvxpy model."""
    study = load_study(STUDY)
    problem = _problem(study, n)
    criterion = study.criterion(name)
    T = whitener(problem.mean)
    start = perf_counter()
    w = cp.Variable(n, nonneg=True)
    rows = (T.T @ problem.blocks() @ T).reshape(n, -1)
    M = cp.reshape(rows.T @ w, T.shape, order="C")
    M = 0.5 * (M + M.T)
    size = float(criterion.cost(problem.mean))
    objective, constraints = criterion.formulation(M, cp.sum(w), T, size)
    cp.Problem(cp.Minimize(objective), constraints).solve(solver=solver)
    seconds = perf_counter() - start
    weights = np.maximum(w.value, 0.0)
    return seconds, float(criterion.cost(problem.information(weights / weights.sum())))


def ours(
    names: tuple[str, ...], n: int, repeats: int
) -> dict[str, tuple[float, float, float, float, float]]:
    """By criterion: median seconds, cost, gap, seconds of the candidates and of the first call."""
    study = load_study(STUDY)
    start = perf_counter()
    problem = _problem(study, n)
    drawn = perf_counter() - start
    # cvxpy loads its solvers at the first call.
    relax(_problem(study, 200), study.criterion("A"))
    found = {}
    for name in names:
        criterion = study.criterion(name)
        times = []
        for _ in range(repeats):
            start = perf_counter()
            answer = relax(problem, criterion)
            times.append(perf_counter() - start)
        found[name] = (median(times), answer.cost, answer.gap, drawn, times[0])
    return found


def streamed(name: str, n: int) -> tuple[float, float, float, float]:
    """Beyond memory: seconds of passes and solves, cost, gap, seconds of the candidates."""
    study = load_study(STUDY)
    source = CandidateSource(study.space, (study.specification.seed, 0))
    plan = relax_poses(source, n, study.criterion(name))
    return plan.seconds["solve"], plan.cost, plan.gap, plan.seconds["candidates"]


def _problem(study: Study, n: int) -> Problem:
    return CandidateSource(study.space, (study.specification.seed, 0)).take(n).problem


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=HERE,
    help="Folder for the results.",
)
def main(out: Path) -> None:
    """Measure, and write relax.md and relax.png."""
    everything = TEN
    total = len(COMPARED) * len(DIRECT_SIZES) * 2 + len(DIRECT_SIZES) + len(SIZES) + len(COMPARED)
    with tqdm(total=total, unit="case") as bar:

        def done(measured: Measured) -> Measured:
            bar.update()
            return measured

        mine = {n: done(measure(ours, everything, n, REPEATS)) for n in (*DIRECT_SIZES, *SIZES)}
        others = {
            (name, n, solver): done(measure(direct, name, n, solver, limit=LIMIT_S))
            for name in COMPARED
            for n in DIRECT_SIZES
            for solver in SOLVERS
        }
        large = {name: done(measure(streamed, name, STREAMED)) for name in COMPARED}
    best = {
        (name, n): _best(others, name, n, mine[n].answer[name][1])
        for name in COMPARED
        for n in DIRECT_SIZES
    }
    picture = png(_picture(mine, best, large), dpi=130)
    write_files({out / "relax.md": _report(mine, others, large, best), out / "relax.png": picture})


def _accurate(measured: Measured, cost: float) -> bool:
    """Whether a direct model has come near the proved optimum."""
    return measured.answer is not None and measured.answer[1] <= cost * (1 + ACCURATE)


def _best(others: dict[tuple[str, int, str], Measured], name: str, n: int, cost: float) -> float:
    """Seconds of the fastest direct model that is accurate; nan where none is."""
    runs = [others[name, n, solver] for solver in SOLVERS]
    return min((run.answer[0] for run in runs if _accurate(run, cost)), default=np.nan)


def _cell(measured: Measured, cost: float) -> str:
    """Seconds of a direct model, and its error where that is not small."""
    if measured.answer is None:
        return measured.failure
    seconds = f"{measured.answer[0]:.2f} s"
    if _accurate(measured, cost):
        return seconds
    return f"{seconds} (off by {measured.answer[1] / cost - 1:.1e})"


def _report(
    mine: dict[int, Measured],
    others: dict[tuple[str, int, str], Measured],
    large: dict[str, Measured],
    best: dict[tuple[str, int], float],
) -> str:
    """All tables as Markdown."""
    return "\n".join(
        [
            "# How fast is the relaxation?\n",
            f"{machine()}. Blocks of 3 rows, 5 parameters (KUKA KR 270). Written by `relax.py` "
            "beside this file.\n",
            "## Against a direct cvxpy model\n",
            f"Medians of {REPEATS} calls for edtk, which keeps the small program that cvxpy has "
            "compiled for a criterion (the first call compiles it); one run for a direct model. "
            "The ratio is of the fastest direct model that comes within 1e-3 of the proved optimum "
            "to "
            "the median; edtk proves a gap of 1e-6.\n",
            _versus(mine, others, best),
            "## All ten criteria, at scale\n",
            "Seconds by criterion, after the candidates with their information were drawn.\n",
            _at_scale(mine),
            "## Beyond the memory limit (1000 MB)\n",
            "Candidates are generated anew and priced in chunks, pass after pass.\n",
            _beyond_memory(large),
        ]
    )


def _versus(
    mine: dict[int, Measured],
    others: dict[tuple[str, int, str], Measured],
    best: dict[tuple[str, int], float],
) -> str:
    """The table of direct models beside edtk."""
    rows = []
    for n in DIRECT_SIZES:
        for name in COMPARED:
            seconds, cost, gap, _, first = mine[n].answer[name]
            cells = [_cell(others[name, n, solver], cost) for solver in SOLVERS]
            ratio = best[name, n] / seconds
            cells += [
                f"{first:.3f} s",
                f"{seconds:.3f} s",
                f"{gap:.0e}",
                f"{ratio:.0f}" if ratio > 0 else "-",
            ]
            rows.append([f"{n:,}", name, *cells])
    header = [
        "candidates",
        "criterion",
        "Clarabel",
        "SCS",
        "edtk, first call",
        "edtk",
        "proved gap",
        "ratio",
    ]
    return markdown_table(header, rows)


def _at_scale(mine: dict[int, Measured]) -> str:
    """The table of all criteria over many candidates."""
    rows = []
    for n, measured in mine.items():
        answers = list(measured.answer.values())
        cells = [
            f"{answers[0][3]:.2f} s",
            *(f"{a[0]:.2f}" for a in answers),
            f"{sum(a[0] for a in answers):.2f} s",
        ]
        rows.append(
            [f"{n:,}", *cells, f"{max(a[2] for a in answers):.0e}", f"{measured.peak_mb:.0f} MB"]
        )
    names = list(mine[SIZES[0]].answer)
    return markdown_table(
        ["candidates", "drawn in", *names, "all", "largest gap", "peak memory"], rows
    )


def _beyond_memory(large: dict[str, Measured]) -> str:
    """The table of candidates that do not fit in memory."""
    rows = []
    for name, m in large.items():
        cells = [m.failure] * 4
        if m.answer is not None:
            seconds, _, gap, drawn = m.answer
            cells = [f"{drawn:.1f} s", f"{seconds:.1f} s", f"{gap:.0e}", f"{m.peak_mb:.0f} MB"]
        rows.append([f"{STREAMED:,}", name, *cells])
    header = [
        "candidates",
        "criterion",
        "first part drawn in",
        "passes and solves",
        "proved gap",
        "peak memory",
    ]
    return markdown_table(header, rows)


def _picture(
    mine: dict[int, Measured], best: dict[tuple[str, int], float], large: dict[str, Measured]
) -> Figure:
    """Seconds over the number of candidates, on logarithmic axes."""
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.add_subplot()
    colours = dict(zip(COMPARED, COLOURS, strict=True))

    def line(points: Iterable[tuple[int, float]], **style: object) -> None:
        x, y = zip(*points, strict=True)
        ax.plot(x, y, linewidth=1.4, markersize=5, **style)

    for name, colour in colours.items():
        line(
            ((n, best[name, n]) for n in DIRECT_SIZES),
            color=colour,
            marker="s",
            linestyle="--",
            label=f"{name}, direct",
        )
        points = [(n, m.answer[name][0]) for n, m in mine.items()]
        if large[name].answer is not None:
            points.append((STREAMED, large[name].answer[0]))
        line(points, color=colour, marker="o", label=f"{name}, edtk")
    totals = ((n, sum(a[0] for a in m.answer.values())) for n, m in mine.items())
    line(totals, color="black", marker="D", label="all ten, edtk")
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="candidate poses",
        ylabel="seconds after the candidates are drawn",
    )
    ax.set_title("Optimal weights over candidate poses: one cvxpy model against edtk", fontsize=11)
    ax.grid(visible=True, which="both", alpha=0.25)
    ax.legend(fontsize=8, frameon=False, ncols=2)
    return figure


if __name__ == "__main__":
    main()
