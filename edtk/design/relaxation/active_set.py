"""A few poses that a design may rest on, and the relaxation over them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.inverse import whitener
from edtk.design.candidates import Candidates
from edtk.design.distinct import distinct
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax import Relaxation, relax

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Poses, the relaxation over them, and the number of masters that it took from the beginning."""

    poses: Candidates
    relaxation: Relaxation
    iterations: int

    @property
    def support(self) -> Candidates:
        """The poses that carry weight."""
        return self.poses[self.relaxation.support]

    @property
    def weights(self) -> Array:
        """Their weights (k,)."""
        return self.relaxation.weights[self.relaxation.support]

    def over(self, poses: Candidates, gap: float) -> "ActiveSet":
        """The relaxation over other poses."""
        r = self.relaxation
        relaxation = relax(poses.problem, r.criterion, gap, multipliers=r.multipliers)
        return ActiveSet(poses, relaxation, self.iterations + relaxation.iterations)

    def merged(self, loss: float, gap: float, found: Candidates | None = None) -> "ActiveSet":
        """The relaxation over fewer poses, as long as the cost grows by no more than a relative loss.

        Poses of hardly any weight are dropped, and like poses become one. Poses are alike if their information is:
        the same pose, and poses that a symmetry of robot and load maps onto each other. Of each kind the one stays
        that was last to join, or that the search found last.
        """
        support, weights = self.support, self.weights
        T = whitener(support.problem.information(weights))
        for alike, least in ((0.1, 1e-3), (0.03, 1e-3), (0.01, 1e-4), (0.001, 1e-5), (0.0, 1e-5)):
            heavy = support[np.flatnonzero(weights > least * weights.max())[::-1]]
            for poses in (heavy,) if found is None else (heavy, found + heavy):
                try:
                    fewer = self.over(poses[distinct(poses.problem.blocks(), T, alike)], gap)
                except RankDeficientError:
                    continue
                if fewer.relaxation.cost <= self.relaxation.cost * (1 + loss):
                    return fewer if len(fewer.relaxation.support) < len(weights) else self
        return self
