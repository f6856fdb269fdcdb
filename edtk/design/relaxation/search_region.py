"""The search over a region for the largest sensitivities, and the last digits of a design."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Any

import numpy as np

from criteria import Criterion, Relaxable
from criteria.interest import Interest
from criteria.linalg.estimable import range_whitener
from criteria.relaxable import Losses
from edtk.design.candidate_source import Candidates
from edtk.design.interior_point.descend import inward
from edtk.design.problem import Problem
from edtk.design.region import FEASIBLE, Region, RegionPoints
from edtk.design.relaxation.incumbent import told_alike
from edtk.design.relaxation.proof import (
    experiment_blocks,
    is_normalised,
    normalised,
    rounding_of_inverse,
    safe_cost,
)
from edtk.design.relaxation.search_continuum import LargestSensitivities, ascend
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices

COMPASS_STEP = 3e-4  # parts of a range: the first step
SMALLER = 0.35  # a step in vain is followed by one of this part
COMPASS_ROUNDS = 20  # so that the last steps are of 1e-12
# A barrier holds points off the walls by about its accuracy over the slope, far below this part of
# a range.
AT_WALL = 1e-5
WALL_ROUNDS = 3  # Newton steps onto curved constraints
WALL_RIDGE = 1e-14  # keeps the steps finite where gradients of constraints are dependent
POINTS = 5000  # of a grid, at most, unless the caller says otherwise
MOST_POINTS = 10**6  # that a caller may ask for: each has rows and neighbours in memory
CORNERS = 10  # variables up to which all corners of the box are points: designs often lie there
PUSHED = 1000  # infeasible points that are moved onto the constraints, at most
NEAR_WALL = 0.01  # parts of a range up to which such points are moved
NEIGHBOURS = 30  # among which a point must be the best to begin an ascent
REGION_ASCENTS = 64  # ascents from points of the grid for each multiplier, at most
LEAST_REGION_ASCENTS = 16
ACCURACY = 1e-11  # relative, of a sensitivity at the end of an ascent
# Part by which the largest sensitivity is raised before it enters a bound: a maximum that an ascent
# has not quite reached must not make the bound too good. It covers ends on curved constraints.
MARGIN_OF_ASCENT = 1e-9
TOP = 0.01  # part below the largest sensitivity down to which ends of ascents climb on
# Distance in parts of a range below which two points become one, the boldest first. A relaxation
# over neighbouring points spreads a weight over them.
CLOSE = (0.03, 0.003, 3e-4, 0.0)
MET_POINT = 1e-5  # likewise, after a descent that has brought them together
# Relative increase of the cost at which fewer points are still welcome.
LOSS_FOR_FEWER_POINTS = 1e-9
NO_WEIGHT = 1e-7  # weight that is not worth a point
# Parts of the largest weight, the boldest first, below which weights may only keep a design regular
# that is best singular, and what dropping them may cost: there rounding blurs the cost.
LIGHT = (1e-3, 1e-4, 1e-5, 1e-6)
LOSS_OF_LIGHT = 1e-8
# Rounding of a cost that is far below all of these; more of it, so many times, counts as a loss.
ROUNDING_OF_COST = 1e-11
ROUNDINGS_OF_LOSS = 2.0
SAME_POINTS = 1e-6  # ratio of singular values below which points are one, to begin with
MOST_MOVED = 160  # a step takes their third power
ITERATIONS = 200
FINEST_LOGARITHM = 1e-16  # of the logarithm of the cost, at which to end
# Likewise of a level, which SLSQP also asks of what exceeds it: losses have more rounding than that
# of one logarithm, and below it line searches fail for the rest of all iterations.
FINEST_LEVEL = 1e-12
WORTHLESS = 1e3  # logarithm of the cost of a singular design, for the line search


def compass(region: Region, x: Array, value: Callable[[Array], Array]) -> Array:
    """Climb to and fro along the axes, with smaller and smaller steps, many points at once.

    Args:
        region: The region.
        x: Feasible points (n, d).
        value: Maps points (2d, n, d) to their values (2d, n), and (1, n, d) likewise.

    Returns:
        Feasible points (n, d), no lower than the given ones.
    """
    low, high = region.limits
    x = x.copy()
    best = value(x[None])[0]
    step = np.full(len(x), COMPASS_STEP)
    axes = np.concatenate([np.eye(region.size), -np.eye(region.size)])
    each = np.arange(len(x))
    for _ in range(COMPASS_ROUNDS):
        trials = x + step[:, None] * (axes * (high - low))[:, None]
        trials = np.clip(trials, low, high)
        values = np.where(region.at(trials).feasible, value(trials), -np.inf)
        top = values.argmax(axis=0)
        better = values[top, each] > best
        x[better] = trials[top, each][better]
        best = np.where(better, values[top, each], best)
        step = np.where(better, step, SMALLER * step)
    return x


def onto_walls(region: Region, x: Array, near: float = AT_WALL) -> Array:
    """Move points onto the bounds and constraints that they almost touch, by the shortest way.

    Args:
        region: The region.
        x: Points (n, d).
        near: Distance of what counts as almost, in parts of a range.

    Returns:
        Points (n, d), some of which may violate another constraint.
    """
    low, high = region.limits
    span = high - low
    before = (x - low) / span
    y = np.where(before < near, 0.0, np.where(before > 1 - near, 1.0, before))
    on_bound = (y == 0) | (y == 1)
    active = None
    for _ in range(WALL_ROUNDS):
        slack = region.slack_at(low + span * y)
        if not slack.shape[-1]:
            break
        G = region.slack_derivative_at(low + span * y) * span
        size = np.linalg.norm(G, axis=-1)
        if active is None:
            active = np.abs(slack) <= near * size
        # Points on a bound move along it.
        G = np.where(on_bound[:, None], 0.0, G) * active[..., None]
        K = G @ np.swapaxes(G, -1, -2)
        scale = np.maximum(np.trace(K, axis1=-2, axis2=-1), np.finfo(float).tiny)[:, None, None]
        K = K / scale + WALL_RIDGE * np.eye(K.shape[-1])
        push = np.linalg.solve(K, (np.where(active, -slack, 0.0) / scale[:, 0])[..., None])
        y = np.clip(y + (np.swapaxes(G, -1, -2) @ push)[..., 0], 0.0, 1.0)
    # The bounds and the points themselves, not what rounding makes of them.
    moved = np.where(y == before, x, low + span * y)
    return np.where(y == 0, low, np.where(y == 1, high, moved))


@dataclass(frozen=True, eq=False)
class RegionGrid:
    """Feasible points x (n, d) of a region, spread evenly.

    Attributes:
        region: The region.
        x: The points.
    """

    region: Region
    x: Array

    @classmethod
    def of(cls, region: Region, n: int = POINTS) -> "RegionGrid":
        """Lay a grid of at most about n points over the box and keep what is feasible.

        The levels of a variable are odd in number, so that the middle is one. Where a grid would
        have fewer than five, points of Sobol's sequence fill up what it leaves open. Infeasible
        points are moved onto the constraints, where optimal designs often lie.

        Raises:
            UserError: No point is feasible, or n is not from 2 to `MOST_POINTS`.
        """
        if not 2 <= n <= MOST_POINTS:
            message = f"expected 2 to {MOST_POINTS} points"
            raise ArgumentError(message, argument="candidates", given=n)
        low, high = region.limits
        x = low + (high - low) * _cube(region.size, n)
        slack = region.slack_at(x)
        feasible = (slack >= -FEASIBLE).all(axis=1)
        kept = [x[feasible]]
        outside = np.flatnonzero(~feasible)
        if len(outside):
            some = outside[np.linspace(0, len(outside) - 1, min(PUSHED, len(outside))).astype(int)]
            # They come to lie a margin inside, and from there on the walls themselves.
            moved = onto_walls(region, inward(region, x[some]), NEAR_WALL)
            kept.append(moved[region.at(moved).feasible])
        points = np.unique(np.concatenate(kept), axis=0)
        if not len(points):
            worst = int((slack < -FEASIBLE).sum(axis=0).argmax())
            raise UserError(
                f"no feasible point among {len(x)}; constraint {worst + 1} excludes "
                f"{np.mean(slack[:, worst] < -FEASIBLE):.0%} of them"
            )
        return cls(region, points)

    @cached_property
    def problem(self) -> Problem:
        """The points as candidates."""
        return self.region.problem(self.x)

    @cached_property
    def _neighbours(self) -> Indices:
        """Indices (n, k) of the points nearest to each, itself included."""
        from scipy.spatial import cKDTree

        low, high = self.region.limits
        y = (self.x - low) / (high - low)
        k = min(3**self.region.size, NEIGHBOURS, len(y))
        found = cKDTree(y).query(y, k)[1]
        return np.asarray(found).reshape(len(y), k)

    def best(self, values: Array, most: int) -> Array:
        """The points (k, d) of the largest values (n,)."""
        if len(values) <= most:
            return self.x
        return self.x[np.argpartition(-values, most)[:most]]

    def maxima(self, values: Array, most: int) -> Array:
        """The points (k, d) whose value (n,) no neighbour exceeds, the largest first."""
        best = np.flatnonzero(values >= values[self._neighbours].max(axis=1))
        order = np.argsort(-values[best], kind="stable")
        return self.x[best[order[:most]]]


def _cube(d: int, n: int) -> Array:
    """Points (m, d) of the unit cube: a grid, its corners, and Sobol's sequence."""
    levels = int(n ** (1 / d) + 1e-9)
    levels -= 1 - levels % 2
    parts = []
    if levels >= 3:
        parts.append(np.array(list(product(np.linspace(0, 1, levels), repeat=d))))
    elif d <= CORNERS:
        parts.append(np.array(list(product((0.0, 1.0), repeat=d))))
    if levels < 5:
        from scipy.stats import qmc

        power = max(1, int(np.ceil(np.log2(n / 2))))
        parts.append(qmc.Sobol(d, rng=np.random.default_rng(0)).random_base2(power))
    return np.concatenate(parts)


def search_region(
    grid: RegionGrid,
    criterion: Criterion,
    multipliers: Array,
    known: Array,
    margin: float = MARGIN_OF_ASCENT,
) -> tuple[LargestSensitivities, Candidates]:
    """Ascend the sensitivity from every local maximum on the grid, and from known points.

    Args:
        grid: The points where ascents may begin.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        known: Points (k, d) that the design rests on.
        margin: Part by which the largest sensitivities are raised.

    Returns:
        The largest sensitivities of grid and ascents, raised by a margin, and the points where the
        ascents ended. A search proves nothing: a peak between the points of the grid may be missed.
    """
    region = grid.region
    of_grid = normalised(grid.problem, criterion).sensitivities(multipliers)
    most = max(LEAST_REGION_ASCENTS, REGION_ASCENTS // len(multipliers))
    starts = [np.concatenate([grid.maxima(own, most), known]) for own in of_grid]
    owner = np.repeat(np.arange(len(multipliers)), [len(x) for x in starts])
    x = np.concatenate(starts)
    unit = np.abs(of_grid).max(axis=1)
    Z = multipliers[owner] / np.where(unit > 0, unit, 1.0)[owner, None, None]
    x = ascend(region, x, Z, is_normalised(criterion), accuracy=ACCURACY)
    x = _on_walls_where_better(region, criterion, x, Z)
    x = _top_climbed(region, criterion, x, Z, owner)
    found = Candidates(x, region.problem(x))
    ends = LargestSensitivities.over(found, criterion, multipliers)
    largest = ends.or_larger(LargestSensitivities.of(of_grid, grid.x))
    raised = largest.values + margin * np.abs(largest.values)
    return LargestSensitivities(raised, largest.x), found


def _top_climbed(region: Region, criterion: Criterion, x: Array, Z: Array, owner: Indices) -> Array:
    """Points (n, d), of which those of almost the largest sensitivity have climbed on by `compass`.

    Ascents follow derivatives, and stop short of a kink of the model.
    """
    values = _own(region, criterion, x[None], Z)[0]
    largest = np.full(owner.max() + 1, -np.inf)
    np.maximum.at(largest, owner, values)
    top = np.flatnonzero(values >= largest[owner] - TOP * np.abs(largest[owner]))
    moved = x.copy()
    moved[top] = compass(region, x[top], lambda trials: _own(region, criterion, trials, Z[top]))
    return moved


def _on_walls_where_better(region: Region, criterion: Criterion, x: Array, Z: Array) -> Array:
    """Points (n, d), on the walls that they almost touch unless that lowers the sensitivity."""
    moved = onto_walls(region, x)
    before, after = _own(region, criterion, np.stack([x, moved]), Z)
    better = region.at(moved).feasible & (after >= before)
    return np.where(better[:, None], moved, x)


def _own(region: Region, criterion: Criterion, x: Array, Z: Array) -> Array:
    """Sensitivities (b, n) of points (b, n, d), each to its own multiplier (n, p, p)."""
    A = region.at(x).regressor
    values = ((A @ Z) * A).sum(axis=(-2, -1))
    trace = np.square(A).sum(axis=(-2, -1))
    if region.prior is not None:
        values = values + np.tensordot(Z, region.prior, 2)
        trace = trace + np.trace(region.prior)
    if not is_normalised(criterion):
        return values
    return np.asarray(values / np.where(trace > 0, trace, 1.0))


def polish(
    region: Region, criterion: Relaxable, x: Array, weights: Array
) -> tuple[Array, Array, float]:
    """Merge points of a design that are close, and move points and weights to an optimum nearby.

    The logarithm of the cost is minimised over points and weights by sequential quadratic programs
    (SLSQP), with derivatives ``<G, M_i>`` by a weight and ``2 w_i <A_i G, dA_i>`` by a point. Where
    the cost is the largest of smooth losses, it is a level that none of their logarithms exceeds. A
    result counts only if its cost, computed anew, is not larger; so another kink of the criterion,
    where the programs fail, does no harm.

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
        if len(start) * (1 + region.size) <= MOST_MOVED:
            points, shares = _Descent(region, criterion, len(start)).end(start, share)
        else:
            points, shares = onto_walls(region, start), share
        # Points that have moved onto each other are one.
        points, shares = _merged(region, points, shares, MET_POINT)
        found = _cost(region, criterion, points, shares)
        if region.at(points).feasible.all() and found <= best[2] * (1 + LOSS_FOR_FEWER_POINTS):
            best = (points, shares, found)
            if found <= cost * (1 + LOSS_FOR_FEWER_POINTS):
                break
    return _without_light(region, criterion, best)


def _spanning(region: Region, c: Array, x: Array, weights: Array) -> tuple[Array, Array]:
    """Points (k, d), near some that all but tell ``c'k``, and weights (k,) that tell it exactly.

    They do where ``c = sum_i A_i' b_i``, and best with weights in proportion to ``|b_i|`` (Elfving
    1952). Best designs on fewer points than parameters are singular, and regular ones come as near
    as rounding lets them. Newton's steps of least norm for b and for what is off its bounds end on
    such a design, if one is near; else these weights tell nothing.
    """
    low, high = region.limits
    y = (x - low) / (high - low)
    is_free = (y > 0) & (y < 1)
    unit = np.sqrt(np.maximum(np.diag(region.problem(x).mean), np.finfo(float).tiny))
    c = c / unit
    b = np.zeros(0)
    before = np.inf
    for _ in range(ITERATIONS):  # five are the rule
        here = region.at(low + (high - low) * y)
        k, r, p = here.regressor.shape
        A = (here.regressor / unit).reshape(k * r, p)
        if not len(b):
            root = np.repeat(np.sqrt(weights), r)
            # What only the distance between close points tells is left to the steps.
            b = root * np.linalg.lstsq((root[:, None] * A).T, c, rcond=SAME_POINTS)[0]
        left = c - b @ A
        if not np.linalg.norm(left) < 0.5 * before:
            break  # what is missing is rounding, or stays
        before = float(np.linalg.norm(left))
        dA = here.derivative * ((high - low) / unit[:, None])
        by_point = np.einsum("kr,krpd->kdp", b.reshape(k, r), dA)[is_free]
        step = np.linalg.lstsq(np.concatenate([A, by_point]).T, left, rcond=None)[0]
        b = b + step[: len(A)]
        y[is_free] = np.clip(y[is_free] + step[len(A) :], 0.0, 1.0)
    shares = np.linalg.norm(b.reshape(k, r), axis=1)
    return low + (high - low) * y, shares / shares.sum()


def on_few(
    region: Region, criterion: Criterion, design: tuple[Array, Array, float]
) -> tuple[Array, Array, float]:
    """A design that tells the same of what counts on as few points as that needs, with its cost.

    Where its cost is blurred by rounding, it stays as it is.
    """
    x, weights, cost = design
    blocks = experiment_blocks(region.problem(x), np.arange(len(x)))
    for share in told_alike(criterion, blocks, weights):
        some = share > 0
        few = _cost(region, criterion, x[some], share[some])
        if few <= cost * (1 + LOSS_OF_LIGHT):
            return x[some], share[some], few
    return design


def with_cost(
    region: Region, criterion: Criterion, x: Array, weights: Array
) -> tuple[Array, Array, float]:
    """A design as `polish` gives one back, of which nothing moves."""
    return x, weights, _cost(region, criterion, x, weights)


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
    return cost if lost <= ROUNDING_OF_COST else cost * (1 + ROUNDINGS_OF_LOSS * lost)


def _without_light(
    region: Region, criterion: Criterion, design: tuple[Array, Array, float]
) -> tuple[Array, Array, float]:
    """The design without the weights that its cost hardly needs, the boldest choice first.

    Where one combination is asked for, close points become one that tells it exactly.
    """
    x, weights, cost = design
    K = criterion.K if isinstance(criterion, Interest) else np.empty((0, 0))
    is_one = K.shape[1] == 1
    before = 0
    for close, light in product(CLOSE if is_one else CLOSE[-1:], (*LIGHT, 0.0)):
        points, shares = _merged(region, x, weights, close)
        heavy = shares > light * shares.max()
        if heavy.sum() == before:
            continue
        before = heavy.sum()
        points = points[heavy]
        shares = shares[heavy] / shares[heavy].sum()
        if is_one:
            points, shares = _spanning(region, K[:, 0], points, shares)
        without = _cost(region, criterion, points, shares)
        if region.at(points).feasible.all() and without <= cost * (1 + LOSS_OF_LIGHT):
            return points, shares, without
    return design


def grouped(region: Region, x: Array, weights: Array, close: float) -> tuple[Indices, Indices]:
    """Points (k,) of x (n, d) that are farther apart than `close`, the heaviest first.

    Returns:
        Their indices (k,), and the number (n,) of the first of them that each point is close to.
    """
    low, high = region.limits
    y = (x - low) / (high - low)
    owner = np.full(len(x), -1)
    kept: list[int] = []
    for i in np.argsort(-weights, kind="stable").tolist():
        if owner[i] < 0:
            near = np.abs(y - y[i]).max(axis=1) <= close
            owner[near & (owner < 0)] = len(kept)
            kept.append(i)
    return np.array(kept, dtype=int), owner


def _merged(region: Region, x: Array, weights: Array, close: float) -> tuple[Array, Array]:
    """Points that are farther apart than `close`, each with the weight of those around it."""
    kept, owner = grouped(region, x, weights, close)
    share = np.bincount(owner, weights=weights, minlength=len(kept))
    sums = [np.bincount(owner, weights=weights * v) for v in x.T]
    mean = np.stack(sums, axis=1).astype(float) / share[:, None]
    # Between the points of a curved region there may be no point of it.
    inside = region.at(mean).feasible
    heavy = share > NO_WEIGHT
    points = np.where(inside[:, None], mean, x[kept])[heavy]
    return points, share[heavy] / share[heavy].sum()


@dataclass(frozen=True, eq=False)
class _Descent:
    """The optimisation of k points and their weights; variables are parts of their ranges."""

    region: Region
    criterion: Relaxable
    k: int

    @cached_property
    def _losses(self) -> Losses | None:
        """Smooth losses whose largest is the cost; None where the cost itself is smooth."""
        return self.criterion.largest_of(len(self.region.parameters))

    def end(self, x: Array, weights: Array) -> tuple[Array, Array]:
        """Points (k, d) on their walls, and weights (k,), after the descent."""
        from scipy.optimize import minimize

        low, high = self.region.limits
        start = np.concatenate([((x - low) / (high - low)).ravel(), weights])
        total = np.concatenate([np.zeros(x.size), np.ones(self.k)])
        rules = [{"type": "eq", "fun": lambda v: v @ total - 1, "jac": lambda v: total}]
        if self.region.slack_at(x).shape[-1]:
            rules.append({"type": "ineq", "fun": self._slack, "jac": self._slack_slope})
        options = {"ftol": FINEST_LOGARITHM, "maxiter": ITERATIONS}
        bounds = [(0.0, 1.0)] * len(start)
        if self._losses is None:
            found = minimize(
                self._value,
                start,
                jac=True,
                method="SLSQP",
                bounds=bounds,
                constraints=rules,
                options=options,
            ).x
        else:
            found = self._below_one_level(start, rules, options)
        if not np.isfinite(found).all():
            return x, weights
        points = onto_walls(self.region, self._points(found))
        shares = np.maximum(found[x.size :], 0.0)
        shares = np.where(shares > NO_WEIGHT, shares, 0.0)
        return points[shares > 0], shares[shares > 0] / shares.sum()

    def _below_one_level(self, start: Array, rules: list[Any], options: Any) -> Array:
        """The end for a cost with kinks: the least level that no loss exceeds, which is smooth."""
        from scipy.optimize import minimize

        @lru_cache(maxsize=2)
        def told(data: bytes) -> tuple[Array, Array]:
            return self._logs(np.frombuffer(data))

        def with_level(rule: Any) -> Any:
            def slope(v: Array) -> Array:
                own = np.atleast_2d(rule["jac"](v[:-1]))
                return np.column_stack([own, np.zeros(len(own))])

            return {"type": rule["type"], "fun": lambda v: rule["fun"](v[:-1]), "jac": slope}

        logs, _ = told(start.tobytes())
        if not np.isfinite(logs).all():
            return start
        below = {
            "type": "ineq",
            "fun": lambda v: v[-1] - told(v[:-1].tobytes())[0],
            "jac": lambda v: np.column_stack([-told(v[:-1].tobytes())[1], np.ones(len(logs))]),
        }
        level = np.append(np.zeros(len(start)), 1.0)
        return np.asarray(
            minimize(
                lambda v: v[-1],
                np.append(start, logs.max()),
                jac=lambda v: level,
                method="SLSQP",
                bounds=[(0.0, 1.0)] * len(start) + [(None, None)],
                constraints=[*map(with_level, rules), below],
                options={**options, "ftol": FINEST_LEVEL},
            ).x[:-1]
        )

    def _logs(self, v: Array) -> tuple[Array, Array]:
        """Logarithms (j,) of the losses, and their slopes (j, k d + k)."""
        assert self._losses is not None
        here = self.region.at(self._points(v)[None])
        w = np.maximum(v[-self.k :], 0.0)
        logs, G = self._losses.logs_and_slopes(here.information(w[None])[0])
        models = self._losses.models
        # A loss of one model has no slope by the others.
        parts = [slice(None)] * len(G) if models is None else models.parts
        slopes = [self._slope(here, w, -one, at) for one, at in zip(G, parts, strict=True)]
        return logs, np.array(slopes)

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
        return float(np.log(cost)), self._slope(here, w, G / cost)

    def _slope(self, here: RegionPoints, w: Array, G: Array, part: slice = slice(None)) -> Array:
        """Derivatives (k d + k) by points and weights of what has the gradient G (p, p) by M.

        G may be zero but for a part of the parameters.
        """
        low, high = self.region.limits
        A = here.regressor[..., part]
        G = G[part, part]
        weighted = A @ G
        by_weight = (weighted * A).sum(axis=(-1, -2))[0]
        if self.region.prior is not None:
            by_weight = by_weight + np.tensordot(G, self.region.prior[part, part], 2)
        by_point = 2 * w[:, None] * here.slope(weighted, part)[0] * (high - low)
        return np.concatenate([by_point.ravel(), by_weight])

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
