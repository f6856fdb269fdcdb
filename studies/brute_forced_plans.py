"""Proofs that no plan is better, against all plans of 200 small problems: never a false one.

Each problem has random candidates of one to three rows, of normal numbers or of two levels; every
fourth has a prior, every fifth a limit for each candidate. All its plans are enumerated.

Run: python studies/brute_forced_plans.py [PROBLEMS]
"""

import sys
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, count, islice
from pathlib import Path
from time import process_time

import numpy as np

import criteria
from criteria import Criterion
from edtk import Problem
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.prove_exact import prove_exact
from edtk.report.tables import markdown_table

NAMES = ("A", "D", "E", "G", "O1", "O3", "O5", "c", "Ds", "rho0")
PROBLEMS = 200
SECONDS = 60.0  # for one proof
PAGE = Path(__file__).with_suffix(".md")


@dataclass(frozen=True)
class Outcome:
    """A proof beside the least cost of all plans.

    Attributes:
        name: Name of the criterion.
        plans: Number of plans.
        below: How far the proved bound is below the least cost; negative for a false proof.
        proved: Whether the best plan is said to be proved.
        best: Whether it is the best one.
        nodes: Nodes of the tree.
        seconds: Processor time of the proof [s].
    """

    name: str
    plans: int
    below: float
    proved: bool
    best: bool
    nodes: int
    seconds: float


def criterion_of(name: str, p: int, rng: np.random.Generator) -> Criterion:
    """A criterion of p parameters."""
    own: dict[str, object] = {"name": name}
    if name == "c":
        own["c"] = rng.normal(size=p).tolist()
    if name == "Ds":
        own["interest"] = np.eye(p)[:, :1].tolist()
    if name == "rho0":
        own["target"] = rng.normal(size=(2, p)).tolist()
    return criteria.from_dict(own)


def outcome(seed: int) -> Outcome | None:
    """The proof of one problem; None where no plan of it tells all parameters."""
    rng = np.random.default_rng(seed)
    p, r, n = (int(x) for x in rng.integers((2, 1, 5), (5, 4, 13)))
    m = int(rng.integers(2, 6))
    A = rng.normal(size=(n, r, p))
    problem = Problem(np.sign(A) if seed % 3 == 0 else A)
    B = rng.normal(size=(2, p))
    limits = Limits(m, B.T @ B if seed % 4 == 1 else np.zeros((p, p)))
    name = NAMES[seed % len(NAMES)]
    criterion = criterion_of(name, p, rng)
    plans = np.array(list(combinations_with_replacement(range(n), m)))
    if seed % 5 == 2:
        limits = replace(limits, most=rng.integers(1, 3, n))
        counts = np.array([np.bincount(plan, minlength=n) for plan in plans])
        plans = plans[(counts <= limits.most).all(axis=1)]
    costs = criterion.cost(problem.plan_information(plans, np.ones(plans.shape)) + limits.base)
    least = float(costs.min())
    if not np.isfinite(least):
        return None
    start = process_time()
    found = prove_exact(problem, criterion, limits, seconds=SECONDS)
    return Outcome(
        name=name,
        plans=len(plans),
        below=1.0 - found.cost / least,
        proved=found.proved,
        best=bool(found.best <= least * (1 + 1e-9)),
        nodes=found.tree.nodes,
        seconds=process_time() - start,
    )


HEADER = (
    "criterion", "problems", "proved", "false", "largest gap", "nodes, median", "seconds, most",
)  # fmt: skip


def table(outcomes: list[Outcome]) -> str:
    """Numbers by criterion."""
    rows = []
    for name in NAMES:
        own = [each for each in outcomes if each.name == name]
        wrong = sum(each.below < 0 or (each.proved and not each.best) for each in own)
        gap = max(each.below for each in own)
        nodes = int(np.median([each.nodes for each in own]))
        longest = max(each.seconds for each in own)
        proved = sum(each.proved for each in own)
        rows.append(
            (name, f"{len(own)}", f"{proved}", f"{wrong}", f"{gap:.0e}", f"{nodes}",
             f"{longest:.2f}")
        )  # fmt: skip
    return markdown_table(HEADER, rows)


def main(problems: int) -> None:
    """Enumerate, prove, and write the page."""
    told = (each for each in map(outcome, count()) if each is not None)
    found = list(islice(told, problems))
    words = (
        "# Proofs against all plans\n\n"
        f"{len(found)} small problems whose {sum(each.plans for each in found):,} plans were all "
        "computed: random candidates of one to three\nrows, normal or of two levels, with and "
        "without a prior and limits for each candidate. A proof is false where its\nbound is above "
        "the least cost, or where a plan that it calls the best is not. Written by\n"
        "`studies/brute_forced_plans.py`; seconds are of one core.\n\n"
    )
    PAGE.write_text(words + table(found), encoding="utf-8")
    print(table(found))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else PROBLEMS)
