"""A few poses that a design may rest on, with the relaxation over them."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from criteria.linalg.estimable import range_whitener
from edtk.design.candidates import Candidates
from edtk.design.distinct import distinct
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.solver_options import SolverOptions
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

# How boldly poses are merged, the boldest first: relative difference of information below which two
# poses are alike, and part of the largest weight below which a pose is dropped. Poses of an optimum
# that symmetry maps onto each other differ by the ascents' accuracy, a few per cent where the
# sensitivity is flat.
FEW = 200  # poses that one program weighs as quickly as several programs would, a part of them each
MERGING = ((0.1, 1e-3), (0.03, 1e-3), (0.01, 1e-4), (0.001, 1e-5), (0.0, 1e-5))


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Poses, the relaxation over them, and what it took.

    Attributes:
        poses: The poses (n).
        relaxation: The relaxation over them.
        iterations: Number of restricted master problems that were solved from the beginning.
    """

    poses: Candidates
    relaxation: Relaxation
    iterations: int

    @property
    def support(self) -> Candidates:
        """The poses (k) that carry weight."""
        return self.poses[self.relaxation.support]

    @property
    def weights(self) -> Array:
        """The weights (k,) of the support."""
        return self.relaxation.weights[self.relaxation.support]

    def over(self, poses: Candidates, gap: float) -> "ActiveSet":
        """The relaxation over other poses, to a relative gap."""
        earlier = self.relaxation
        few = earlier.criterion.smooth and len(poses.x) <= FEW
        options = SolverOptions(batch=len(poses.x)) if few else SolverOptions()
        relaxation = relax(
            poses.problem, earlier.criterion, gap, options, multipliers=earlier.multipliers
        )
        return ActiveSet(poses, relaxation, self.iterations + relaxation.iterations)

    def merged(self, loss: float, gap: float, found: Candidates | None = None) -> "ActiveSet":
        """The relaxation over fewer poses, at hardly any more cost.

        Poses of little weight are dropped, and of poses with like information one stays. Such poses
        are the same, or a symmetry of robot and load maps them onto each other. The one that joined
        last stays, or that the search found last: it is closest to the optimum.

        Args:
            loss: Relative increase of the cost that is allowed.
            gap: Relative gap of the relaxations.
            found: Poses that the search found last, to choose from besides the support.

        Returns:
            The relaxation over fewer poses, or this one where no merging keeps to the loss.
        """
        support = self.support
        weights = self.weights
        M = support.problem.information(weights)
        criterion = self.relaxation.criterion
        # Poses that tell the same of what counts may differ in what else they tell, which may be
        # needed to know what counts: the second choice.
        whiteners = [criterion.whitener(M)]
        if not criterion.needs_all:
            whiteners.append(range_whitener(M))
        for (alike, least), T in product(MERGING, whiteners):
            heavy = np.flatnonzero(weights > least * weights.max())
            last_first = support[heavy[::-1]]
            trials = [last_first] if found is None else [last_first, found + last_first]
            for poses in trials:
                if out_of_time():
                    return self
                kept = distinct(poses.problem.blocks(), T, alike)
                try:
                    fewer = self.over(poses[kept], gap)
                except RankDeficientError:
                    continue
                if fewer.relaxation.cost <= self.relaxation.cost * (1 + loss):
                    has_fewer = len(fewer.relaxation.support) < len(weights)
                    return fewer if has_fewer else self
        return self
