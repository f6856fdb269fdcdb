"""The search for the best plan of exactly m experiments: batches of starts, on every core, until nothing new comes."""

from collections.abc import Callable
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.batch import SIZE, Batch
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.refine import refine
from edtk.design.exact.starts import Starts
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.workers import Workers

Array = NDArray[np.float64]
Progress = Callable[[int, float], object]
PATIENCE = 6  # batches without improvement after which the search has stagnated
STARTS = 64 * SIZE
FINEST, SHARPEST = 100, (1000.0, 4000.0)  # steps and soft maxima of the last descent
GAIN = 1e-4  # relative improvement that counts
DRAWN, REGULAR = (
    4000,
    1e-7,
)  # random poses, and least eigenvalue beside that of their mean, see `smallest_size`
SAME = 1e-3  # relative difference of information below which two plans are the same


class TooFewError(ValueError):
    """More experiments, or more places, are needed to identify all parameters.

    Attributes:
        least: The smallest number that can.
    """

    def __init__(self, what: str, p: int, least: int) -> None:
        super().__init__(f"{what} cannot identify {p} parameters; the smallest number is {least}")
        self.least = least


def find_plan(
    relaxed: RelaxedPlan,
    m: int,
    k: int | None = None,
    seed: int = 0,
    kept: Plan | None = None,
    starts: int = STARTS,
    patience: int = PATIENCE,
    seconds: float = np.inf,
    workers: Workers = Workers(),  # noqa: B008, frozen
    progress: Progress = lambda starts, cost: None,
) -> ExactPlan:
    """Search for the best plan of m new experiments.

    Batches of starts are judged in the order of their numbers, and each depends on the seed and its number alone, so
    that the plan depends on neither the team nor its speed, unless the time is over first.

    Args:
        relaxed: The relaxation of the same design and criterion, with its bound.
        m: Number of new experiments.
        k: Number of distinct poses at most; None for p(p+1)/2 + 1, as the best weights need no more.
        seed: Seed.
        kept: Experiments that are there already; the relaxation's design counts their information as shared.
        starts: Limit on the number of starts; rounded up to whole batches.
        patience: Batches without an improvement of 1e-4 after which the search ends.
        seconds: After which to return the best plan so far.
        workers: Who does the work.
        progress: Called with the number of starts so far and the best cost.

    Returns:
        The best plan found, feasible; a pose that occurs several times is one with repetitions.

    Raises:
        TooFewError: So few experiments cannot identify all parameters.
        WorkersLostError: The team has gone away.
    """
    since = monotonic()
    space, criterion = relaxed.space, relaxed.criterion
    places = min(m, space.model.p * (space.model.p + 1) // 2 + 1) if k is None else k
    require_enough(space, m, places)
    record = _Record(space)

    def batch(i: int) -> Batch:
        return Batch(
            space, criterion, m, places, relaxed.x, relaxed.weights, (seed, m, places, i), left()
        )

    def left() -> float:
        return since + seconds - monotonic()

    try:
        ended = _search(batch, -(-starts // SIZE), patience, left, workers, record, progress)
    except KeyboardInterrupt:
        if not record.costs:
            raise
        ended = "interrupted"
    x, repeats = _tidy(space, criterion, record.best, record.cost)
    plan = space.plan(x, repeats.astype(int))
    cost = float(criterion.cost(space.information(plan)))
    found, optima = record.census()
    return ExactPlan(
        relaxed, plan, kept, cost, record.batches * SIZE, found, optima, monotonic() - since, ended
    )


def _search(
    batch: Callable[[int], Batch],
    most: int,
    patience: int,
    left: Callable[[], float],
    workers: Workers,
    record: "_Record",
    progress: Progress,
) -> str:
    """Enter batches into the record, as many at a time as the team does at once, and say why it ended."""
    while record.batches < most:
        wave = [batch(i) for i in range(record.batches, min(record.batches + workers.size, most))]
        for _, answer in sorted(workers.run(wave), key=lambda done: done[0]):
            record.enter(*answer)
            progress(record.batches * SIZE, record.cost)
            if record.idle >= patience:
                return "stagnation"
        if left() <= 0:
            return "budget"
    return "starts"


def require_enough(space: DesignSpace, m: int, places: int) -> None:
    """Check that m experiments at so many places can identify all parameters.

    Raises:
        TooFewError: They cannot; says how many can.
    """
    least = smallest_size(space)
    for number, what in ((m, "experiment"), (places, "distinct pose")):
        if number < least:
            raise TooFewError(f"{number} {what}{'s' if number > 1 else ''}", space.model.p, least)


def smallest_size(space: DesignSpace) -> int:
    """The least number of experiments whose information is regular, each taken for the most that it adds.

    What is taken, of random poses, has the largest determinant beside those that are there, of rank first; a pose that
    adds a direction is not passed over, and p of them have them all.

    Raises:
        RankDeficientError: No number of experiments can identify all parameters.
    """
    problem = CandidateSource(space, 0, workers=1).take(DRAWN).problem
    problem.require_identifiable()
    p = space.model.p
    T = whitener(problem.mean)
    blocks = T.T @ problem.blocks() @ T
    M = 1e-9 * np.eye(p)
    for size in range(1, p + 1):
        M = M + blocks[int(np.linalg.slogdet(M + blocks).logabsdet.argmax())]
        if np.linalg.eigvalsh(M)[0] > REGULAR:
            return size
    return p


class _Record:
    """The best plan so far, and all that were refined to the end."""

    def __init__(self, space: DesignSpace) -> None:
        self.space = space
        self.cost, self.idle, self.batches = np.inf, 0, 0
        self.best: Starts
        self.costs: list[float] = []
        self.M: list[Array] = []

    def enter(self, costs: Array, plans: Starts) -> None:
        """Count the answer of one batch, the best plan first."""
        self.batches += 1
        gained = not self.costs or costs[0] < self.cost * (1 - GAIN)
        self.idle = 0 if gained else self.idle + 1
        if not self.costs or costs[0] < self.cost:
            self.cost, self.best = float(costs[0]), plans[np.array([0])]
        self.costs += costs.tolist()
        self.M += list(self.space.at(plans.x).information(plans.repeats))

    def census(self) -> tuple[int, int]:
        """How often the best plan was found, and how many different ones."""
        order = np.argsort(self.costs, kind="stable")
        M = np.array(self.M)[order]
        if not np.isfinite(self.cost):
            return 0, 0
        T = whitener(M[0])
        same = np.linalg.norm(T.T @ (M - M[0]) @ T, axis=(1, 2)) <= SAME * np.sqrt(len(T))
        return int(same.sum()), len(distinct(M, T, SAME))


def _tidy(
    space: DesignSpace, criterion: Criterion, best: Starts, cost: float
) -> tuple[Array, Array]:
    """Design variables (k, v) and repetitions (k,) of a plan without idle places and equal poses.

    Poses of like information become one, where that costs next to nothing; what remains is refined once more.
    The most repeated pose comes first, then by joint variables.
    """
    used = best.repeats[0] > 0
    x, repeats = best.x[0, used], best.repeats[0, used].astype(float)
    for alike in (0.03, 0.003, 1e-4):
        M = space.problem(x).blocks()
        kept = distinct(M, whitener(M.mean(axis=0)), alike)
        if len(kept) == len(x):
            continue
        T = whitener(np.tensordot(repeats, M, 1))
        W = (T.T @ M @ T).reshape(len(M), -1)
        owner = np.linalg.norm(W[:, None] - W[kept], axis=-1).argmin(axis=1)
        fewer = np.bincount(owner, weights=repeats).astype(float)
        moved, costs = refine(space, criterion, x[kept][None], fewer[None])
        if costs[0] <= cost * (1 + 1e-6):
            x, repeats, cost = moved[0], fewer, float(costs[0])
            break
    x = refine(space, criterion, x[None], repeats[None], FINEST, SHARPEST)[0][0]
    order = np.lexsort((*np.round(x.T[::-1], 9), -repeats))
    return x[order], repeats[order]
