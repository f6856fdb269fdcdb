"""One batch of a search for exact plans: starts, a coarse descent, and a fine one of the best."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
from threadpoolctl import threadpool_limits

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.best_repeats import best_repeats
from edtk.design.exact.draw_starts import draw_starts
from edtk.design.exact.exchange_in_turn import exchange_in_turn
from edtk.design.exact.plans import Plans
from edtk.design.exact.refine import refine
from edtk.system.typing import Array, Indices

BATCH_SIZE = 16  # starts
# Plans that are refined to the end. On the paper's study (rho0, D and O2; 3 to 12 experiments) the
# final best was the best of the coarse descent in half of 36 batches, and its fourth in a tenth.
ELITE = 4
# Rounds of refinement, with an exchange between them. The last exchange still improved the best
# plan by 1e-4 in a quarter of these batches; more gain is left to the next batch.
ROUNDS = 4
GAIN = 1e-6  # relative improvement for which another round is made
SAME = 1e-3  # relative difference of information up to which two plans are refined as one
POOL = 256  # fresh candidates for the starts, and for each exchange


@dataclass(frozen=True)
class _Effort:
    """How far a descent goes: its steps, and the soft maxima of criteria with kinks."""

    iterations: int
    sharpness: tuple[float, ...]


COARSE = _Effort(15, (30.0,))  # enough to tell good starts from bad ones
FINE = _Effort(60, (250.0,))


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
        seconds: Time [s] from the call after which the best plans so far are returned.
    """

    space: DesignSpace
    criterion: Criterion
    m: int
    places: int
    support: Array
    weights: Array
    seed: tuple[int, ...]
    seconds: float = np.inf

    def __call__(self) -> tuple[Array, Plans]:
        """Costs (e,) of the plans that were refined to the end, the best first, and the plans."""
        end = monotonic() + self.seconds
        # The rounding of a product may depend on the number of threads, and so would the plan.
        with threadpool_limits(1):
            return self._search(lambda: monotonic() >= end)

    def _search(self, late: Callable[[], bool]) -> tuple[Array, Plans]:
        """Refine starts coarsely, the elite finely, then exchange and refine it in turn."""
        costs, plans = self._refined(self._starts(), COARSE, late)
        costs, plans = self._refined(self._elite(costs, plans), FINE, late)
        for turn in range(1, ROUNDS):
            if late():
                break
            exchanged = self._exchanged(plans, self._fresh(turn))
            reached, exchanged = self._refined(exchanged, FINE, late)
            better = reached < costs * (1 - GAIN)
            if not better.any():
                break
            costs = np.where(better, reached, costs)
            plans = plans.replaced(better, exchanged)
        order = np.argsort(costs, kind="stable")
        return costs[order], plans[order]

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
        return best_first[distinct(M, range_whitener(M[0]), SAME)[:ELITE]]

    def _fresh(self, turn: int) -> Candidates:
        """Feasible candidates that no other batch has."""
        return CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL)

    def _refined(
        self, plans: Plans, effort: _Effort, late: Callable[[], bool]
    ) -> tuple[Array, Plans]:
        """Costs and plans after a descent of all of them."""
        x, costs = refine(
            self.space,
            self.criterion,
            plans.x,
            plans.repeats,
            effort.iterations,
            effort.sharpness,
            late,
        )
        return costs, Plans(x, plans.repeats)

    def _exchanged(self, plans: Plans, fresh: Candidates) -> Plans:
        """Plans after repetitions were moved and places exchanged, wherever that helps.

        A place may be exchanged for a fresh candidate, or for a place of another plan.
        """
        own = plans.x.reshape(-1, plans.x.shape[-1])
        pool = Candidates(own, self.space.problem(own)) + fresh
        places = np.arange(len(own)).reshape(plans.repeats.shape)
        repeats = self._best_repeats(pool, places, plans.repeats)
        places, repeats = exchange_in_turn(pool.problem, self.criterion, places, repeats)
        return Plans(pool.x[places], repeats)

    def _best_repeats(self, pool: Candidates, places: Indices, repeats: Array) -> Array:
        """Best repetitions (b, k) of plans at fixed places of the pool (b, k)."""
        prior = pool.problem.prior
        blocks = pool.problem.blocks(places)
        return np.array(
            [
                best_repeats(self.criterion, own, times, prior)
                for own, times in zip(blocks, repeats, strict=True)
            ]
        )
