"""How much slower are criteria of a part of the parameters than those of all?

    python studies/benchmarks/interest.py

writes interest.md beside this file: the time of a look at exchanges, and of a step of a descent,
relative to the same criterion of all parameters.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np

import criteria
from edtk import Problem, load_study
from edtk.design.candidate_source import CandidateSource
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.design.interior_point.objective import Neighbourhood
from edtk.design.relaxation.settle import LogCost
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
NAMES = ("A", "D", "E", "G", "O5")
PLANS = 16
EXPERIMENTS = 6
CANDIDATES = 1250
SHARPNESS = 30.0
MOST = 1.5  # times the base criterion


def ratio(base: Callable[[], object], other: Callable[[], object], times: int) -> float:
    """Time of a function relative to another one, the two in turn."""
    seconds: tuple[list[float], list[float]] = ([], [])
    for _ in range(times):
        for taken, call in zip(seconds, (base, other), strict=True):
            since = process_time()
            call()
            taken.append(process_time() - since)
    return median(seconds[1]) / median(seconds[0])


def exchange_ratio(problem: Problem, name: str, K: np.ndarray) -> float:
    """Ratio for a look at all exchanges of one place."""
    rng = np.random.default_rng(0)
    places = rng.integers(0, problem.n, (PLANS, EXPERIMENTS))
    times = np.ones(places.shape)
    rest = problem.plan_information(places, times) - problem.blocks(places[:, 0])
    chosen = np.broadcast_to(np.arange(CANDIDATES), (PLANS, CANDIDATES))
    joined = problem.blocks(chosen)
    factors = problem.factors(chosen)

    def look(criterion: criteria.Criterion) -> Callable[[], object]:
        return lambda: exchange_costs(criterion, rest, joined, factors, times[:, 0])

    return ratio(look(criteria.create(name)), look(criteria.create(name, interest=K)), 9)


def descent_ratio(name: str, K: np.ndarray) -> float:
    """Ratio for the derivatives of one step of a descent of the milling study's plans."""
    space = load_study(HERE.parent / "kr270_milling.toml").space
    x = CandidateSource(space, 0, workers=1).take(PLANS * EXPERIMENTS).x
    x = x.reshape(PLANS, EXPERIMENTS, -1)

    def step(criterion: criteria.Criterion) -> Callable[[], object]:
        objective = LogCost(criterion.smoothed(SHARPNESS), np.ones(x.shape[:2]))
        return lambda: objective.local(Neighbourhood(space, x), np.arange(PLANS))

    return ratio(step(criteria.create(name)), step(criteria.create(name, interest=K)), 30)


def main() -> int:
    """Write the report; 1 if a ratio is above the limit."""
    rng = np.random.default_rng(0)
    milling = load_study(HERE.parent / "kr270_milling.toml").space
    five = CandidateSource(milling, 0, workers=1).take(2000).problem
    eight = Problem(rng.normal(size=(2000, 3, 8)))
    rows = []
    worst = 0.0
    for name in NAMES:
        found = [
            exchange_ratio(problem, name, K)
            for problem in (five, eight)
            for K in (np.eye(problem.p)[:, :1], np.eye(problem.p)[:, 1:])
        ]
        found += [descent_ratio(name, np.eye(5)[:, :1]), descent_ratio(name, np.eye(5)[:, 1:])]
        worst = max(worst, *found)
        rows.append([name, *(f"{each:.2f}" for each in found)])
    header = ["criterion", *(f"exchange, {s} of {p}" for p in (5, 8) for s in (1, p - 1))]
    text = (
        "# Criteria of a part of the parameters\n\n"
        "`python studies/benchmarks/interest.py` wrote this file: time relative to the same "
        f"criterion of all parameters, at most {MOST:g}: {'yes' if worst <= MOST else 'NO'}.\n\n"
        f"{markdown_table([*header, 'descent, 1 of 5', 'descent, 4 of 5'], rows)}"
    )
    write_text(HERE / "interest.md", text)
    return 0 if worst <= MOST else 1


if __name__ == "__main__":
    sys.exit(main())
