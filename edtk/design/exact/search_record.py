"""The plans that a search has found so far, its descents, and how it leaves its optima."""

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import Candidates, CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exchange_costs import CandidatePrices, exchange_costs
from edtk.design.information import distinct
from edtk.design.relaxation.search_continuum import DIFFERENT
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

RECORD_GAIN = 1e-4  # relative improvement that counts; less is lost among what seeds differ by
SLIGHT = 1e-9  # relative improvement by which a plan is worth a change of what was found
SAME_PLAN = 1e-3  # relative difference of information up to which two plans are the same
CHAMPIONS = 4  # plans that are kicked
KICKS_IN_TURN = 8  # of each of them in a turn
PER_PLACE = 6  # of a place
ELITE_OF_KICKED = 6  # kicked plans that are refined to the end
KICK_TURNS = 6  # at most; the first without a gain is the last
KICK_GAIN = 1e-6  # relative improvement that counts
POOL_OF_TURN = 512  # fresh candidates of each turn
MOST_KNOWN = 1024  # places of refined plans among the candidates
LOOKED_AT = 64  # best candidates for a place, among which different ones are chosen


@dataclass(frozen=True, eq=False)
class Plans:
    """Plans of k experiments with repetitions, as a search moves them all together.

    Attributes:
        x: Design variables (b, k, v).
        repeats: Whole numbers (b, k) of one sum; zero where an experiment is left out.
    """

    x: Array
    repeats: Array

    def __getitem__(self, chosen: Indices) -> "Plans":
        """The chosen plans."""
        return Plans(self.x[chosen], self.repeats[chosen])

    def replaced(self, better: Mask, others: "Plans") -> "Plans":
        """The same plans, with those of another batch where these are better (b,)."""
        return Plans(
            np.where(better[:, None, None], others.x, self.x),
            np.where(better[:, None], others.repeats, self.repeats),
        )

    def information(self, space: DesignSpace) -> Array:
        """Information matrices (b, p, p), the prior of the design space included."""
        return space.at(self.x).information(self.repeats)


@dataclass(frozen=True)
class Effort:
    """How far a descent goes: its steps, and the soft maxima of criteria with kinks."""

    iterations: int
    sharpness: tuple[float, ...]


COARSE = Effort(15, (30.0,))  # enough to tell good starts from bad ones
FINE = Effort(60, (250.0,))


class Descent(NamedTuple):
    """A descent that is asked for: that of all these plans, with so much effort."""

    plans: Plans
    effort: Effort


Answer = tuple[Array, Plans]  # costs (b,) and plans
# It yields descents and is sent their ends; it returns its best plans, the best first.
Search = Generator[Descent, Answer, Answer]


class SearchRecord:
    """The best plan so far, and all plans that were refined to the end.

    Attributes:
        best: The best plan, in a batch of one.
        cost: Its cost.
        batches: Number of batches that were entered.
        idle: Number of batches since the last improvement that counts.
    """

    best: Plans
    cost: float
    batches: int
    idle: int

    def __init__(self, space: DesignSpace) -> None:
        self.cost = np.inf
        self.batches = 0
        self.idle = 0
        self._space = space
        self._costs: list[float] = []
        self._information: list[Array] = []
        self._plans: list[Plans] = []

    @property
    def empty(self) -> bool:
        """Whether no batch was entered yet."""
        return self.batches == 0

    def enter(self, costs: Array, plans: Plans) -> None:
        """Enter the answer of one batch: costs (e,), the best first, and their plans."""
        improved = self.empty or costs[0] < self.cost * (1 - RECORD_GAIN)
        self.idle = 0 if improved else self.idle + 1
        if self.empty or costs[0] < self.cost:
            self.cost = float(costs[0])
            self.best = plans[np.array([0])]
        self.batches += 1
        self._add(costs, plans)

    def improve(self, costs: Array, plans: Plans) -> None:
        """Enter the best of some plans (e,), the best first, if it is better than all so far."""
        if costs[0] < self.cost * (1 - SLIGHT):
            self.cost = float(costs[0])
            self.best = plans[np.array([0])]
            self._add(costs[:1], self.best)

    def _add(self, costs: Array, plans: Plans) -> None:
        """Keep plans with their costs (e,) for the census."""
        self._costs += costs.tolist()
        self._plans += [plans]
        self._information += list(plans.information(self._space))

    @property
    def plans(self) -> Plans:
        """All plans that were refined to the end, the best first."""
        x = np.concatenate([plans.x for plans in self._plans])
        repeats = np.concatenate([plans.repeats for plans in self._plans])
        return Plans(x, repeats)[np.argsort(self._costs, kind="stable")]

    def champions(self, most: int) -> tuple[Array, Plans]:
        """Costs (b,) of the best plans that differ from each other, and the plans.

        Without a regular plan there is none.
        """
        order = np.argsort(self._costs, kind="stable")
        costs = np.array(self._costs)[order]
        finite = int(np.isfinite(costs).sum())
        if not finite:
            return costs[:0], self.plans[np.arange(0)]
        M = np.array(self._information)[order[:finite]]
        chosen = distinct(M, range_whitener(M[0]), SAME_PLAN, most)
        return costs[chosen], self.plans[chosen]

    def census(self) -> tuple[int, int]:
        """How many plans came out as the best one, and how many different plans there are."""
        if not np.isfinite(self.cost):
            return 0, 0
        order = np.argsort(self._costs, kind="stable")
        M = np.array(self._information)[order]
        T = range_whitener(M[0])
        # Whitened by the best plan, the best plan is the identity, of norm sqrt of its rank.
        difference = np.linalg.norm(T.T @ (M - M[0]) @ T, axis=(1, 2))
        same = difference <= SAME_PLAN * np.sqrt(T.shape[1])
        return int(same.sum()), len(distinct(M, T, SAME_PLAN))


@dataclass(frozen=True, eq=False)
class Kicks:
    """Kicks of the best plans, as long as they lead to better ones.

    A kick gives one place to the best candidate that is not like it, although that makes the plan
    worse. A descent from there often ends in a better optimum: on twelve questions (three robots,
    3 to 12 experiments) four kicked plans gained what a hundred random starts did not.

    Attributes:
        space: Model and feasible set.
        criterion: The criterion to minimise.
        best: Costs (b,) of refined plans, the best first, and the plans, which differ.
        known: Design variables (n, v) of their places and those of others.
        seed: Seed of the fresh candidates.
    """

    space: DesignSpace
    criterion: Criterion
    best: Answer
    known: Array
    seed: tuple[int, ...]

    def search(self) -> Search:
        """Kick and refine in turn; see `Batch.search`."""
        costs, plans = self.best
        for turn in range(KICK_TURNS):
            kicked = self._kicked(plans, self._candidates(turn))
            if out_of_time() or not len(kicked.x):
                break
            reached, kicked = yield Descent(kicked, COARSE)
            reached, kicked = yield Descent(
                self._best_of(reached, kicked, ELITE_OF_KICKED)[1], FINE
            )
            least = costs[0]
            both = Plans(
                np.concatenate([plans.x, kicked.x]),
                np.concatenate([plans.repeats, kicked.repeats]),
            )
            costs, plans = self._best_of(np.concatenate([costs, reached]), both, CHAMPIONS)
            if not costs[0] < least * (1 - KICK_GAIN):
                break
        return costs, plans

    def _candidates(self, turn: int) -> Candidates:
        """Known places, and feasible candidates that no other turn has."""
        known = self.known[:MOST_KNOWN]
        fresh = CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL_OF_TURN)
        return Candidates(known, self.space.problem(known)) + fresh

    def _best_of(self, costs: Array, plans: Plans, most: int) -> Answer:
        """The best plans that differ from each other."""
        order = np.argsort(costs, kind="stable")
        M = plans[order].information(self.space)
        chosen = order[distinct(M, range_whitener(M[0]), SAME_PLAN, most)]
        return costs[chosen], plans[chosen]

    def _kicked(self, plans: Plans, candidates: Candidates) -> Plans:
        """Plans with another pose at one of their places."""
        prices = CandidatePrices.of(self.criterion, candidates.problem)
        x: list[Array] = []
        repeats: list[Array] = []
        for own, times in zip(plans.x, plans.repeats, strict=True):
            kicks = self._kicks(own, times, candidates, prices)
            for _, place, which in sorted(kicks)[:KICKS_IN_TURN]:
                moved = own.copy()
                moved[place] = candidates.x[which]
                x.append(moved)
                repeats.append(times)
        return Plans(np.array(x), np.array(repeats))

    def _kicks(
        self, x: Array, times: Array, candidates: Candidates, prices: CandidatePrices | None
    ) -> list[tuple[float, int, int]]:
        """The best kicks of each place: the cost, the place and the candidate."""
        problem = self.space.problem(x)
        M = problem.information(times)
        blocks = problem.blocks()
        T = range_whitener(M)
        used = np.flatnonzero(times > 0)
        r = times[used]
        rest = M - r[:, None, None] * blocks[used]
        costs = self._costs(rest, r, candidates) if prices is None else prices.costs(rest, r)
        found = []
        for place, row in zip(used.tolist(), costs, strict=True):
            for which in _different(row, blocks[place], candidates, T):
                found.append((float(row[which]), place, int(which)))
        return found

    def _costs(self, rest: Array, times: Array, candidates: Candidates) -> Array:
        """Costs (k, n) of the rests (k, p, p) joined by each candidate."""
        factors = candidates.problem.factors()[None]
        rows = [
            exchange_costs(self.criterion, rest[i : i + 1], factors, times[i : i + 1])[0]
            for i in range(len(rest))
        ]
        return np.array(rows)


def _different(costs: Array, own: Array, candidates: Candidates, T: Array) -> Indices:
    """The cheapest candidates for a place that are neither like it nor like each other."""
    order = np.argsort(costs, kind="stable")[:LOOKED_AT]
    order = order[np.isfinite(costs[order])]
    blocks = np.concatenate([own[None], candidates.problem.blocks(order)])
    return np.asarray(order[distinct(blocks, T, DIFFERENT, PER_PLACE + 1)[1:] - 1])
