"""The best design and the best proof so far, on as few support points as it needs."""

from collections.abc import Callable
from functools import partial

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.estimable import range_whitener
from criteria.linalg.inverse import ROUNDING, root
from criteria.linalg.typing import triangle
from edtk.design.bound import Bound, BoundKind
from edtk.design.information import order, pack
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import (
    Step,
    WarmStart,
    experiment_blocks,
    original_weights,
    rounding_of_inverse,
    safe_cost,
)
from edtk.design.relaxation.relaxation import Relaxation
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

# Candidates whose weights move at a time, in parts of the equations: null vectors of more would
# take memory, and those of fewer be searched for anew too often.
WEIGHTS_AT_ONCE = 2
# Part of the gap that the cost may grow by when support points are dropped: far below what is
# asked for, far above rounding.
SPARSE_LOSS = 0.01
# Parts of the largest weight below which weights are dropped from a design that may be singular,
# the boldest first. Near the singular design rounding blurs its cost by some 1e-8.
LIGHT = (1e-3, 1e-4, 1e-5, 1e-6)
HEAVY_LOSS = 0.1


def sparse_weights(packed: Array, weights: Array) -> Array:
    """Weights of the same design on at most ``p(p+1)/2 + 1`` candidates (Caratheodory).

    The weights that give ``sum_i w_i M_i = M`` form a polytope. A vertex of it has no more positive
    entries than the rank of the equations, which may be far below their number. The weights go from
    face to face along null vectors of the equations, and lose a candidate at each; the heaviest
    candidates are the last to join, and rarely go.

    Args:
        packed: Information of the candidates (p(p+1)/2, k), see `edtk.design.information`.
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,). They are the given ones where these are few enough; on more candidates than
        needed where the time is over.
    """
    return _fewest(_equations(packed, weights), weights)


def told_alike(criterion: Criterion, blocks: Array, weights: Array) -> list[Array]:
    """Weights that tell combinations K'k alike, on fewer candidates than the same M needs.

    A cost of the covariance V of K'k has the gradient ``-F'F`` with ``F = S K'cov`` for some S, so
    that ``F M = S K'``. Another design N with ``F N = F M`` has ``S K' N^- K S' = F N N^- N F' =
    F M F'``, which is the same V. These are s p equations for s combinations, where M has p(p+1)/2.
    At the optimum of one combination all sensitivities ``F M_i F'`` are alike, so that the sum of
    the weights follows: p candidates are enough (Elfving). Elsewhere it is one more equation.

    Args:
        criterion: What the weights minimise.
        blocks: Information M_i (k, p, p) of the candidates.
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,) of sum one, first on as few candidates as an optimum needs; none where the
        criterion needs all parameters.
    """
    if criterion.needs_all or not criterion.smooth:
        return []
    F = root(-criterion.gradient(np.tensordot(weights, blocks, axes=1)))
    sizes = np.square(F).sum(axis=1)
    F = F[sizes > len(F) * ROUNDING * sizes.max()]
    A = (F @ blocks).reshape(len(blocks), -1).T
    size = np.abs(A) @ weights
    A = A[size > 0] / size[size > 0, None]
    p = blocks.shape[1]
    if len(A) >= p * (p + 1) // 2:
        return []
    with_sum = np.vstack([A, np.ones(len(weights))])
    return [_fewest(equations, weights) for equations in (A, with_sum)]


def first_as_good(
    criterion: Criterion, blocks: Array, weights: Array, others: list[Array], loss: float
) -> Array:
    """The first of other weights (k,) that cost no more than some, or these.

    Args:
        criterion: What is minimised.
        blocks: Information (k, p, p) of the candidates.
        weights: Their weights (k,).
        others: Weights that are as good but for rounding, which near a singular design is large.
        loss: Part of the cost that may be lost.
    """
    if all(each is weights for each in others):
        return weights
    M = np.tensordot(weights, blocks, axes=1)
    rounding = rounding_of_inverse(M, np.square(range_whitener(M)).sum(axis=1))
    enough = safe_cost(criterion, M) * (1 + max(loss, rounding))
    costs = (safe_cost(criterion, np.tensordot(each, blocks, axes=1)) for each in others)
    return next((each for each, cost in zip(others, costs, strict=True) if cost <= enough), weights)


def _fewest(A: Array, weights: Array) -> Array:
    """Weights (k,) of the same ``A w``, for equations A (q, k), on few candidates."""
    if len(weights) <= len(A):
        return weights
    w = weights.copy()
    inside = np.empty(0, dtype=int)
    waiting = np.argsort(w, kind="stable")
    while len(waiting) and not out_of_time():
        joining = WEIGHTS_AT_ONCE * len(A) - len(inside)
        inside = np.concatenate([inside, waiting[:joining]])
        waiting = waiting[joining:]
        w[inside] = _vertex(A[:, inside], w[inside])
        inside = inside[w[inside] > 0]
    return np.asarray(w / w.sum())


def _equations(packed: Array, weights: Array) -> Array:
    """Equations (q, k) of a design, of order one whatever the units of the parameters."""
    rows, columns = triangle(order(len(packed)))
    root = np.sqrt((packed @ weights)[rows == columns])
    # A parameter may be known from the prior alone: no candidate then contributes to its equations.
    root = np.where(root > 0, root, 1.0)
    scaled = packed / (root[rows] * root[columns])[:, None]
    return np.vstack([scaled, np.ones(len(weights))])


def _vertex(A: Array, weights: Array) -> Array:
    """Weights (k,) of the same ``A w``, for A (q, k), no more of them positive than its rank.

    Weights move along a null vector until one of them is gone. A reflection of the orthonormal null
    vectors (Householder's) leaves that candidate to one of them alone, which is dropped.
    """
    w = weights.copy()
    left = np.arange(len(w))
    N = _null_vectors(A)
    while N.shape[1] and not out_of_time():
        reach = np.linalg.norm(N, axis=1)
        # The candidate that is gone first if the weights take the straightest way to that.
        lightest = int(_quotient(w[left], reach).argmin())
        along = N @ (N[lightest] / reach[lightest])
        steps = _quotient(w[left], along)
        gone = int(steps.argmin())
        w[left] -= steps[gone] * along
        w[left[gone]] = 0.0
        N = np.delete(_reflected(N, gone), gone, axis=0)[:, 1:]
        left = np.delete(left, gone)
    return np.maximum(w, 0.0)


def _null_vectors(A: Array) -> Array:
    """Orthonormal null vectors (k, k - rank) of A (q, k)."""
    from scipy.linalg import qr

    Q, R, _ = qr(A.T, pivoting=True)
    sizes = np.abs(np.diag(R))
    rank = int((sizes > max(A.shape) * np.finfo(float).eps * sizes[0]).sum())
    return np.asarray(Q[:, rank:])


def _quotient(w: Array, by: Array) -> Array:
    """Steps (k,) after which weights that fall at some rates are zero; inf where they do not."""
    return np.divide(w, by, out=np.full(len(w), np.inf), where=by > 0)


def _reflected(N: Array, row: int) -> Array:
    """Columns N (k, q), reflected so that all but the first have no entry in a row."""
    v = N[row].copy()
    v[0] += np.copysign(np.linalg.norm(v), v[0])
    return N - np.outer(N @ v, v * (2 / (v @ v)))


class Incumbent:
    """The best design and the best proof so far; they may come from different steps.

    Args:
        problem: The candidates, see `normalised`.
        criterion: What is minimised.
        multipliers: Multipliers (r, p, p) of a like problem to begin with, or None.
    """

    def __init__(self, problem: Problem, criterion: Relaxable, multipliers: Array | None) -> None:
        self.problem = problem
        self.criterion = criterion
        self.iterations = 0
        self.cost = np.inf
        self.active = np.empty(0, dtype=int)
        self.weights = np.empty(0)
        self.last = WarmStart.none()
        self.M = problem.mean
        self.solver = ""
        nothing = np.empty((0, problem.p, problem.p))
        self.multipliers = nothing if multipliers is None else multipliers
        self.largest = problem.sensitivities(self.multipliers).max(axis=-1)
        self.lower_bound = 0.0

    @property
    def gap(self) -> float:
        """Relative gap between the best cost and the best bound."""
        return 1 - self.lower_bound / self.cost

    def update(self, step: Step, multipliers: Array, largest: Array) -> None:
        """Take over what is better of a step: its design, its proof, or both.

        Args:
            step: The step.
            multipliers: Multipliers (r, p, p) that hold beside the step's own.
            largest: The largest sensitivities (r,) to them.
        """
        self.iterations += 1
        self.last = step.last
        # A step of a family's member tells neither cost nor bound of the family.
        is_family = self.criterion.most_subproblems > 1
        cost = float(self.criterion.cost(step.M)) if is_family else step.cost
        if cost < self.cost:
            self.cost = cost
            self.M = step.M
            self.active = step.active
            self.weights = step.weights
            self.solver = step.solver
        multipliers = np.concatenate([multipliers, step.proof.multiplier[None]])
        largest = np.append(largest, step.proof.largest)
        lower_bound = step.proof.lower_bound
        if is_family:
            lower_bound = self.criterion.lower_bound(multipliers, largest, step.M)
        if lower_bound >= self.lower_bound:
            self.multipliers = multipliers
            self.largest = largest
            self.lower_bound = lower_bound

    def update_from(
        self, part: "Incumbent", chosen: Indices, gap: float, shall_end: bool
    ) -> Callable[[], Array]:
        """Take over what is better of the same relaxation over some of the candidates.

        Args:
            part: The incumbent of the candidates chosen.
            chosen: Their indices (k,).
            gap: Relative gap to which the part was solved.
            shall_end: Whether the sensitivities will hardly be asked for.

        Returns:
            Tells the sensitivities (r, n) of all candidates to the multipliers that prove the
            part's bound.
        """
        self.iterations += part.iterations
        if part.cost < self.cost:
            self.cost = part.cost
            self.M = part.M
            self.active = chosen[part.active]
            self.weights = part.weights
            self.solver = part.solver
        multipliers, _ = part._final_multipliers((1 - gap) * part.cost)
        if shall_end:
            largest = self.problem.largest_sensitivities(multipliers)
            sensitivities = partial(self.problem.sensitivities, multipliers)
        else:
            found = self.problem.sensitivities(multipliers)
            largest = found.max(axis=-1)
            sensitivities = partial(np.asarray, found)
        lower_bound = self.criterion.lower_bound(multipliers, largest, part.M)
        if lower_bound >= self.lower_bound:
            self.multipliers = multipliers
            self.largest = largest
            self.lower_bound = lower_bound
        return sensitivities

    def relaxation(self, problem: Problem, gap: float, few: bool = True) -> Relaxation:
        """The result, with weights of the candidates as they were given.

        Args:
            problem: The candidates as they were given, not normalised.
            gap: Relative gap that was asked for.
            few: See `SolverOptions`.
        """
        weights = np.zeros(problem.n)
        weights[self.active] = self._final_weights(problem, gap, few)
        cost = float(self.criterion.cost(problem.information(weights)))
        multipliers, lower_bound = self._final_multipliers((1 - gap) * cost)
        return Relaxation(
            criterion=self.criterion,
            weights=weights,
            cost=cost,
            proved_bound=Bound.of(
                self.criterion, lower_bound, cost, BoundKind.PROVED_ON_CANDIDATES
            ),
            multipliers=multipliers,
            solver=self.solver,
            iterations=self.iterations,
        )

    def _final_weights(self, problem: Problem, gap: float, few: bool) -> Array:
        """Weights (k,) of the active candidates as they were given, on as few as are needed."""
        weights = original_weights(problem, self.criterion, self.active, self.weights)
        blocks = experiment_blocks(problem, self.active)
        alike = [sparse_weights(pack(problem.blocks(self.active)), weights)]
        if few:
            alike = [*told_alike(self.criterion, blocks, weights), *alike]
        found = first_as_good(self.criterion, blocks, weights, alike, SPARSE_LOSS * gap)
        return found if self.criterion.needs_all else self._heavy(found, blocks, gap)

    def _heavy(self, weights: Array, blocks: Array, gap: float) -> Array:
        """Weights (k,) without those that only kept a singular design regular on the way to it."""
        # Near a singular design rounding may tell a cost below the bound, which no design has.
        cost = float(self.criterion.cost(np.tensordot(weights, blocks, axes=1)))
        cost = max(cost, self.lower_bound)
        for light in LIGHT:
            heavy = np.where(weights > light * weights.max(), weights, 0.0)
            heavy /= heavy.sum()
            cost_of_heavy = safe_cost(self.criterion, np.tensordot(heavy, blocks, axes=1))
            if cost_of_heavy <= cost * (1 + HEAVY_LOSS * gap):
                return heavy
        return weights

    def _final_multipliers(self, enough: float) -> tuple[Array, float]:
        """Multipliers without those that the bound does not need, the latest dropped first.

        Args:
            enough: A lower bound that is as good as the best one.

        Returns:
            Multipliers (r, p, p), and the bound that they prove.
        """
        Z = self.multipliers
        t = self.largest
        lower_bound = max(self.lower_bound, self.criterion.lower_bound(Z, t, self.M))
        for j in range(len(t) - 1, -1, -1):
            if len(t) == 1:
                break
            fewer_Z = np.delete(Z, j, 0)
            fewer_t = np.delete(t, j)
            without = self.criterion.lower_bound(fewer_Z, fewer_t, self.M)
            if without >= min(lower_bound, enough):
                Z = fewer_Z
                t = fewer_t
                lower_bound = without
        return Z, lower_bound
