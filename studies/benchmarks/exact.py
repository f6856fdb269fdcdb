"""How good are exact plans on candidates, and how long does a start take beside AlgDesign?

    python studies/benchmarks/exact.py

writes exact.md beside this file. R with the package AlgDesign is measured in the same run, one
start after the other on one thread, where `Rscript` finds it. R is r-base-core of Debian; the
package is not among Debian's, and was built from its sources, version 1.2.1.2, for this measurement
alone (R_LIBS says where it is).
"""

import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from time import process_time

import numpy as np
from measure import machine
from threadpoolctl import threadpool_limits

import edtk
from edtk import Problem
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
STARTS = 200
SEED = 1
MOST = 5.0  # times the time of AlgDesign for a start, of ours with its five kicks
ALONE = 3.0  # the same of one descent alone
TOGETHER = 200  # starts of one call, of exchange alone
MANY = 4000  # of small models: R counts milliseconds
CALLS = 40  # of one start each
REPEATS = 2  # of which the shortest time counts
SAME = 5e-8  # of a determinant that is as good as another one
EXCHANGES = [
    *("model", "n", "criterion", "ms of many", "AlgDesign", "ratio"),
    *("ms a call", "AlgDesign a call", "ratio of calls", "hold"),
]
HADAMARD = (12, 16, 20)
SCRIPT = """
suppressMessages(library(AlgDesign))
candidates <- gen.factorial({levels}, {factors}, center = TRUE)
candidates <- candidates / max(candidates)
set.seed({seed})
time <- system.time(
  found <- optFederov(~quad(.), candidates, nTrials = {size}, nRepeats = {starts}))
cat(time[["user.self"]], found$D)
"""
# A plan of AlgDesign takes a row of the candidates once, so that of nine rows a plan of nine would
# leave nothing to exchange: those of few rows are given twice. Without answer is a call that ends
# with "Singular design".
EXCHANGE = """
suppressMessages(library(AlgDesign))
candidates <- gen.factorial({levels}, {factors}, center = TRUE)
candidates <- candidates / max(candidates)
if (nrow(candidates) == {size}) candidates <- rbind(candidates, candidates)
seconds <- function(work) min(sapply(seq_len({repeats}), function(i) {{
  set.seed(i)
  system.time(work())[["user.self"]]}}))
one <- function(repeats) try(silent = TRUE, optFederov(
  ~quad(.), candidates, nTrials = {size}, nRepeats = repeats, criterion = "{letter}"))
if (inherits(one({together}), "try-error")) stop("singular")
cat(seconds(function() one({together})) / {together},
    seconds(function() for (i in seq_len({calls})) one(1)) / {calls})
"""


@dataclass(frozen=True)
class Case:
    """A full quadratic model on a grid.

    Attributes:
        levels: Levels of each factor.
        factors: Number of factors.
        size: Number of experiments.
        best: The best ``det(M/n)^(1/p)`` that AlgDesign was seen to find.
    """

    levels: int
    factors: int
    size: int
    best: float = 0.0

    def __str__(self) -> str:
        return f"quadratic {self.levels}^{self.factors}"

    def rows(self) -> np.ndarray:
        """Rows (n, p) of the candidates."""
        grid = np.linspace(-1.0, 1.0, self.levels)
        x = np.array(list(product(grid, repeat=self.factors)))
        pairs = [x[:, i] * x[:, j] for i, j in combinations(range(self.factors), 2)]
        return np.column_stack([np.ones(len(x)), x, x**2, *pairs])


CASES = (
    Case(5, 3, 15, 0.4594898),
    Case(3, 4, 15, 0.4250473),
    Case(3, 4, 24, 0.4723634),
    Case(3, 5, 26, 0.4824686),
)
SMALL = (Case(3, 2, 9), Case(5, 2, 10), Case(3, 3, 14))
MORE = (Case(3, 4, 18),)  # of as many experiments as parameters many starts of AlgDesign end


def own(case: Case) -> tuple[float, float, int]:
    """Best determinant, seconds for a start without the bound, and how many starts were as good."""
    problem = Problem(case.rows()[:, None, :])
    # The bound takes the same time whatever the number of starts, and its libraries load once.
    taken = []
    for starts in (1, 1, 1 + STARTS):
        since = process_time()
        found = edtk.plan(problem, size=case.size, criterion="D", seed=SEED, starts=starts)
        taken.append(process_time() - since)
    return found.value / case.size, (taken[-1] - taken[-2]) / STARTS, found.found


def algdesign(case: Case) -> tuple[float, float] | None:
    """Best determinant, and seconds for a start; None where R or the package is not there."""
    told = _told_by_r(SCRIPT, case, starts=STARTS, seed=SEED)
    return None if told is None else (told[1], told[0] / STARTS)


def _told_by_r(script: str, case: Case, **numbers: object) -> list[float] | None:
    """Numbers that a script of R writes; None where R or the package is not there."""
    if shutil.which("Rscript") is None:
        return None
    text = script.format(levels=case.levels, factors=case.factors, size=case.size, **numbers)
    done = subprocess.run(["Rscript", "-e", text], capture_output=True, text=True, check=False)
    return None if done.returncode else [float(word) for word in done.stdout.split()]


def exchanged(case: Case, letter: str, together: int) -> tuple[float, float]:
    """Seconds of `edtk.exchange` for a start of many together, and for a call with one."""
    rows = case.rows()
    points = {"points": rows} if letter == "I" else {}
    criterion = edtk.criteria.create(letter, **points)
    problem = Problem(rows[:, None, :])
    rng = np.random.default_rng(SEED)
    starts = rng.integers(len(rows), size=(together, case.size))

    def one_by_one() -> None:
        for start in starts[:CALLS]:
            with suppress(edtk.UserError):  # a start that stays singular
                edtk.exchange(problem, criterion, start)

    many = _shortest(lambda: edtk.exchange(problem, criterion, starts))
    return many / together, _shortest(one_by_one) / CALLS


def _shortest(work: Callable[[], object]) -> float:
    """The least seconds of a few times the same work."""
    taken = []
    for _ in range(REPEATS):
        since = process_time()
        work()
        taken.append(process_time() - since)
    return min(taken)


def starts_of_exchange() -> list[list[object]]:
    """One start of exchange in both packages: a row for each model and criterion."""
    rows: list[list[object]] = []
    for case in (*SMALL, *CASES, *MORE):
        for letter in "DAI":
            together = MANY if case in SMALL else TOGETHER
            many, single = exchanged(case, letter, together)
            numbers = {"repeats": REPEATS, "together": together, "calls": CALLS}
            told = _told_by_r(EXCHANGE, case, letter=letter, **numbers)
            cells = [f"{1e3 * many:.3f}", "no answer", "", f"{1e3 * single:.2f}", "", "", ""]
            if told is not None:
                ratios = many / told[0], single / told[1]
                cells[1:3] = f"{1e3 * told[0]:.3f}", f"{ratios[0]:.2f}"
                cells[4:6] = f"{1e3 * told[1]:.2f}", f"{ratios[1]:.2f}"
                cells[6] = " ".join("yes" if ratio <= ALONE else "no" for ratio in ratios)
            rows.append([str(case), case.size, letter, *cells])
    return rows


def hadamard(p: int) -> tuple[float, int, float]:
    """Value of the best saturated plan of a constant and p - 1 factors, starts, and seconds."""
    bits = (np.arange(2 ** (p - 1))[:, None] >> np.arange(p - 1)) & 1
    rows = np.hstack([np.ones((len(bits), 1)), 2.0 * bits - 1.0])
    problem = Problem(rows[:, None, :])
    since = process_time()
    found = edtk.plan(problem, size=p, criterion="D", seed=SEED)
    return found.value / p, found.starts, process_time() - since


def main() -> int:
    """Write the report; 1 if a plan is worse than the best known, or a start takes too long."""
    rows = []
    holds = True
    for case in CASES:
        best, seconds, found = own(case)
        other = algdesign(case)
        ratio = seconds / other[1] if other else np.nan
        as_asked = best >= case.best - SAME and not ratio > MOST
        holds &= as_asked
        rows.append(
            [
                str(case),
                case.size,
                f"{case.best:.7f}",
                f"{best:.7f}",
                f"{found} of {1 + STARTS}",
                f"{1e3 * seconds:.2f}",
                f"{other[0]:.7f}" if other else "not there",
                f"{1e3 * other[1]:.2f}" if other else "",
                f"{ratio:.2f}" if other else "",
                "yes" if as_asked else "no",
            ]
        )
    cubes = []
    for p in HADAMARD:
        value, starts, seconds = hadamard(p)
        as_asked = value >= 1 - SAME
        holds &= as_asked
        cubes.append([p, f"{value:.9f}", starts, f"{seconds:.1f}", "yes" if as_asked else "no"])
    write_text(HERE / "exact.md", _page(rows, starts_of_exchange(), cubes))
    return 0 if holds else 1


def _page(
    rows: list[list[object]], exchanges: list[list[object]], cubes: list[list[object]]
) -> str:
    """The report."""
    header = [
        "model",
        "n",
        "asked",
        "found",
        "by starts",
        "ms a start",
        "AlgDesign",
        "its ms a start",
        "ratio",
        "holds",
    ]
    return f"""# Exact plans on candidates

`python studies/benchmarks/exact.py` wrote this file. It ends with code 1 if a row of
the first or the last table does not hold.

## Plans from many starts

det(M/n)^(1/p) of full quadratic models, from {1 + STARTS} starts of one seed on one thread. A
start of `edtk.plan` is a descent and five kicks, each with a descent of its own; a start of
AlgDesign is one descent. A row holds if the determinant is the best that AlgDesign was seen to find
("asked"), and a start takes at most {MOST:g} times as long as one of AlgDesign. {machine()}.

{markdown_table(header, rows)}

## One start of exchange alone

`edtk.exchange` beside `optFederov(nRepeats=1)`, in milliseconds of the processor. First a start is
one of many of a call ({TOGETHER}, or {MANY} of the small models), then it is a call of its own; the
least of {REPEATS} times. A ratio of {ALONE:g} at most was asked for. "hold" says whether the first
ratio keeps to it, and then the second one.

Ours exchanges the places in turn (Cook and Nachtsheim 1980). AlgDesign's makes the best of all
exchanges (Fedorov 1972), in C. What ours spends on small models is Python, not arithmetic.
AlgDesign 1.2.1.2 was built from its sources, with R of Debian's r-base-core. It takes each
candidate once at most; of the nine candidates of quadratic 3^2 it is given two copies, or nothing
could be exchanged. "no answer": one of its starts was singular, and its call ended with an error.

{markdown_table(EXCHANGES, exchanges)}

## Hadamard matrices

Plans of p experiments for a constant and p - 1 factors of two levels, over all corners. By
Hadamard's bound no determinant is above one. The time is that of the whole call, with the bound
that proves the plan.

{markdown_table(["n = p", "det(M/n)^(1/p)", "starts", "seconds", "holds"], cubes)}
"""


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
