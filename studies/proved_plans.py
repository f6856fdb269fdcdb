"""The best plans of the paper's example on 100,000 candidate poses, proved or bounded.

For each criterion and size: a plan of `edtk plan`, whose poses move off the candidates, and beside
it the best plan on the candidates, proved by branch and bound, or as far as the time goes. The page
proved_plans.md has the table.

    python studies/proved_plans.py [seconds for a proof]
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

import edtk
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.report.tables import markdown_table
from edtk.study.plan_study import plan_study, source_of
from edtk.study.study import load_study

HERE = Path(__file__).parent
STUDY = HERE / "kr270_milling.toml"
PAGE = Path(__file__).with_suffix(".md")
CANDIDATES = 100_000
SECONDS = 60.0
SEARCH = 20.0  # [s], of a plan off the candidates
CRITERIA = ("rho0", "A", "D", "E")
SIZES = (2, 3, 4, 6, 12)


@dataclass(frozen=True)
class Row:
    """What is known of one size.

    Attributes:
        criterion: Name of the criterion.
        size: Number of experiments.
        shown: Factor and unit of its values.
        on: The best plan known on the candidates, with its proof.
        off: Cost of the plan off the candidates.
        relaxed: Cost that no weights of the candidates are below, for as many experiments.
        seconds: Time of a processor for search and proof on the candidates.
    """

    criterion: str
    size: int
    shown: tuple[float, str]
    on: ProblemPlan
    off: float
    relaxed: float
    seconds: float

    def cells(self) -> tuple[str, ...]:
        """A line of the table."""
        factor, unit = self.shown
        assert self.on.proof is not None
        assert self.on.exact_bound is not None
        left = 100 * (1 - self.on.exact_bound.cost / self.on.cost)
        return (
            self.criterion,
            f"{self.size}",
            f"{factor * self.on.value:.6g} {unit}".rstrip(),
            "the best" if self.on.proved_exact else f"within {left:.2g} % of the best",
            f"{100 * (1 - self.relaxed / self.on.cost):.2f}",
            f"{100 * (self.on.cost / self.off - 1):.2f}",
            f"{self.on.proof.tree.nodes:,}",
            f"{self.seconds:.0f}",
        )


HEADER = (
    "criterion", "m", "best on the candidates", "proved", "weights leave [%]",
    "off them better by [%]", "nodes", "seconds",
)  # fmt: skip


def page(rows: list[Row], seconds: float) -> str:
    """The page."""
    return f"""# The best plans of the paper's example on {CANDIDATES:,} candidates

`python studies/proved_plans.py` wrote this file. It answers `studies/kr270_milling.toml` as
`edtk plan studies/kr270_milling.toml --size m --candidates {CANDIDATES} --prove SECONDS` does.

"The best" is the best of all plans of m experiments on these {CANDIDATES:,} candidate poses, each
as often as wanted: none on them is better, proved by branch and bound. Where {seconds:g} s did not
suffice, the plan is within so many percent of the best. "Weights leave" is what the relaxed bound
alone leaves open. Poses of `edtk plan` move off the candidates; so its plans are better than the
best on them by the next column. Seconds are of a processor, for search and proof.

{markdown_table(HEADER, [row.cells() for row in rows])}
"""


def main(arguments: Sequence[str]) -> int:
    """Prove all, and write the page."""
    seconds = float(arguments[0]) if arguments else SECONDS
    study = load_study(STUDY)
    rows = []
    with threadpool_limits(1):
        problem = source_of(study).take(CANDIDATES).problem
        nothing = np.zeros(problem.n, dtype=int)
        for name in CRITERIA:
            criterion = study.criterion(name)
            relaxed = edtk.relax(problem, criterion).proved_bound
            for size in SIZES:
                off = plan_study(study, size, name, budget=SEARCH)
                since = process_time()
                limits = Limits(size, np.zeros((problem.p, problem.p)))
                on = find_counts(problem, criterion, limits, nothing, prove=seconds)
                taken = process_time() - since
                bound = relaxed.scaled(size).cost
                rows.append(Row(name, size, criterion.shown, on, off.cost, bound, taken))
                print(*rows[-1].cells(), flush=True)
    PAGE.write_text(page(rows, seconds), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
