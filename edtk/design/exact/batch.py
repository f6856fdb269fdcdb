"""One batch of a search for exact plans: starts, a coarse descent, and a fine one of the best."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.descent import COARSE, FINE, Descent, Search
from edtk.design.exact.draw_starts import draw_starts
from edtk.design.exact.exchange_and_refine import exchange_and_refine
from edtk.design.exact.plans import Plans
from edtk.system.typing import Array

BATCH_SIZE = 16  # starts
# Plans that are refined to the end. On the paper's study (rho0, D and O2; 3 to 12 experiments) the
# final best was the best of the coarse descent in half of 36 batches, and its fourth in a tenth.
ELITE = 4
SAME = 1e-3  # relative difference of information up to which two plans are refined as one
POOL = 256  # fresh candidates for the starts, and for each exchange


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
        return best_first[distinct(M, range_whitener(M[0]), SAME)[:ELITE]]

    def _fresh(self, turn: int) -> Candidates:
        """Feasible candidates that no other batch has."""
        return CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL)
