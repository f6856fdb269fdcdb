"""The last digits of a design over a region: points and weights move together to their optimum."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.region import Region
from edtk.design.relaxation.onto_walls import onto_walls
from edtk.design.relaxation.rounding_of_inverse import rounding_of_inverse
from edtk.design.relaxation.safe_cost import safe_cost
from edtk.system.typing import Array

# Distance in parts of a range below which two points become one, the boldest first. A relaxation
# over neighbouring points spreads a weight over them.
CLOSE = (0.03, 0.003, 3e-4, 0.0)
SAME = 1e-5  # likewise, after a descent that has brought them together
LOSS = 1e-9  # relative increase of the cost at which fewer points are still welcome
NOTHING = 1e-7  # weight that is not worth a point
# Parts of the largest weight, the boldest first, below which weights may only keep a design regular
# that is best singular, and what dropping them may cost: there rounding blurs the cost.
LIGHT = (1e-3, 1e-4, 1e-5, 1e-6)
LOSS_OF_LIGHT = 1e-8
# Rounding of a cost that is far below all of these; more of it, so many times, counts as a loss.
SHARP = 1e-11
BLURRED = 2.0
MOST_VARIABLES = 160  # a step takes their third power
ITERATIONS = 200
FINEST = 1e-16  # of the logarithm of the cost, at which to end
WORTHLESS = 1e3  # logarithm of the cost of a singular design, for the line search


def polish(
    region: Region, criterion: Criterion, x: Array, weights: Array
) -> tuple[Array, Array, float]:
    """Merge points of a design that are close, and move points and weights to an optimum nearby.

    The logarithm of the cost is minimised over points and weights by sequential quadratic programs
    (SLSQP), with derivatives ``<G, M_i>`` by a weight and ``2 w_i <A_i G, dA_i>`` by a point. A
    result counts only if its cost, computed anew, is not larger; so a kink of the criterion, where
    the programs fail, does no harm.

    Args:
        region: The region.
        criterion: The criterion to improve.
        x: Points (k, d).
        weights: Their weights (k,), of sum one.

    Returns:
        Points (l, d), weights (l,) and their cost, or a number above it by as much as rounding may
        have lowered it; the given design where nothing is better.
    """
    cost = _cost(region, criterion, x, weights)
    if not np.isfinite(cost):
        return x, weights, cost
    best = (x, weights, cost)
    before = 0
    for close in CLOSE:
        start, share = _merged(region, x, weights, close)
        # No smaller distance separates points that a larger one has left apart.
        if len(start) == before:
            continue
        before = len(start)
        if len(start) * (1 + region.size) <= MOST_VARIABLES:
            points, shares = _Descent(region, criterion, len(start)).end(start, share)
        else:
            points, shares = onto_walls(region, start), share
        # Points that have moved onto each other are one.
        points, shares = _merged(region, points, shares, SAME)
        found = _cost(region, criterion, points, shares)
        if region.at(points).feasible.all() and found <= best[2] * (1 + LOSS):
            best = (points, shares, found)
            if found <= cost * (1 + LOSS):
                break
    return _without_light(region, criterion, best)


def _cost(region: Region, criterion: Criterion, x: Array, weights: Array) -> float:
    """The cost of a design, and what rounding may have taken from it.

    A descent goes where rounding is: costs of all but singular designs come out too low, and would
    be below the bound.
    """
    M = region.problem(x).information(weights)
    cost = safe_cost(criterion, M)
    if not np.isfinite(cost):
        return cost
    variances = np.square(range_whitener(M)).sum(axis=1)
    lost = rounding_of_inverse(M, variances)
    return cost if lost <= SHARP else cost * (1 + BLURRED * lost)


def _without_light(
    region: Region, criterion: Criterion, design: tuple[Array, Array, float]
) -> tuple[Array, Array, float]:
    """The design without the weights that its cost hardly needs, the boldest choice first."""
    x, weights, cost = design
    for light in LIGHT:
        heavy = weights > light * weights.max()
        if heavy.all():
            break
        share = weights[heavy] / weights[heavy].sum()
        without = _cost(region, criterion, x[heavy], share)
        if without <= cost * (1 + LOSS_OF_LIGHT):
            return x[heavy], share, without
    return design


def _merged(region: Region, x: Array, weights: Array, close: float) -> tuple[Array, Array]:
    """Points that are farther apart than `close`, each with the weight of those around it."""
    low, high = region.limits
    y = (x - low) / (high - low)
    owner = np.full(len(x), -1)
    kept: list[int] = []
    for i in np.argsort(-weights, kind="stable"):
        near = [j for j, k in enumerate(kept) if np.abs(y[i] - y[k]).max() <= close]
        if not near:
            kept.append(int(i))
        owner[i] = near[0] if near else len(kept) - 1
    share = np.bincount(owner, weights=weights, minlength=len(kept))
    sums = [np.bincount(owner, weights=weights * v) for v in x.T]
    mean = np.stack(sums, axis=1).astype(float) / share[:, None]
    # Between the points of a curved region there may be no point of it.
    inside = region.at(mean).feasible
    heavy = share > NOTHING
    points = np.where(inside[:, None], mean, x[kept])[heavy]
    return points, share[heavy] / share[heavy].sum()


@dataclass(frozen=True, eq=False)
class _Descent:
    """The optimisation of k points and their weights; variables are parts of their ranges."""

    region: Region
    criterion: Criterion
    k: int

    def end(self, x: Array, weights: Array) -> tuple[Array, Array]:
        """Points (k, d) on their walls, and weights (k,), after the descent."""
        from scipy.optimize import minimize

        low, high = self.region.limits
        start = np.concatenate([((x - low) / (high - low)).ravel(), weights])
        total = np.concatenate([np.zeros(x.size), np.ones(self.k)])
        rules = [{"type": "eq", "fun": lambda v: v @ total - 1, "jac": lambda v: total}]
        if self.region.slack_at(x).shape[-1]:
            rules.append({"type": "ineq", "fun": self._slack, "jac": self._slack_slope})
        found = minimize(
            self._value,
            start,
            jac=True,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(start),
            constraints=rules,
            options={"ftol": FINEST, "maxiter": ITERATIONS},
        ).x
        if not np.isfinite(found).all():
            return x, weights
        points = onto_walls(self.region, self._points(found))
        shares = np.maximum(found[x.size :], 0.0)
        shares = np.where(shares > NOTHING, shares, 0.0)
        return points[shares > 0], shares[shares > 0] / shares.sum()

    def _points(self, v: Array) -> Array:
        """Points (k, d) of the variables."""
        low, high = self.region.limits
        y = np.clip(v[: -self.k], 0.0, 1.0).reshape(self.k, -1)
        return np.asarray(low + (high - low) * y)

    def _value(self, v: Array) -> tuple[float, Array]:
        """Logarithm of the cost, and its slope."""
        here = self.region.at(self._points(v)[None])
        w = np.maximum(v[-self.k :], 0.0)
        cost, G = self.criterion.cost_and_gradient(here.information(w[None])[0])
        if not np.isfinite(cost) or not cost > 0:
            return WORTHLESS, np.zeros_like(v)
        G = G / cost
        low, high = self.region.limits
        weighted = here.regressor @ G
        by_weight = (weighted * here.regressor).sum(axis=(-1, -2))[0]
        if self.region.prior is not None:
            by_weight = by_weight + np.tensordot(G, self.region.prior, 2)
        by_point = 2 * w[:, None] * here.slope(weighted)[0] * (high - low)
        return float(np.log(cost)), np.concatenate([by_point.ravel(), by_weight])

    def _slack(self, v: Array) -> Array:
        """Slacks (k c,) of all points."""
        return self.region.slack_at(self._points(v)).ravel()

    def _slack_slope(self, v: Array) -> Array:
        """Their derivatives (k c, k d + k) by all variables."""
        low, high = self.region.limits
        G = self.region.slack_derivative_at(self._points(v)) * (high - low)
        k, c, d = G.shape
        J = np.zeros((k, c, k, d))
        J[np.arange(k), :, np.arange(k)] = G
        return np.concatenate([J.reshape(k * c, k * d), np.zeros((k * c, k))], axis=1)
