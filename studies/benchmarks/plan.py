"""Time until a plan is within 1 % of the best known one: ours, SLSQP on finite differences, differential evolution.

`python studies/benchmarks/plan.py` writes plan.md beside this file, in about half an hour. All three minimise
log rho0 of m poses of the paper's example under its constraints, from feasible poses drawn at random, and stop when
they meet a feasible plan that is good enough. They run one after the other on one core, seed by seed.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from measure import Measured, machine, measure
from scipy.optimize import NonlinearConstraint, differential_evolution, minimize
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exchange import exchange
from edtk.design.exact.log_cost import LogCost
from edtk.design.experiments import Experiments
from edtk.design.interior_point.descend import descend
from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.objective import Local
from edtk.report.markdown_table import markdown_table
from edtk.study.study import Study, load_study
from edtk.system.atomic_file import write_text
from edtk.system.typing import Indices

HERE = Path(__file__).parent
STUDY = HERE.parent / "kr270_milling.toml"
BEST = HERE.parents[1] / "paper_figures" / "own_plans"
SIZES = (3, 6, 12)
SEEDS = {"ours": 41, "slsqp": 15, "evolution": 1}
LIMIT_S = {"ours": 100.0, "slsqp": 120.0, "evolution": 60.0}
POOL, STARTS, STEPS, DEAREST = 256, 4, 20, (16,)
WARM = 5  # searches before the one that is timed, which takes milliseconds only


class _Reached(Exception):
    """A plan that is good enough was met."""


def load(m: int) -> tuple[Study, float]:
    """The study, and the log of 1.01 times the best known rho0."""
    study = load_study(STUDY)
    best = study.load_plan(BEST / f"true_m{m}.csv")
    return study, float(np.log(1.01 * study.criterion("rho0").cost(study.space.information(best))))


def ours(m: int, seed: int) -> float:
    """Seconds: a few plans at a time, exchanged among random candidates and refined together, until one is good."""
    study, target = load(m)
    space, criterion = study.space, study.criterion("rho0")
    reached: list[float] = []

    class UntilGood(LogCost):
        """Log rho0 that takes note of a feasible plan that is good enough."""

        def local(self, near: Neighbourhood, start: Indices) -> Local:
            local = super().local(near, start)
            good = local.value <= target
            if good.any() and space.at(near.x[good]).feasible.all(axis=1).any():
                reached.append(target)
            return local

    objective = UntilGood(criterion, np.ones((STARTS, m)))

    def search(seed: int) -> float:
        since = perf_counter()
        reached.clear()
        for turn in range(10_000):
            pool = CandidateSource(space, (seed, turn), workers=1).take(POOL)
            drawn = np.random.default_rng((seed, turn)).integers(0, POOL, (STARTS, m))
            places, _ = exchange(pool.problem, criterion, drawn, dearest=DEAREST, thorough=False)
            descend(space, pool.x[places], objective, STEPS, stop=lambda: bool(reached))
            if reached:
                break
        return perf_counter() - since

    with threadpool_limits(1):
        for i in range(WARM):
            search(10_000 + i)
        return search(seed)


def _flat(space: DesignSpace, study: Study, m: int, target: float) -> tuple[Callable, Callable]:
    """Log rho0 and the workspace's slacks as functions of a flat vector of joint angles, for the other two."""
    criterion = study.criterion("rho0")

    def poses(y: np.ndarray) -> Experiments:
        x = np.tile(space.fixed, (m, 1))
        x[:, space.free] = y.reshape(m, -1)
        return space.at(x)

    def slack(y: np.ndarray) -> np.ndarray:
        return poses(y).slack.ravel()

    def value(y: np.ndarray) -> float:
        here = poses(y)
        A = here.regressor.reshape(-1, space.model.p)
        cost = float(criterion.cost(A.T @ A))
        if not np.isfinite(cost):
            return 1e3
        if np.log(cost) <= target and here.feasible.all():
            raise _Reached
        return float(np.log(cost))

    return value, slack


def slsqp(m: int, seed: int) -> float:
    """Seconds: scipy's SLSQP from one random start after the other, derivatives by finite differences."""
    study, target = load(m)
    space = study.space
    value, slack = _flat(space, study, m, target)
    bounds = list(zip(*np.tile(space.limits[:, space.free], m), strict=True))
    constraints = [{"type": "ineq", "fun": slack}]
    warm = (
        CandidateSource(space, seed).take(m).x[:, space.free].ravel()
    )  # first calls load libraries
    with suppress(_Reached):
        minimize(
            value,
            warm,
            method="SLSQP",
            bounds=bounds,
            constraints=constraints,
            options={"maxiter": 20},
        )
    with threadpool_limits(1):
        since = perf_counter()
        for turn in range(10_000):
            x = CandidateSource(space, (seed, turn), workers=1).take(m).x[:, space.free].ravel()
            try:
                minimize(
                    value,
                    x,
                    method="SLSQP",
                    bounds=bounds,
                    constraints=constraints,
                    options={"maxiter": 150},
                )
            except _Reached:
                break
    return perf_counter() - since


def evolution(m: int, seed: int) -> float:
    """Seconds: scipy's differential evolution with its own handling of constraints."""
    study, target = load(m)
    space = study.space
    value, slack = _flat(space, study, m, target)
    bounds = list(zip(*np.tile(space.limits[:, space.free], m), strict=True))
    value(
        CandidateSource(space, seed).take(m).x[:, space.free].ravel()
    )  # first calls load libraries
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
    """Median [s], a run that was cut off counting as its limit; how a person reads it; and ">= " if it is cut off."""
    seconds = [limit if run.answer is None else run.answer for run in runs]
    middle = median(seconds)
    cut = ">= " if middle >= limit else ""
    return middle, f"{cut}{middle:.3g} ({min(seconds):.3g} .. {max(seconds):.3g})", cut


def main() -> None:
    """Measure, and write plan.md."""
    ways = {"ours": ours, "slsqp": slsqp, "evolution": evolution}
    cases = [
        (m, name, s)
        for m in SIZES
        for s in range(max(SEEDS.values()))
        for name in ways
        if s < SEEDS[name]
    ]
    runs: dict[tuple[int, str], list[Measured]] = {}
    for m, name, seed in tqdm(cases, file=sys.stderr):
        runs.setdefault((m, name), []).append(measure(ways[name], m, seed, limit=LIMIT_S[name]))
    rows = []
    for m in SIZES:
        medians, texts, cuts = zip(
            *(shown(runs[m, name], LIMIT_S[name]) for name in ways), strict=True
        )
        ratios = [
            f"{cut}{t / medians[0]:.0f}x" for t, cut in zip(medians[1:], cuts[1:], strict=True)
        ]
        rows.append([m, *texts, *ratios])
    header = [
        "m",
        "ours [s]",
        "SLSQP multi-start [s]",
        "differential evolution [s]",
        "SLSQP / ours",
        "DE / ours",
    ]
    text = (
        f"# Time until a plan is within 1 % of the best known one\n\n"
        f"rho0 of m poses, KUKA KR 270 example, constraints of the study; {machine()}, one of them used. Median "
        f"(least .. largest) of {SEEDS['ours']}, {SEEDS['slsqp']} and {SEEDS['evolution']} seeds, cut off at "
        f"{LIMIT_S['slsqp']:g} s and {LIMIT_S['evolution']:g} s, side by side.\n\n{markdown_table(header, rows)}\n"
        f"Ours: {STARTS} plans at a time are exchanged among {POOL} random feasible poses and refined by {STEPS} "
        f"steps, until one is good enough; drawing and exchanging are counted. SLSQP: scipy's, from random feasible "
        f"poses, with finite differences of objective and constraints, the objective and the slacks in our vectorised "
        f"arithmetic. Differential evolution: scipy's, with its own handling of constraints. Each in a process of its "
        f"own that has done the like before.\n"
    )
    write_text(HERE / "plan.md", text)


if __name__ == "__main__":
    main()
