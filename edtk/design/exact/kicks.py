"""The end of a search: the best plans are kicked out of their optima, one place at a time."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.candidate_prices import CandidatePrices
from edtk.design.exact.descent import COARSE, FINE, Answer, Descent, Search
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.design.exact.plans import Plans
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

CHAMPIONS = 4  # plans that are kicked
KICKS = 8  # of each of them in a turn
PER_PLACE = 6  # of a place
ELITE = 6  # kicked plans that are refined to the end
TURNS = 6  # at most; the first without a gain is the last
GAIN = 1e-6  # relative improvement that counts
POOL = 512  # fresh candidates of each turn
MOST_KNOWN = 1024  # places of refined plans among the candidates
DIFFERENT = 0.1  # relative difference of information from which on two places are two
SAME = 1e-3  # relative difference of information up to which two plans are the same
LOOKED_AT = 64  # best candidates for a place, among which different ones are chosen


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
        for turn in range(TURNS):
            kicked = self._kicked(plans, self._candidates(turn))
            if out_of_time() or not len(kicked.x):
                break
            reached, kicked = yield Descent(kicked, COARSE)
            reached, kicked = yield Descent(self._best_of(reached, kicked, ELITE)[1], FINE)
            least = costs[0]
            both = Plans(
                np.concatenate([plans.x, kicked.x]),
                np.concatenate([plans.repeats, kicked.repeats]),
            )
            costs, plans = self._best_of(np.concatenate([costs, reached]), both, CHAMPIONS)
            if not costs[0] < least * (1 - GAIN):
                break
        return costs, plans

    def _candidates(self, turn: int) -> Candidates:
        """Known places, and feasible candidates that no other turn has."""
        known = self.known[:MOST_KNOWN]
        fresh = CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL)
        return Candidates(known, self.space.problem(known)) + fresh

    def _best_of(self, costs: Array, plans: Plans, most: int) -> Answer:
        """The best plans that differ from each other."""
        order = np.argsort(costs, kind="stable")
        M = plans[order].information(self.space)
        chosen = order[distinct(M, range_whitener(M[0]), SAME, most)]
        return costs[chosen], plans[chosen]

    def _kicked(self, plans: Plans, candidates: Candidates) -> Plans:
        """Plans with another pose at one of their places."""
        prices = CandidatePrices.of(self.criterion, candidates.problem)
        x: list[Array] = []
        repeats: list[Array] = []
        for own, times in zip(plans.x, plans.repeats, strict=True):
            kicks = self._kicks(own, times, candidates, prices)
            for _, place, which in sorted(kicks)[:KICKS]:
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
        blocks = candidates.problem.blocks()[None]
        factors = candidates.problem.factors()[None]
        rows = [
            exchange_costs(self.criterion, rest[i : i + 1], blocks, factors, times[i : i + 1])[0]
            for i in range(len(rest))
        ]
        return np.array(rows)


def _different(costs: Array, own: Array, candidates: Candidates, T: Array) -> Indices:
    """The cheapest candidates for a place that are neither like it nor like each other."""
    order = np.argsort(costs, kind="stable")[:LOOKED_AT]
    order = order[np.isfinite(costs[order])]
    blocks = np.concatenate([own[None], candidates.problem.blocks(order)])
    return np.asarray(order[distinct(blocks, T, DIFFERENT, PER_PLACE + 1)[1:] - 1])
