"""How long does a proof of an exact plan take, beside SCIP on Sagnol and Harman's program?

`python studies/benchmarks/misocp.py` writes misocp.md beside this file. It needs the package
pyscipopt, which edtk itself does not use: pip install pyscipopt.

The mixed-integer second-order cone program of A-optimality (Sagnol and Harman 2015): with rows a_i,
``min sum t_i`` under ``sum_i a_i y_i' = I``, ``|y_i|^2 <= n_i t_i``, ``sum n_i = m``, n_i whole.
SCIP 10 solves it with its own relaxations and cuts, one thread. HiGHS has no cones.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

import edtk
from edtk.report.tables import markdown_table

PAGE = Path(__file__).with_suffix(".md")
SECONDS = 60.0
SAME = 2e-3  # relative difference of two answers that is the tolerance of SCIP
CASES = ((3, 20, 4), (3, 20, 8), (3, 50, 6), (4, 30, 8), (5, 50, 10), (5, 200, 10))


@dataclass(frozen=True)
class Answer:
    """What a method says.

    Attributes:
        cost: Trace of the inverse of the best plan.
        bound: No plan has less.
        seconds: Time of a processor [s].
    """

    cost: float
    bound: float
    seconds: float

    def cells(self) -> tuple[str, str, str]:
        """Cost, what is left open, and seconds."""
        left = 100 * max(0.0, 1 - self.bound / self.cost)
        proved = "proved" if left < 100 * SAME else f"{left:.2g} % left"
        return f"{self.cost:.6f}", proved, f"{self.seconds:.1f}"


def own(rows: np.ndarray, size: int, seconds: float) -> Answer:
    """Branch and bound with fixing."""
    since = process_time()
    found = edtk.plan(edtk.Problem(rows[:, None, :]), size, "A", prove=seconds)
    assert found.exact_bound is not None
    return Answer(found.cost, found.exact_bound.cost, process_time() - since)


def scip(rows: np.ndarray, size: int, seconds: float) -> Answer:
    """SCIP on the cone program."""
    from pyscipopt import Model, quicksum

    n, p = rows.shape
    model = Model()
    model.hideOutput()
    model.setParam("limits/time", seconds)
    model.setParam("timing/clocktype", 1)
    count = [model.addVar(vtype="I", lb=0, ub=size) for _ in range(n)]
    t = [model.addVar(lb=0) for _ in range(n)]
    y = [[model.addVar(lb=None) for _ in range(p)] for _ in range(n)]
    model.addCons(quicksum(count) == size)
    for j in range(p):
        for k in range(p):
            each = quicksum(float(rows[i, j]) * y[i][k] for i in range(n))
            model.addCons(each == float(j == k))
    for i in range(n):
        model.addCons(quicksum(own * own for own in y[i]) <= count[i] * t[i])
    model.setObjective(quicksum(t))
    since = process_time()
    model.optimize()
    taken = process_time() - since
    if not model.getNSols():
        return Answer(np.inf, model.getDualbound(), taken)
    # Cones that hold to 1e-6 give experiments that nobody makes a part: the plan tells the cost.
    made = np.round([model.getVal(own) for own in count])
    cost = float(np.trace(np.linalg.inv(rows.T @ (made[:, None] * rows))))
    return Answer(cost, model.getDualbound(), taken)


HEADER = (
    "p", "N", "m", "edtk", "of it", "edtk [s]", "SCIP", "of it ", "SCIP [s]", "agree",
)  # fmt: skip


def row(case: tuple[int, int, int], seconds: float) -> tuple[str, ...]:
    """A line of the table."""
    p, n, size = case
    rows = np.random.default_rng(p * n + size).normal(size=(n, p))
    ours = own(rows, size, seconds)
    theirs = scip(rows, size, seconds)
    # Neither bound may be above the plan of the other.
    agree = theirs.bound <= ours.cost * (1 + SAME) and ours.bound <= theirs.cost * (1 + SAME)
    told = "yes" if agree else "no"
    return (f"{p}", f"{n}", f"{size}", *ours.cells(), *theirs.cells(), told)


def main(arguments: Sequence[str]) -> int:
    """Compare, write the page, and tell whether all agree."""
    seconds = float(arguments[0]) if arguments else SECONDS
    rows = []
    with threadpool_limits(1):
        for case in CASES:
            rows.append(row(case, seconds))
            print(*rows[-1], flush=True)
    text = f"""# Proofs of exact plans beside SCIP

`python studies/benchmarks/misocp.py` wrote this file; it ends with code 1 if two answers contradict
each other. It needs pyscipopt, which edtk does not.

A-optimal plans of m experiments among N Gaussian rows of p parameters, each as often as wanted:
trace of the inverse, what is proved of it, and seconds of one processor. SCIP (by pyscipopt) solves
the mixed-integer second-order cone program of Sagnol and Harman (2015) with its defaults, and had
{seconds:g} s, as edtk had. Its cones hold to 1e-6, so that its bound may be a thousandth off: costs
are those of its plans, computed anew, and 0.2 % counts as proved. Gurobi and Mosek need licences,
and HiGHS has no cones; they are not compared.

{markdown_table(HEADER, rows)}
"""
    PAGE.write_text(text, encoding="utf-8")
    return 0 if all(line[-1] == "yes" for line in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
