"""Published optimal plans that are proved to be the best of all plans on their candidates.

A search finds a plan; branch and bound proves that none is better, or how much better one can be
(`docs/explanation/exact_plans.md`). Each proof is written as a certificate, and checked by the
second implementation. The page proved_optima.md has the table.

    python studies/proved_optima.py [seconds for a proof]
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

import edtk
from edtk.certificate.problem_proofs import store_exact
from edtk.report.tables import markdown_table

PAGE = Path(__file__).with_suffix(".md")
SECONDS = 60.0
STARTS = 64
SAME = 1e-6  # relative difference of printed values
# The largest |det| of n x n matrices of +-1 (Hadamard's problem), and of 0 and 1.
SIGNS = {4: 16, 5: 48, 6: 160, 7: 576, 8: 4096}
ZEROS = {3: 2, 4: 3, 5: 5, 6: 9, 7: 32}


@dataclass(frozen=True)
class Case:
    """A question whose answer is known, or believed to be.

    Attributes:
        name: What it is.
        rows: Rows (n, p) of the candidates.
        size: Number of experiments.
        criterion: Name of the criterion.
        known: Its published value; None where the search alone says it.
        source: Who says so.
    """

    name: str
    rows: np.ndarray
    size: int
    criterion: str
    known: float | None
    source: str


@dataclass(frozen=True)
class Row:
    """What was found, in the order of the table."""

    case: Case
    value: float
    relaxed: float
    exact: float
    proved: bool
    nodes: int
    seconds: float
    checking: float
    checked: bool

    @property
    def holds(self) -> bool:
        """Whether the plan is as good as the published one, and the proof was checked."""
        known = self.case.known
        return self.checked and (known is None or abs(self.value - known) <= SAME * known)


def signs(p: int) -> np.ndarray:
    """Weighings of p objects on two pans: +-1, but for the sign of the whole."""
    return np.array([(1.0, *rest) for rest in product((1.0, -1.0), repeat=p - 1)])


def subsets(p: int) -> np.ndarray:
    """Weighings of p objects on a spring balance: on it or not."""
    return np.array(list(product((0.0, 1.0), repeat=p)))[1:]


def quadratic(levels: int, factors: int) -> np.ndarray:
    """The full quadratic model on a grid."""
    x = np.array(list(product(np.linspace(-1.0, 1.0, levels), repeat=factors)))
    pairs = [x[:, i] * x[:, j] for i, j in combinations(range(factors), 2)]
    return np.column_stack([np.ones(len(x)), x, x**2, *pairs])


def main_effects() -> np.ndarray:
    """Four factors of 4, 3, 2 and 2 levels, each level but the first with an effect of its own."""
    levels = np.array(list(product(range(4), range(3), range(2), range(2))))
    own = [levels[:, f] == i for f, n in enumerate((4, 3, 2, 2)) for i in range(1, n)]
    return np.column_stack([np.ones(len(levels)), *own]).astype(float)


def weighings() -> list[Case]:
    """Weighing designs."""
    found = []
    for n, det in SIGNS.items():
        found.append(Case(f"two pans, {n} objects", signs(n), n, "D", det ** (2 / n), "Hadamard"))
    for n, det in ZEROS.items():
        value = det ** (2 / n)
        found.append(Case(f"spring balance, {n} objects", subsets(n), n, "D", value, "Williamson"))
    for p, n in ((3, 5), (4, 5), (4, 9), (5, 9)):
        d = ((n - 1) ** (p - 1) * (n - 1 + p)) ** (1 / p)
        a = (p - 1) / (n - 1) + 1 / (n - 1 + p)
        found.append(Case(f"two pans, {p} objects", signs(p), n, "D", d, "Cheng 1980"))
        found.append(Case(f"two pans, {p} objects", signs(p), n, "A", a, "Cheng 1980"))
    for p, n in ((4, 6), (4, 10)):
        d = ((n - 2) * (n + 2)) ** (2 / p)
        found.append(Case(f"two pans, {p} objects", signs(p), n, "D", d, "Ehlich 1964"))
    return found


def of_levels() -> list[Case]:
    """Designs of several levels."""
    square = quadratic(3, 2)
    found = [
        Case("quadratic, 3 x 3 levels", square, n, name, known, source)
        for name in ("D", "A")
        for n, known, source in (
            (6, None, "search"),
            (7, None, "search"),
            (9, 5184 ** (1 / 6) if name == "D" else None, "Atkinson, Donev" * (name == "D")),
            (12, None, "search"),
        )
    ]
    found.append(Case("quadratic, 5 x 5 levels", quadratic(5, 2), 7, "D", None, "search"))
    found.append(Case("quadratic, 3^3 levels", quadratic(3, 3), 10, "D", None, "search"))
    found.append(Case("quadratic, 3^3 levels", quadratic(3, 3), 14, "D", None, "search"))
    found.append(Case("AlgDesign: 4 x 3 x 2 x 2", main_effects(), 11, "D", None, "search"))
    algdesign = quadratic(5, 3), 15, "D", 15 * 0.4594898, "AlgDesign"
    found.append(Case("AlgDesign: quadratic, 5^3", *algdesign))
    algdesign = quadratic(3, 4), 15, "D", 15 * 0.4250473, "AlgDesign"
    found.append(Case("AlgDesign: quadratic, 3^4", *algdesign))
    return found


def prove(case: Case, seconds: float) -> Row:
    """Search, prove, write the certificate, and check it."""
    problem = edtk.Problem(case.rows[:, None, :])
    since = process_time()
    found = edtk.plan(problem, case.size, case.criterion, starts=STARTS, prove=seconds)
    taken = process_time() - since
    assert found.proof is not None
    assert found.exact_bound is not None
    content = store_exact(found)
    since = process_time()
    checked = edtk.verify(content, problem)
    return Row(
        case,
        found.value,
        found.lower_bound.cost / found.cost,
        found.exact_bound.cost / found.cost,
        found.proved_exact,
        found.proof.tree.nodes,
        taken,
        process_time() - since,
        checked.valid,
    )


@dataclass(frozen=True)
class Balanced:
    """A balanced incomplete block design: v treatments in b blocks of k."""

    v: int
    b: int
    k: int

    def row(self) -> tuple[str, ...]:
        """The plan that is found, and its efficiency beside all plans in such blocks."""
        v, b, k = self.v, self.b, self.k
        contrasts = np.vstack([np.eye(v - 1), np.zeros((1, v - 1))])
        pairs = b * k * (k - 1) / (v * (v - 1))
        known = ((pairs * v / k) ** (v - 1) / v) ** (1 / (v - 1))
        since = process_time()
        found = edtk.plan(edtk.Problem(contrasts[:, None, :]), blocks=(k,) * b, starts=8)
        taken = process_time() - since
        holds = abs(found.value - known) <= SAME * known and found.efficiency > 1 - SAME
        return (
            f"{v}", f"{b}", f"{k}", f"{found.value:.6f}", f"{known:.6f}",
            f"{found.efficiency:.6f}", f"{taken:.1f}", "yes" if holds else "no",
        )  # fmt: skip


BALANCED = (
    Balanced(4, 6, 2),
    Balanced(4, 4, 3),
    Balanced(5, 10, 2),
    Balanced(6, 10, 3),
    Balanced(7, 7, 3),
    Balanced(8, 14, 4),
    Balanced(9, 12, 3),
)


def written(row: Row) -> tuple[str, ...]:
    """A line of the table."""
    case = row.case
    n, p = case.rows.shape
    return (
        case.name,
        f"{n}",
        f"{p}",
        f"{case.size}",
        case.criterion,
        f"{row.value:.6f}",
        "" if case.known is None else f"{case.known:.6f}",
        case.source,
        f"{100 * (1 - row.relaxed):.2f}",
        "the best" if row.proved else f"within {100 * (1 - row.exact):.2f} %",
        f"{row.nodes:,}",
        f"{row.seconds:.1f}",
        f"{row.checking:.1f}",
        "yes" if row.holds else "no",
    )


HEADER = (
    "question", "N", "p", "m", "criterion", "value", "published", "by", "relaxed leaves [%]",
    "proved", "nodes", "proof [s]", "check [s]", "holds",
)  # fmt: skip
BLOCKS = ("v", "b", "k", "D found", "D of the design", "efficiency", "seconds", "holds")


def page(rows: list[Row], blocks: list[tuple[str, ...]], seconds: float) -> str:
    """The page."""
    proved = sum(row.proved for row in rows)
    return f"""# Published optima, proved

`python studies/proved_optima.py` wrote this file; it ends with code 1 if a row does not hold.

{proved} of {len(rows)} plans are proved to be the best of all plans of m experiments on the N
candidates, each experiment as often as wanted. A row holds if the plan is as good as the published
one, and its certificate is valid in the second implementation. "Relaxed leaves" is what weights
instead of whole numbers leave open. A proof had {seconds:g} s of time; what it has not proved by
then is within so many percent of the best; a busy machine proves less. Of D the value is
det(M)^(1/p), of A the trace of the inverse. Seconds are of a processor, the search
included.

{markdown_table(HEADER, [written(row) for row in rows])}

Two pans: each of m weighings puts every object on one of two pans; the published determinants are
the largest of matrices of +-1. Spring balance: of 0 and 1. The example of 4 x 3 x 2 x 2 levels, 11
experiments, is of tutorials of AlgDesign; what AlgDesign found for the others is of
`studies/benchmarks/exact.md`.

## Balanced incomplete blocks

v treatments in b blocks of k: the bound is that of weights of whole blocks.

{markdown_table(BLOCKS, blocks)}
"""


def main(arguments: Sequence[str]) -> int:
    """Prove all, write the page, and tell whether all rows hold."""
    seconds = float(arguments[0]) if arguments else SECONDS
    with threadpool_limits(1):
        rows = []
        for case in (*weighings(), *of_levels()):
            rows.append(prove(case, seconds))
            print(*written(rows[-1]), flush=True)
        blocks = [one.row() for one in BALANCED]
    PAGE.write_text(page(rows, blocks, seconds), encoding="utf-8")
    holds = all(row.holds for row in rows) and all(row[-1] == "yes" for row in blocks)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
