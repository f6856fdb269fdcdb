"""A relaxed design whose poses and weights move together to the optimum nearby."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria import Criterion
from criteria.criterion import derivatives
from criteria.linalg.estimable import range_whitener
from criteria.linalg.inverse import TINY
from criteria.linalg.models import Models
from criteria.linalg.typing import triangle
from edtk.cell.sight import Sight
from edtk.design.design_space import Points, Space, weighted_information
from edtk.design.information import distinct
from edtk.design.interior_point.descend import descend
from edtk.design.interior_point.objective import Local, Neighbourhood, Objective
from edtk.system.typing import Array, Indices, Mask

FEW_PARAMETERS = 12  # parameters
MOVES_AS_ONE = 0.1  # relative difference of information up to which two poses move as one
MOST_VARIABLES = 200  # of a design: the matrices of a step grow with their square
SETTLE_STEPS = 20  # a dozen is the rule
LIGHT = 1e-3  # weight
FIRST_ORDER = 2.0  # an increase by no more than so many times its first order is no more than that
SETTLE_BARRIER = 0.003  # the design is near its optimum, from which a large one would drive it away


@dataclass(frozen=True, eq=False)
class LogCost(Objective):
    """Logarithms of a criterion's costs of plans, as the objective of a descent.

    The logarithm has order one whatever the units, and makes steps independent of the criterion's
    degree of homogeneity.

    Args:
        criterion: The criterion to minimise.
        repeats: Repetitions (n, k) of the experiments of all starts.
    """

    criterion: Criterion
    repeats: Array

    def value(self, here: Points, start: Indices) -> Array:
        """Values (b,), inf where the plan is singular."""
        return np.log(self.criterion.cost(here.information(self.repeats[start])))

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values, slopes and curvature; slopes and curvature are zero where the value is inf.

        With ``L = log cost``, its gradient G and its second derivative K by M, and with
        ``M = sum_i r_i (M0 + A_i' A_i)``, where A is whitened,

            dL/dx_ia = <G, dM/dx_ia> = 2 r_i <A_i G, dA_i/dx_ia>,
            d2L/dx_ia dx_jb = K[dM/dx_ia, dM/dx_jb] + (i = j) <G, d2M/dx_ia dx_ib>.

        In the second line dM is a difference between neighbours, and the last term is a difference
        between their slopes under the same G.
        """
        # Repeats of a pose share its discrepancy, if there is any.
        experiments = near.experiments.visited(self.repeats[start])
        A = experiments.regressor
        repeats = self.repeats[start, :, None, None]
        b = len(start)
        M = weighted_information(A[0], self.repeats[start], near.space.prior)
        cost, G, K = derivatives(self.criterion, M, self.criterion.models)
        # The logarithm divides its derivatives by the cost; singular plans have none.
        finite = np.isfinite(cost)[:, None, None]
        divisor = np.where(finite, cost[:, None, None], 1.0)
        G = np.where(finite, G / divisor, 0.0)
        K = np.where(finite, K / divisor, 0.0)
        slopes = near.first(experiments.slope(2.0 * repeats * (A @ G[:, None])))
        own = repeats[..., 0] * _triangles(experiments, self.criterion.models)
        dM = near.differences(own).transpose(1, 2, 0, 3).reshape(b, -1, own.shape[-1])
        slope = slopes[0].reshape(b, -1)
        # The second term is that of the logarithm: (log c)'' = c''/c - (c'/c)^2.
        joint = dM @ K @ np.swapaxes(dM, 1, 2) - slope[:, :, None] * slope[:, None]
        return Local(np.log(cost), slopes[0], near.second(slopes), joint)


def _triangles(experiments: Points, models: Models | None) -> Array:
    """Upper triangles (..., q) of the information of one measurement in each experiment.

    Those of several models are of the blocks: what is beside them is zero, and most of all. Whole
    arrays are added for each entry of few, in a fifth of the time of many small products.
    """
    A = experiments.regressor
    if models is None and A.shape[-1] <= FEW_PARAMETERS:
        return np.moveaxis(experiments.packed, 0, -1)
    rows, columns = triangle(A.shape[-1]) if models is None else models.triangles
    return np.asarray((np.swapaxes(A, -1, -2) @ A)[..., rows, columns])


@dataclass(frozen=True, eq=False)
class WeightedSpace:
    """Experiments x of a space and their weights w in [0, 1], as variables (x, w).

    Rows are multiplied by ``sqrt(k w)``. So k experiments, each measured 1/k times, tell
    ``M0 + sum_i w_i A_i' A_i`` together, with the prior counted once where weights sum to one.

    Attributes:
        base: The space of the experiments.
        k: Number of experiments of a design.
    """

    base: Space
    k: int

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v + 1)."""
        return np.concatenate([self.base.limits, [[0.0], [1.0]]], axis=1)

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change: the weight is one of them."""
        return [*self.base.movable, self.base.limits.shape[1]]

    @property
    def prior(self) -> Array | None:
        """Prior information M0 (p, p) of the base."""
        return self.base.prior

    @property
    def sight(self) -> Sight | None:
        """What is read of the base."""
        return self.base.sight

    def at(self, x: Array, held: Mask | None = None) -> "WeightedPoints":
        """The weighted experiments (..., v + 1), see `Space`."""
        return WeightedPoints(self, x, self.base.at(x[..., :-1], held))


@dataclass(frozen=True, eq=False)
class WeightedPoints:
    """Weighted experiments, see `Points`.

    Attributes:
        space: Where they lie.
        x: Design variables and weights (..., v + 1).
        points: The experiments themselves.
    """

    space: WeightedSpace
    x: Array
    points: Points

    @cached_property
    def _factor(self) -> Array:
        """``k w`` (...)."""
        return np.asarray(self.space.k * self.x[..., -1])

    @cached_property
    def regressor(self) -> Array:
        """Rows (..., rows, p)."""
        return np.asarray(np.sqrt(self._factor)[..., None, None] * self.points.regressor)

    @property
    def packed(self) -> Array:
        """Information (p(p+1)/2, ...) without the prior."""
        return self._factor * self.points.packed

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints."""
        return self.points.slack

    @property
    def slack_gradient(self) -> Array:
        """Their derivatives (..., c, v + 1), zero by the weight."""
        G = self.points.slack_gradient
        return np.concatenate([G, np.zeros((*G.shape[:-1], 1))], axis=-1)

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) is feasible, with a weight in [0, 1]."""
        w = self.x[..., -1]
        return np.asarray(self.points.feasible & (w >= 0) & (w <= 1))

    def visited(self, visits: Array) -> "WeightedPoints":
        """Each visit of a relaxed design counts as one of a pose of its own."""
        return self

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p), see `weighted_information`."""
        return weighted_information(self.regressor, repeats, self.space.prior)

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v + 1) of ``<B, rows>``; by the weight it is ``<B, rows>/(2 w)``."""
        by_place = self.points.slope(np.sqrt(self._factor)[..., None, None] * B)
        total = (B * self.regressor).sum(axis=(-1, -2))
        by_weight = total / np.maximum(2.0 * self.x[..., -1], TINY)
        return np.concatenate([by_place, by_weight[..., None]], axis=-1)


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
    kept = heaviest[distinct(blocks[heaviest], T, MOVES_AS_ONE)]
    k = len(kept)
    movable = len(space.movable)
    if not movable or k * (movable + 1) > MOST_VARIABLES or not unit > 0:
        return None
    shares = _shares(T.T @ blocks @ T, weights, kept)
    start = np.concatenate([x[kept], shares[:, None]], axis=1)
    objective = _PricedCost(criterion, np.full((1, k), 1.0 / k), unit)
    weighted = WeightedSpace(space, k)
    ends = descend(weighted, start[None], objective, SETTLE_STEPS, barrier=SETTLE_BARRIER)[0]
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
        weight = near.experiments.x[0, ..., -1]
        value = found.value + self.unit * weight.sum(axis=-1)
        return found._replace(value=value, slope=slope)
