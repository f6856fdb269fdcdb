"""A relaxed design whose poses and weights move together to the optimum nearby."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.distinct import distinct
from edtk.design.interior_point.descend import descend
from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.objective import Local
from edtk.design.relaxation.log_cost import LogCost
from edtk.design.relaxation.weighted_space import WeightedSpace
from edtk.design.space import Points, Space
from edtk.system.typing import Array, Indices

ALIKE = 0.1  # relative difference of information up to which two poses move as one
MOST_VARIABLES = 200  # of a design: the matrices of a step grow with their square
STEPS = 20  # a dozen is the rule
LIGHT = 1e-3  # weight
FIRST_ORDER = 2.0  # an increase by no more than so many times its first order is no more than that
BARRIER = 0.003  # the design is near its optimum, from which a large one would drive it away


def settle(
    space: Space, criterion: Criterion, x: Array, weights: Array, blocks: Array
) -> Array | None:
    """Poses of a design after a descent of poses and weights together.

    A search that adds the most sensitive poses to a design, and weighs them anew, comes nearer to
    the optimum by a factor of three a turn, as a new pose is the best for the old weights only.
    Newton's steps for both end in a dozen. With a cost homogeneous of degree -d, the minimum of

        log cost(M0 + sum_i w_i A_i' A_i) + c sum_i w_i,   w >= 0,

    has weights of sum one for ``c = d``; with a prior, for the multiplier of that sum, which the
    design tells to first order.

    Args:
        space: Where the poses lie.
        criterion: What is minimised.
        x: Design variables (k, v) of the design's poses.
        weights: Their weights (k,).
        blocks: Information (k, p, p) of one measurement in each, without the prior.

    Returns:
        Design variables (l, v) of feasible poses, no more than before; None where the design has
        too many variables or the criterion no such descent.
    """
    if not criterion.smooth or not criterion.needs_all or criterion.degree <= 0:
        return None
    told = np.tensordot(weights, blocks, 1)
    M = told if space.prior is None else told + space.prior
    cost, G = criterion.cost_and_gradient(M)
    unit = -float(np.tensordot(G, told, 2)) / float(cost)
    heaviest = np.argsort(-weights, kind="stable")
    T = range_whitener(M)
    kept = heaviest[distinct(blocks[heaviest], T, ALIKE)]
    k = len(kept)
    movable = len(space.movable)
    if not movable or k * (movable + 1) > MOST_VARIABLES or not unit > 0:
        return None
    shares = _shares(T.T @ blocks @ T, weights, kept)
    start = np.concatenate([x[kept], shares[:, None]], axis=1)
    objective = _PricedCost(criterion, np.full((1, k), 1.0 / k), unit)
    weighted = WeightedSpace(space, k)
    ends = descend(weighted, start[None], objective, STEPS, barrier=BARRIER)[0]
    if not _rests_on_heavy(weighted, criterion, ends):
        return None
    x = ends[:, :-1]
    return np.asarray(x[space.at(x).feasible])


def _rests_on_heavy(space: WeightedSpace, criterion: Criterion, ends: Array) -> bool:
    """Whether no part of the information hangs on poses of almost no weight alone.

    Without light poses, of total weight w, the cost is higher by ``w d`` to first order, as their
    sensitivities are no larger than the degree d of the cost. It is higher by far where they alone
    tell a direction that must be known. Such weights say nothing of a plan of whole experiments,
    which has no pose for a thousandth of them.
    """
    light = ends[:, -1] <= LIGHT
    total = float(ends[light, -1].sum())
    heavy = ends.copy()
    heavy[light, -1] = 0.0
    both = np.stack([ends, heavy])
    cost, alone = criterion.cost(space.at(both).information(np.full(both.shape[:2], 1 / space.k)))
    return bool(alone <= cost * (1 + FIRST_ORDER * criterion.degree * total))


def _shares(whitened: Array, weights: Array, kept: Indices) -> Array:
    """Weights of the poses that are kept: each pose gives its own to the most similar one."""
    flat = whitened.reshape(len(weights), -1)
    owner = np.linalg.norm(flat[:, None] - flat[kept], axis=-1).argmin(axis=1)
    return np.bincount(owner, weights=weights, minlength=len(kept)).astype(float)


@dataclass(frozen=True, eq=False)
class _PricedCost(LogCost):
    """Logarithms of costs, and a price of the weights, which are the last variable.

    Attributes:
        unit: The price of a weight of one.
    """

    unit: float

    def value(self, here: Points, start: Indices) -> Array:
        """Values (b,)."""
        return super().value(here, start) + self.unit * here.x[..., -1].sum(axis=-1)

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values and derivatives; the price is linear."""
        found = super().local(near, start)
        slope = found.slope.copy()
        slope[..., -1] += self.unit
        value = found.value + self.unit * near.x[..., -1].sum(axis=-1)
        return found._replace(value=value, slope=slope)
