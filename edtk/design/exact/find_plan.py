"""The search for the best plan of exactly m experiments, on every core."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import monotonic, process_time

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import Candidates, CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.exact.apportion import apportion
from edtk.design.exact.exact_plan import ExactPlan, FoundPlan, require_enough
from edtk.design.exact.refine import draw_starts, exchange_and_refine, refine, tidy
from edtk.design.exact.round_poses import round_poses
from edtk.design.exact.search_record import (
    CHAMPIONS,
    COARSE,
    FINE,
    SAME_PLAN,
    Answer,
    Descent,
    Kicks,
    Plans,
    Search,
    SearchRecord,
)
from edtk.design.exact.spread import divided, spread
from edtk.design.information import distinct
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.time_limit import no_progress, out_of_time, time_left, time_limit
from edtk.system.typing import Array
from edtk.system.workers import Workers, one_thread

BATCH_SIZE = 16  # starts
# Plans that are refined to the end. On the paper's study (rho0, D and O2; 3 to 12 experiments) the
# final best was the best of the coarse descent in half of 36 batches, and its fourth in a tenth.
ELITE = 4
POOL_OF_BATCH = 256  # fresh candidates for the starts, and for each exchange
STARTS = 64 * BATCH_SIZE
PATIENCE = 6  # batches without improvement; about a hundred starts
# Variables of a plan in all batches that are done together. Of small plans that is as many batches
# as every search needs; more variables leave nothing to gain, and take memory.
VARIABLES_TOGETHER = 420
INEQUALITIES = 100_000  # of the plans of all batches that are done together: memory, as above
# Of the time, at most, that batches may take. The rest brings the best plan of a search that was
# cut off to its optimum: on the way there the barrier keeps poses and loads off their limits.
SHARE_OF_BATCHES = 0.8
KICKED = 2**31  # number of the kicks among the batches, for their random numbers


@dataclass(frozen=True, eq=False)
class Batch:
    """A piece of work whose answer depends on its attributes alone, wherever it is done.

    Attributes:
        space: Model and feasible set.
        criterion: The criterion to minimise.
        m: Number of experiments.
        places: Number of distinct poses at most.
        support: Design variables (s, v) of the relaxed design.
        weights: Their weights (s,).
        seed: Seed of this batch.
    """

    space: DesignSpace
    criterion: Criterion
    m: int
    places: int
    support: Array
    weights: Array
    seed: tuple[int, ...]

    def search(self) -> Search:
        """Refine starts coarsely, the elite finely, then exchange and refine it in turn.

        Descents are asked for, so that whoever runs several batches can do theirs together.

        Yields:
            Descents; costs and plans at their ends are sent back.

        Returns:
            Costs (e,) of the plans that were refined to the end, the best first, and the plans.
        """
        costs, plans = yield Descent(self._starts(), COARSE)
        costs, plans = yield Descent(self._elite(costs, plans), FINE)
        return (
            yield from exchange_and_refine(self.space, self.criterion, (costs, plans), self._fresh)
        )

    def _starts(self) -> Plans:
        """The plans from which this batch starts."""
        support = Candidates(self.support, self.space.problem(self.support))
        return draw_starts(
            self.criterion,
            self.m,
            self.places,
            support,
            self.weights,
            self._fresh(0),
            BATCH_SIZE,
            self.seed,
        )

    def _elite(self, costs: Array, plans: Plans) -> Plans:
        """The best plans that differ from each other; the first one where all are singular."""
        order = np.argsort(costs, kind="stable")
        order = order[np.isfinite(costs[order])]
        if not len(order):
            return plans[np.array([0])]
        best_first = plans[order]
        M = best_first.information(self.space)
        return best_first[distinct(M, range_whitener(M[0]), SAME_PLAN)[:ELITE]]

    def _fresh(self, turn: int) -> Candidates:
        """Feasible candidates that no other batch has."""
        return CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL_OF_BATCH)


@dataclass(frozen=True, eq=False)
class Batches:
    """A piece of work whose answer depends on its batches alone, wherever it is done.

    A step of a descent is some hundred array operations, which take as long for a few small plans
    as for many. The batches therefore take their steps together. What a plan comes to does not
    depend on its company: no operation mixes plans.

    Attributes:
        batches: The batches, or the kicks that end a search, of one design space and criterion,
            with plans of one shape.
        seconds: Time [s] from the call after which the best plans so far are returned.
    """

    batches: tuple[Batch | Kicks, ...]
    seconds: float = np.inf

    def __call__(self) -> list[Answer]:
        """The answer of each batch: costs (e,) of plans, the best first, and the plans."""
        # The rounding of a product may depend on the number of threads, and so would the plan.
        with one_thread(), time_limit(self.seconds):
            return self._run()

    def _run(self) -> list[Answer]:
        """Do the descents that the batches ask for, until each has its answer."""
        searches = [batch.search() for batch in self.batches]
        answers: dict[int, Answer] = {}
        asked: dict[int, Descent] = {}

        def go_on(i: int, end: Answer | None) -> None:
            try:
                # A generator begins where None is sent.
                asked[i] = searches[i].send(end)  # type: ignore[arg-type]
            except StopIteration as done:
                answers[i] = done.value

        for i in range(len(searches)):
            go_on(i, None)
        while asked:
            # Batches go through the same stages, so that this is all of them most of the time.
            effort = next(iter(asked.values())).effort
            now = [i for i, descent in asked.items() if descent.effort == effort]
            ends = self._refined([asked.pop(i) for i in now])
            for i, end in zip(now, ends, strict=True):
                go_on(i, end)
        return [answers[i] for i in range(len(searches))]

    def _refined(self, descents: Sequence[Descent]) -> list[Answer]:
        """Costs and plans after descents of the same effort."""
        first = self.batches[0]
        x = np.concatenate([descent.plans.x for descent in descents])
        repeats = np.concatenate([descent.plans.repeats for descent in descents])
        effort = descents[0].effort
        x, costs = refine(
            first.space, first.criterion, x, repeats, effort.iterations, effort.sharpness
        )
        ends = np.cumsum([len(descent.plans.x) for descent in descents])[:-1]
        parts = zip(np.split(costs, ends), np.split(x, ends), np.split(repeats, ends), strict=True)
        return [(own, Plans(places, times)) for own, places, times in parts]


Progress = Callable[[int, float], object]


@dataclass(frozen=True)
class SearchOptions:
    """How a search for an exact plan is done; seed, starts and patience alone decide the plan.

    Attributes:
        seed: Seed.
        starts: Limit on the number of starts; rounded up to whole batches of 16.
        patience: Batches without an improvement of 1e-4 after which the search ends.
        seconds: Time [s] after which the best plan so far is returned; one piece of work, of one
            batch or a few small ones, is begun at least.
        workers: Workers for the pieces.
        alone: Time [s] of the processor, which other work does not change, for which batches are
            done in this process before others of this machine are started, which takes longer than
            many a search; and least time that is left then.
        progress: Called with the number of starts so far and the best cost.
    """

    seed: int = 0
    starts: int = STARTS
    patience: int = PATIENCE
    seconds: float = np.inf
    workers: Workers = field(default_factory=Workers)
    alone: float = 0.0
    progress: Progress = no_progress


DEFAULTS = SearchOptions()


def find_plan(
    relaxed: RelaxedPlan,
    m: int,
    places: int | None = None,
    kept: Plan | None = None,
    options: SearchOptions = DEFAULTS,
) -> ExactPlan:
    """Search for the best plan of m new experiments.

    Batches of starts are entered in the order of their numbers, and each depends on the seed and
    its number alone. The plan therefore depends neither on the number of workers nor on their
    speed, unless the time runs out first.

    Where visits of a pose share its discrepancy, poses keep apart from each other and from kept
    ones, see `spread`. If nobody limits the number of poses, repeats are searched for as if they
    shared nothing, and then become poses of their own.

    Args:
        relaxed: The relaxation of the same design space and criterion, with its bound.
        m: Number of new experiments.
        places: Number of distinct poses at most; defaults to p(p+1)/2 + 1, which is enough.
        kept: Experiments that exist already. Their information is the prior of the relaxation's
            design space, see `DesignSpace.with_kept`.
        options: Seed, limits and workers of the search.

    Returns:
        The best plan found, feasible; a pose that occurs several times is one with repetitions.

    Raises:
        TooFewExperimentsError: So few experiments or poses cannot identify all parameters.
        WorkersLostError: The workers have gone away.
    """
    since = monotonic()
    with time_limit(options.seconds):
        found = search_plan(relaxed, m, places, kept, options)
    # The poses of the plan are no candidates, and the bound has to hold for them, too.
    relaxed = relaxed.holding_for(found.x)
    return replace(ExactPlan.of(relaxed, found, kept), seconds=monotonic() - since)


def search_plan(
    relaxed: RelaxedPlan, m: int, places: int | None, kept: Plan | None, options: SearchOptions
) -> FoundPlan:
    """The search of `find_plan`, within the time that is left."""
    space = relaxed.space
    searched = space.alone if places is None else space
    if places is None:
        # The information of any weights is that of weights on so many poses (Caratheodory).
        places = min(m, space.p * (space.p + 1) // 2 + 1)
    if not _rounds_well(relaxed, m, places):
        require_enough(space, m, places, relaxed.criterion)
    search = _Search(relaxed, searched, m, places, options)
    record = SearchRecord(searched)
    try:
        with time_limit(SHARE_OF_BATCHES * time_left()):
            ended = search.run(record)
            if ended != "budget":
                search.kick(record)
    except KeyboardInterrupt:
        ended = "interrupted"
    with time_limit(0.0 if ended == "interrupted" else np.inf):
        if record.empty:
            search.run(record)
        if ended == "budget":
            best = record.best
            x, costs = refine(searched, relaxed.criterion, best.x, best.repeats)
            record.improve(costs, Plans(x, best.repeats))
        # An interrupted search has a best plan all the same, which is tidied like any other.
        x, repeats = _tidied(relaxed, searched, record, kept)
    # The cost is that of the plan as it is written, whatever the search believed.
    plan = space.plan(x, repeats.astype(int))
    cost = space.cost(relaxed.criterion, plan, kept)
    found, optima = record.census()
    starts = record.batches * BATCH_SIZE
    return FoundPlan(x, repeats.astype(int), cost, starts, found, optima, ended)


def _rounds_well(relaxed: RelaxedPlan, m: int, places: int) -> bool:
    """Whether the rounded weights are a plan already that tells a part of the parameters.

    Few poses may tell it, if they are the right ones: poses at random then need more.
    """
    criterion = relaxed.criterion
    if criterion.needs_all:
        return False
    heaviest = np.argsort(-relaxed.weights, kind="stable")[:places]
    repeats = apportion(relaxed.weights[heaviest], m).astype(float)
    # A pose that isolates a parameter does so only where it is rounded to whole steps.
    x, repeats = round_poses(relaxed.space, criterion, relaxed.x[heaviest], repeats)
    return bool(np.isfinite(criterion.cost(relaxed.space.problem(x).information(repeats))))


def _tidied(
    relaxed: RelaxedPlan, searched: DesignSpace, record: SearchRecord, kept: Plan | None
) -> tuple[Array, Array]:
    """Design variables and repetitions of the best plan of a record, on as few poses as needed."""
    x, repeats = tidy(searched, relaxed.criterion, record.best, record.cost)
    space = relaxed.space
    if space.shares_errors:
        if searched is not space:
            x, repeats = divided(x, repeats)
        x = spread(space, relaxed.criterion, x, repeats, kept)
    return x, repeats


@dataclass(frozen=True, eq=False)
class _Search:
    """A search, ready to run.

    Attributes:
        relaxed: The relaxation.
        space: Its design space, perhaps without what repeats share.
        m: Number of new experiments.
        places: Number of distinct poses at most.
        options: Seed, limits and workers.
    """

    relaxed: RelaxedPlan
    space: DesignSpace
    m: int
    places: int
    options: SearchOptions

    def run(self, record: SearchRecord) -> str:
        """Enter batches into the record, a wave of one for each worker at a time.

        Returns:
            Why the search ended: "stagnation", "budget" or "starts".
        """
        options = self.options
        most = -(-options.starts // BATCH_SIZE)
        since = process_time()
        while record.batches < most:
            workers = self._workers(record, process_time() - since)
            wave = self._wave(record, workers.size, most)
            # The whole wave is awaited: entered as they come, batches would depend on speed.
            for _, answers in sorted(workers.run(wave), key=lambda done: done[0]):
                for answer in answers:
                    record.enter(*answer)
                    options.progress(record.batches * BATCH_SIZE, record.cost)
                    if record.idle >= options.patience:
                        # Batches without time go nowhere.
                        return "budget" if out_of_time() else "stagnation"
            if out_of_time():
                return "budget"
        return "starts"

    def kick(self, record: SearchRecord) -> None:
        """Kick the best plans out of their optima, if they are small enough for that to pay."""
        costs, plans = record.champions(CHAMPIONS)
        if (
            not len(costs)
            or self._variables > VARIABLES_TOGETHER
            or self._inequalities > INEQUALITIES
        ):
            return
        x = record.plans.x
        kicks = Kicks(
            space=self.space,
            criterion=self.relaxed.criterion,
            best=(costs, plans),
            known=x.reshape(-1, x.shape[-1]),
            seed=(self.options.seed, self.m, self.places, KICKED),
        )
        ((_, answers),) = Workers().run([Batches((kicks,), time_left())])
        record.improve(*answers[0])

    @property
    def _variables(self) -> int:
        """Number of variables of a plan."""
        return self.places * max(1, len(self.space.movable))

    @property
    def _inequalities(self) -> int:
        """Number of inequalities of the plans of a batch."""
        return BATCH_SIZE * self.places * max(1, len(self.space.workspace.inequalities))

    def _workers(self, record: SearchRecord, spent: float) -> Workers:
        """Who does the next batches, after so much time [s] of this processor.

        Others are started once the search has taken long enough, if what is left to do, as far as
        one knows, takes as long again.
        """
        options = self.options
        ahead = spent / max(1, record.batches) * self._left(record)
        early = not options.workers.remote and min(spent, ahead) < options.alone
        return Workers() if early else options.workers

    def _left(self, record: SearchRecord) -> int:
        """Number of batches before which the search does not end."""
        return self.options.patience - record.idle + (1 if record.empty else 0)

    def _wave(self, record: SearchRecord, pieces: int, most: int) -> list[Batches]:
        """So many pieces of work, from the next batch on, each of several batches."""
        size = min(VARIABLES_TOGETHER // self._variables, INEQUALITIES // self._inequalities)
        # Batches beyond these may be in vain.
        first = record.batches
        left = self._left(record)
        size = max(1, min(size, -(-left // pieces)))
        if np.isfinite(time_left()):
            # What is not done when the time is over is lost: as much at most as is done already.
            size = min(size, max(1, first // pieces))
        last = min(first + pieces * size, most)
        firsts = range(first, last, size)
        return [
            Batches(tuple(map(self._batch, range(i, min(i + size, last)))), time_left())
            for i in firsts
        ]

    def _batch(self, number: int) -> Batch:
        relaxed = self.relaxed
        return Batch(
            space=self.space,
            criterion=relaxed.criterion,
            m=self.m,
            places=self.places,
            support=relaxed.x,
            weights=relaxed.weights,
            seed=(self.options.seed, self.m, self.places, number),
        )
