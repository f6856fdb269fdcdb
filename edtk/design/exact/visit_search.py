"""The search for the best visits: exchange among good poses, then all joints together."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from criteria import Criterion
from edtk.design.candidate_source import Candidates
from edtk.design.design_space import DesignSpace, plan_costs
from edtk.design.exact.apportion import apportion
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.exact_plan import FoundPlan
from edtk.design.exact.exchange import exchange
from edtk.design.exact.refine import exchange_in_turn, refine, tidy
from edtk.design.exact.search_record import Plans
from edtk.design.exact.spread import divided, spread
from edtk.design.plan import Plan
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.settle import FEW_PARAMETERS
from edtk.system.errors import UserError
from edtk.system.time_limit import no_progress, out_of_time, time_left, time_limit
from edtk.system.typing import Array, Indices
from edtk.system.workers import THIS_PROCESS, Workers

VISIT_STARTS = 8
# Plans that are refined: the best of the starts is best at the end in half of the cases.
ELITE_VISITS = 3
SENSITIVE = 300  # candidates of largest sensitivity among which places are exchanged
# Of refinement, with an exchange between them; the third one seldom finds anything.
VISIT_ROUNDS = 3
DESCENT_STEPS = 30  # of a descent: what is left after them is below 1e-3
SHARPNESS = (250.0,)  # of the soft maximum that stands for a criterion with kinks
GAIN_OF_ROUND = 1e-4  # relative improvement for which another round is made
SAME_VISITS = 1e-6  # relative difference of costs up to which two plans are one
WEIGHTY = 0.5  # part of the starts that are drawn by the weights of the relaxation
# Time [s] of a relaxation whose search is long enough for other processes of this machine, each of
# which takes a second to load what it needs.
LONG_RELAXATION = 2.0
# Share of the time, where there is a limit, after which visits that share an error of the model are
# moved apart: some 50 ms a visit of 35 parameters. Tuned on 30 and 100 visits on a KUKA KR 270
# within 5 to 20 s, whose rho0 is a third worse where no time is left for it.
SHARE_UNTIL_SPREAD = 0.5
SEED = 2  # the stream of random numbers that starts come from

# Starts, how many of the best plans are the same, different ones, and why the search ended.
_Ending = tuple[int, int, int, str]
_Best = tuple[Array, Array, _Ending]  # one plan (k, v), its repetitions (k,), and how it was found


@dataclass(frozen=True, eq=False)
class VisitSearch:
    """A search for the best visits in a space of many parameters.

    Places are exchanged among the poses of the relaxation and the candidates of largest
    sensitivity. Then all joints of a plan move together to an optimum nearby (`refine`), places
    are exchanged again, and so on. Poses are rounded to the steps of the controller at the end.

    Attributes:
        space: Where visits may lie, each counted as one (`prices` None), with what is known
            besides as its prior.
        relaxed: A relaxation of the same space and criterion, whatever a visit costs there.
        criterion: What is minimised.
        seed: Seed.
        progress: Called with a label and the best cost.
        starts: Number of starts.
        workers: The processes that improve plans side by side; the plan does not depend on them.
        kept: Visits that were made already; None for none.
        repeated: Whether a pose may be visited again where that is no better than another pose.
    """

    space: DesignSpace
    relaxed: RelaxedPlan
    criterion: Criterion
    seed: int
    progress: Callable[[str, float], object]
    starts: int = VISIT_STARTS
    workers: Workers = THIS_PROCESS
    kept: Plan | None = None
    repeated: bool = False

    def of_size(self, m: int, distinct: int | None = None) -> FoundPlan:
        """The best plan of m visits, whatever each costs.

        Args:
            m: Number of visits.
            distinct: Number of different visits at most; a pose without a load and under it are
                two. Defaults to any.
        """
        if distinct is not None and not self.repeated:
            return replace(self, repeated=True).of_size(m, distinct)
        with self._until_spread():
            pool, weights = self._pool()
            rng = np.random.default_rng((self.seed, SEED))
            k = m if distinct is None else min(m, distinct)
            starts = self._starts(rng, weights, k)
            if out_of_time():
                starts = starts[:1]
            even = np.tile(apportion(np.ones(k), m).astype(float), (len(starts), 1))
            places, repeats, costs = self._each("_exchanged", starts, even, pool=pool)
            elite = np.argsort(costs, kind="stable")[:ELITE_VISITS]
            self.progress(_counted(len(starts)), float(costs[elite[0]]))
            found = self._finished(pool.x[places[elite]], repeats[elite], pool, len(starts))
        return self._spread(found)

    def within(
        self, prices: Array, funds: float, m: int, sized: bool, distinct: int | None = None
    ) -> FoundPlan | None:
        """The best plan whose visits cost no more than some funds.

        Args:
            prices: What a visit costs under each load (s,).
            funds: What all may cost together.
            m: Number of visits, or the largest.
            sized: Whether it is that number.
            distinct: Different visits at most; those whose loss costs least are left out one by
                one, and the funds shared out among the others anew. Defaults to any.

        Returns:
            The plan; None where so few different visits tell too little.
        """
        if distinct is not None and not self.repeated:
            return replace(self, repeated=True).within(prices, funds, m, sized, distinct)
        pool, _ = self._pool()
        problem = pool.problem
        base = np.zeros((problem.p, problem.p))
        if problem.prior is not None:
            base = problem.prior * self.space.sharing
        limits = Limits(m, base, None, prices[self.space.load_of(pool.x)], funds, sized)
        plain = problem.with_prior(None)
        nothing = np.zeros(problem.n, dtype=int)
        starts = self.starts if problem.p <= FEW_PARAMETERS else 1
        found = self._best_counts(plain, limits, nothing, starts)
        self.progress(_counted(starts), found.cost)
        chosen = found.support
        repeats = found.counts[chosen].astype(float)
        while distinct is not None and len(chosen) > distinct:
            fewer = self._with_one_fewer(plain, limits, chosen, starts)
            if fewer is None:
                return None
            chosen, repeats = fewer
        finishing = self
        if problem.prior is not None:
            # Only now the number of visits is known that share what is known besides.
            shared = replace(self.space, prior=base / repeats.sum(), sharing=int(repeats.sum()))
            finishing = replace(self, space=shared)
        with self._until_spread():
            best = finishing._finished(pool.x[chosen][None], repeats[None], None, starts)
        return finishing._spread(best)

    def _with_one_fewer(
        self, problem: Problem, limits: Limits, chosen: Indices, starts: int
    ) -> tuple[Indices, Array] | None:
        """The best of the plans of all but one of some candidates, and how often each is made.

        None where so few candidates tell too little.
        """
        best: tuple[float, Indices, Array] | None = None
        for i in range(len(chosen)):
            rest = np.delete(chosen, i)
            own = None if limits.costs is None else limits.costs[rest]
            nothing = np.zeros(len(rest), dtype=int)
            try:
                found = self._best_counts(
                    problem[rest], replace(limits, costs=own), nothing, starts
                )
            except (RankDeficientError, UserError):
                continue
            if np.isfinite(found.cost) and (best is None or found.cost < best[0]):
                kept = found.support
                best = (found.cost, rest[kept], found.counts[kept].astype(float))
            if best is not None and out_of_time():
                break
        return None if best is None else (best[1], best[2])

    def _best_counts(
        self, problem: Problem, limits: Limits, nothing: Indices, starts: int
    ) -> ProblemPlan:
        """The best counts of some candidates.

        Raises:
            KeyboardInterrupt: Ctrl-C, which leaves counts but must not be passed over.
        """
        found = find_counts(
            problem,
            self.criterion,
            limits,
            nothing,
            seed=self.seed,
            starts=starts,
            thorough=problem.p <= FEW_PARAMETERS,
        )
        if found.ended == "interrupted":
            raise KeyboardInterrupt
        return found

    @property
    def _shares(self) -> bool:
        """Whether visits near each other share an error."""
        return self.space.shares_errors

    def _until_spread(self) -> AbstractContextManager[object]:
        """Leave time to move visits apart, where they share an error."""
        return time_limit((SHARE_UNTIL_SPREAD if self._shares else 1.0) * time_left())

    def _pool(self) -> tuple[Candidates, Array]:
        """Visits among which places are exchanged, and the weights (n,) of the relaxation."""
        head = self.relaxed.source.take(self.relaxed.candidates, in_time=True)
        sensitivities = normalised(head.problem, self.criterion).sensitivities(
            self.relaxed.multipliers
        )
        order = np.argsort(-sensitivities.max(axis=0), kind="stable")[:SENSITIVE]
        x = np.concatenate([self.relaxed.x, head.x[order]])
        weights = np.concatenate([self.relaxed.weights, np.zeros(len(order))])
        return Candidates(x, self.space.problem(x)), weights

    def _starts(self, rng: np.random.Generator, weights: Array, m: int) -> Indices:
        """Places (starts, k) to start from: the best weights, drawn by weight, and at random."""
        n = len(weights)
        drawn = [np.repeat(np.arange(n), apportion(weights, m))]
        for i in range(1, self.starts):
            by_weight = i < WEIGHTY * self.starts
            drawn.append(rng.choice(n, m, p=weights / weights.sum() if by_weight else None))
        return np.array(drawn)

    def _finished(self, x: Array, repeats: Array, pool: Candidates | None, starts: int) -> _Best:
        """The best of some plans (b, k) after refinement, in poses that a controller takes."""
        ended = "starts"
        costs = plan_costs(self.criterion, self.space.at(x), repeats)
        try:
            for turn in range(VISIT_ROUNDS):
                if out_of_time():
                    ended = "budget"
                    break
                x, reached = self._each("_refined", x, repeats)
                gained = bool((reached < costs * (1 - GAIN_OF_ROUND)).any())
                costs = reached
                self.progress("refine", float(costs.min()))
                if pool is None or not gained or turn == VISIT_ROUNDS - 1:
                    break
                visits = x.reshape(-1, x.shape[-1])
                both = Candidates(visits, self.space.problem(visits)) + pool
                places = np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])
                places, repeats, _ = self._each("_exchanged", places, repeats, pool=both)
                x = both.x[places]
        except KeyboardInterrupt:
            ended = "interrupted"
        best = int(np.argmin(costs))
        alike = np.unique(np.floor(np.log(costs[np.isfinite(costs)]) / SAME_VISITS))
        same = int((costs <= costs[best] * (1 + SAME_VISITS)).sum())
        with time_limit(0.0 if ended == "interrupted" else np.inf):
            plan = Plans(x[best : best + 1], repeats[best : best + 1])
            tidied = tidy(self.space, self.criterion, plan, float(costs[best]))
        return *tidied, (starts, same, len(alike), ended)

    def _each(self, method: str, *plans: Any, **options: Any) -> tuple[Array, ...]:
        """What a method of this search makes of plans (b, ...), side by side on several workers."""
        is_long = self.workers.remote or sum(self.relaxed.seconds.values()) >= LONG_RELAXATION
        if self.workers.size == 1 or not is_long:
            return _improved(self, method, *plans, **options)
        # What is seen here goes to no other process.
        alone = replace(self, progress=no_progress, workers=THIS_PROCESS)
        pieces = [
            partial(_improved, alone, method, *(one[[i]] for one in plans), **options)
            for i in range(len(plans[0]))
        ]
        answers = sorted(self.workers.run(pieces), key=lambda done: done[0])
        return tuple(map(np.concatenate, zip(*(answer for _, answer in answers), strict=True)))

    def _refined(self, x: Array, repeats: Array) -> tuple[Array, Array]:
        """Plans (b, k, v) after a descent, and their costs (b,)."""
        return refine(self.space, self.criterion, x, repeats, DESCENT_STEPS, SHARPNESS)

    def _exchanged(
        self, places: Indices, repeats: Array, pool: Candidates
    ) -> tuple[Indices, Array, Array]:
        """Places (b, k) after exchanges, how often each is visited (b, k), and costs (b,).

        Visits move between the places, too, where there are more of them than places.
        """
        if repeats.sum() > repeats.size:
            places, repeats = exchange_in_turn(
                pool.problem, self.criterion, places, repeats, thorough=False
            )
        places, costs = exchange(pool.problem, self.criterion, places, repeats, thorough=False)
        return places, repeats, costs

    def _spread(self, best: _Best) -> FoundPlan:
        """The plan, whose visits are moved apart where they share an error."""
        x, repeats, (starts, found, optima, ended) = best
        if self._shares:
            x, repeats = (x, repeats) if self.repeated else divided(x, repeats)
            with time_limit(0.0 if ended == "interrupted" else np.inf):
                x = spread(self.space, self.criterion, x, repeats, self.kept)
        order = np.lexsort((*np.round(x.T[::-1], 9), self.space.load_of(x)))
        x, repeats = x[order], repeats[order]
        cost = self.space.cost(self.criterion, self.space.plan(x, repeats.astype(int)))
        return FoundPlan(x, repeats.astype(int), cost, starts, found, optima, ended)


def _improved(search: VisitSearch, method: str, *plans: Any, **options: Any) -> tuple[Array, ...]:
    """What a method of a search makes of plans, as a piece of work for any process."""
    return tuple(getattr(search, method)(*plans, **options))


def _counted(starts: int) -> str:
    """A number of starts, in words of the progress."""
    return f"{starts} start{'s' if starts > 1 else ''}"
