"""Time until a plan is within 1 % of the best known one, by three ways.

`python studies/benchmarks/plan.py` writes plan.md beside this file, in about half an hour. Compared
are edtk, SLSQP on finite differences, and differential evolution. All three minimise log rho0 of m
poses of the paper's example under its constraints, from feasible poses drawn at random, and stop
when they meet a feasible plan that is good enough. They run one after the other on one core, seed
by seed.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from measure import Measured, machine, measure
from scipy.optimize import NonlinearConstraint, differential_evolution, minimize
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from edtk import Study, exchange, load_study
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace, Experiments
from edtk.design.interior_point.descend import descend
from edtk.design.interior_point.objective import Local, Neighbourhood
from edtk.design.relaxation.settle import LogCost
from edtk.report.tables import markdown_table
from edtk.system.files import write_text
from edtk.system.typing import Array, Indices

HERE = Path(__file__).parent
STUDY = HERE.parent / "kr270_milling.toml"
BEST = HERE.parents[1] / "paper_figures" / "own_plans"
SIZES = (3, 6, 12)
SEEDS = {"ours": 41, "slsqp": 15, "evolution": 1}
LIMIT_S = {"ours": 100.0, "slsqp": 120.0, "evolution": 60.0}

# Ours: so many plans at a time are exchanged among a pool of poses, and refined by so many steps.
POOL = 256
STARTS = 4
STEPS = 20
SHORTLIST = (16,)
WARM = 5  # searches before the one that is timed, which takes milliseconds only

# Value of a plan that identifies nothing: SLSQP cannot go on from infinity.
SINGULAR = 1e3

MOST_TURNS = 10_000

Function = Callable[[Array], Any]


class _Reached(Exception):
    """A plan that is good enough was met."""


def load(m: int) -> tuple[Study, float]:
    """The study, and the log of 1.01 times the best known rho0."""
    study = load_study(STUDY)
    best = study.load_plan(BEST / f"true_m{m}.csv")
    cost = study.criterion("rho0").cost(study.space.information(best))
    return study, float(np.log(1.01 * cost))


def ours(m: int, seed: int) -> float:
    """Seconds until one of a few plans, exchanged and refined together, is good enough."""
    study, target = load(m)
    space = study.space
    criterion = study.criterion("rho0")

    class UntilGood(LogCost):
        """Log rho0 that ends the search at a feasible plan that is good enough."""

        def local(self, near: Neighbourhood, start: Indices) -> Local:
            """Value and derivatives, as `LogCost` has them."""
            local = super().local(near, start)
            good = local.value <= target
            if good.any() and space.at(near.x[good]).feasible.all(axis=1).any():
                raise _Reached
            return local

    objective = UntilGood(criterion, np.ones((STARTS, m)))

    def search(seed: int) -> float:
        since = perf_counter()
        with suppress(_Reached):
            for turn in range(MOST_TURNS):
                pool = CandidateSource(space, (seed, turn), workers=1).take(POOL)
                drawn = np.random.default_rng((seed, turn)).integers(0, POOL, (STARTS, m))
                places, _ = exchange(
                    pool.problem, criterion, drawn, shortlists=SHORTLIST, thorough=False
                )
                descend(space, pool.x[places], objective, STEPS)
        return perf_counter() - since

    with threadpool_limits(1):
        for i in range(WARM):
            search(10_000 + i)
        return search(seed)


def _flat(space: DesignSpace, study: Study, m: int, target: float) -> tuple[Function, Function]:
    """Log rho0 and the workspace's slacks, of a flat vector of joint angles, for the other two."""
    criterion = study.criterion("rho0")

    def poses(y: Array) -> Experiments:
        x = np.tile(space.fixed, (m, 1))
        x[:, space.free] = y.reshape(m, -1)
        return space.at(x)

    def slack(y: Array) -> Array:
        return poses(y).slack.ravel()

    def value(y: Array) -> float:
        here = poses(y)
        A = here.regressor.reshape(-1, space.model.p)
        cost = float(criterion.cost(A.T @ A))
        if not np.isfinite(cost):
            return SINGULAR
        if np.log(cost) <= target and here.feasible.all():
            raise _Reached
        return float(np.log(cost))

    return value, slack


def slsqp(m: int, seed: int) -> float:
    """Seconds of SciPy's SLSQP from one random start after the other, by finite differences."""
    study, target = load(m)
    space = study.space
    value, slack = _flat(space, study, m, target)
    bounds = list(zip(*np.tile(space.limits[:, space.free], m), strict=True))
    constraints = [{"type": "ineq", "fun": slack}]

    def descend_from(start: Array, steps: int) -> None:
        options = {"maxiter": steps}
        minimize(
            value, start, method="SLSQP", bounds=bounds, constraints=constraints, options=options
        )

    # The first calls load libraries.
    warm = CandidateSource(space, seed).take(m).x[:, space.free].ravel()
    with suppress(_Reached):
        descend_from(warm, 20)
    with threadpool_limits(1):
        since = perf_counter()
        for turn in range(MOST_TURNS):
            x = CandidateSource(space, (seed, turn), workers=1).take(m).x[:, space.free].ravel()
            try:
                descend_from(x, 150)
            except _Reached:
                break
    return perf_counter() - since


def evolution(m: int, seed: int) -> float:
    """Seconds of SciPy's differential evolution, with its own handling of constraints."""
    study, target = load(m)
    space = study.space
    value, slack = _flat(space, study, m, target)
    bounds = list(zip(*np.tile(space.limits[:, space.free], m), strict=True))
    # The first call loads libraries.
    value(CandidateSource(space, seed).take(m).x[:, space.free].ravel())
    with threadpool_limits(1), suppress(_Reached):
        since = perf_counter()
        differential_evolution(
            value,
            bounds,
            constraints=[NonlinearConstraint(slack, 0.0, np.inf)],
            maxiter=10**6,
            tol=0.0,
            polish=False,
            rng=seed,
        )
    return perf_counter() - since


def shown(runs: list[Measured], limit: float) -> tuple[float, str, str]:
    """Median of runs for a person.

    Returns:
        The median [s], where a run that was cut off counts as its limit; the median with its range,
        as text; and ">= " if the median is cut off.
    """
    seconds = [limit if run.answer is None else run.answer for run in runs]
    middle = median(seconds)
    cut = ">= " if middle >= limit else ""
    return middle, f"{cut}{middle:.3g} ({min(seconds):.3g} .. {max(seconds):.3g})", cut


def _row(m: int, runs: dict[tuple[int, str], list[Measured]]) -> list[object]:
    """Medians of all ways for m experiments, and how many times as long the others take as ours."""
    medians = []
    texts = []
    cuts = []
    for name in WAYS:
        middle, text, cut = shown(runs[m, name], LIMIT_S[name])
        medians.append(middle)
        texts.append(text)
        cuts.append(cut)
    ratios = [f"{cut}{t / medians[0]:.0f}x" for t, cut in zip(medians[1:], cuts[1:], strict=True)]
    return [m, *texts, *ratios]


def _page(rows: list[list[object]]) -> str:
    """The report, as Markdown."""
    seeds = f"{SEEDS['ours']}, {SEEDS['slsqp']} and {SEEDS['evolution']} seeds"
    limits = f"{LIMIT_S['slsqp']:g} s and {LIMIT_S['evolution']:g} s"
    return (
        "# Time until a plan is within 1 % of the best known one\n\n"
        f"rho0 of m poses, KUKA KR 270 example, constraints of the study; {machine()}, one of them "
        f"used. Median (least .. largest) of {seeds}, cut off at {limits}, side by side.\n\n"
        f"{markdown_table(HEADER, rows)}\n"
        f"Ours: {STARTS} plans at a time are exchanged among {POOL} random feasible poses and "
        f"refined by {STEPS} steps, until one is good enough; drawing and exchanging are counted. "
        "SLSQP: scipy's, from random feasible poses, with finite differences of objective and "
        "constraints, the objective and the slacks in our vectorised arithmetic. Differential "
        "evolution: scipy's, with its own handling of constraints. Each in a process of its own "
        "that has done the like before.\n"
    )


WAYS = {"ours": ours, "slsqp": slsqp, "evolution": evolution}
HEADER = (
    "m",
    "ours [s]",
    "SLSQP multi-start [s]",
    "differential evolution [s]",
    "SLSQP / ours",
    "DE / ours",
)


def main() -> None:
    """Measure, and write plan.md."""
    cases = []
    for m in SIZES:
        # Seed by seed, so that a machine that gets slower slows all ways down alike.
        for seed in range(max(SEEDS.values())):
            cases += [(m, name, seed) for name in WAYS if seed < SEEDS[name]]
    runs: dict[tuple[int, str], list[Measured]] = {}
    for m, name, seed in tqdm(cases, file=sys.stderr):
        runs.setdefault((m, name), []).append(measure(WAYS[name], m, seed, limit=LIMIT_S[name]))
    write_text(HERE / "plan.md", _page([_row(m, runs) for m in SIZES]))


if __name__ == "__main__":
    main()
