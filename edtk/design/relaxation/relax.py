"""Convex relaxation over discretised candidates: weights instead of whole numbers of experiments."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import whitener
from criteria.linalg.null_space import open_directions
from edtk.design.problem import Problem
from edtk.design.relaxation.restricted_master import (
    CHAIN,
    RelaxationError,
    RestrictedMaster,
    restricted_master_for,
)
from edtk.design.relaxation.sparse_weights import sparse_weights

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
Progress = Callable[[int, float], object]
FAR = 0.05  # relative gap above which a master is solved loosely
COARSE = 1e-3  # relative gap that a loosely solved master can prove
SAMPLE = 2000  # candidates among which the first active set is chosen


@dataclass(frozen=True, eq=False)
class Relaxation:
    """Weights of one experiment's worth of measurements, what they are worth, and the proof.

    Attributes:
        criterion: What was minimised.
        weights: Non-negative (n,), of sum one.
        cost: The criterion's cost of these weights.
        bound: No weights over these candidates have a lower cost.
        multipliers: What proves the bound (r, p, p), see `Relaxable.lower_bound`.
        solver: The solver whose answer this is.
        iterations: Number of masters that were solved.
    """

    criterion: Relaxable
    weights: Array
    cost: float
    bound: float
    multipliers: Array
    solver: str
    iterations: int

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost``; below zero by rounding at most."""
        return 1.0 - self.bound / self.cost

    @property
    def support(self) -> Indices:
        """Indices (k,) of the candidates that carry weight."""
        return np.flatnonzero(self.weights)

    def certify(self, problem: Problem) -> tuple[float, float]:
        """Cost and bound, computed anew from weights, multipliers and candidates alone."""
        M = problem.information(self.weights)
        tops = normalised(problem, self.criterion).sensitivities(self.multipliers).max(axis=-1)
        return float(self.criterion.cost(M)), self.criterion.lower_bound(self.multipliers, tops, M)


class RelaxationInterrupted(KeyboardInterrupt):
    """The user interrupted; `best` is the best certified design so far."""

    def __init__(self, best: Relaxation) -> None:
        super().__init__("interrupted")
        self.best = best


def relax(
    problem: Problem,
    criterion: Criterion,
    gap: float = 1e-6,
    rounds: int = 60,
    batch: int = 40,
    solvers: Sequence[str] = CHAIN,
    progress: Progress = lambda iterations, gap: None,
    multipliers: Array | None = None,
) -> Relaxation:
    """Minimise the criterion's cost over the weights of all candidates, by restricted masters and pricing.

    cvxpy solves a small master over the active candidates; the multiplier Z of ``M == sum w_i M_i`` prices all of
    them by ``<Z, M_i>`` in one matrix product, the dearest join, those without weight leave. Every design obeys
    ``<Z, M> <= t = max <Z, M_i>``, whence a bound on its cost (`Relaxable.lower_bound`). Whatever a solver says of its
    answer, cost and bound are computed anew from weights and multiplier, and the best of each is returned.
    Where an answer is too inaccurate for the gap, the next solver has its turn, and last the weights are polished.

    A criterion that is the least of a family of convex ones (O4) is solved member by member; the bound is proved
    for all designs nevertheless.

    Args:
        problem: The candidates.
        criterion: A criterion with a convex form.
        gap: Relative gap to stop at. The one that was reached may be larger, and is the result's.
        rounds: Limit on the number of masters per convex problem.
        batch: Candidates that join per round.
        solvers: Names from `CHAIN`, the first to be tried first.
        progress: Called with the number of masters so far and the gap.
        multipliers: Multipliers (r, p, p) of a like problem, for a family to start from.

    Raises:
        ValueError: An unknown solver, or rounds or batch below one.
        RankDeficientError: The candidates cannot identify all parameters; names the directions.
        RelaxationError: No solver found a design.
        NotImplementedError: The criterion has no convex form.
        RelaxationInterrupted: Ctrl-C after a first certified design, which it carries.
    """
    if unknown := [solver for solver in solvers if solver not in CHAIN]:
        raise ValueError(f"unknown solver {unknown[0]!r}; available: {', '.join(CHAIN)}")
    if rounds < 1 or batch < 1 or not solvers:
        raise ValueError("rounds and batch must be at least one, and there must be a solver")
    criterion = require_relaxable(criterion)
    problem.require_identifiable()
    scaled = normalised(problem, criterion)
    best = _Incumbent(scaled, criterion, multipliers)
    try:
        alone = criterion.most_subproblems == 1
        for _ in range(criterion.most_subproblems):
            member, before = criterion.subproblem(best.multipliers, best.tops, best.M), best.bound
            earlier = (
                (best.multipliers[:0], best.tops[:0]) if alone else (best.multipliers, best.tops)
            )
            for step in _generate(
                scaled, member, best.active, gap if alone else gap / 4, rounds, batch, solvers
            ):
                best.meet(step, *earlier)
                progress(best.iterations, 1 - best.bound / best.cost)
            if 1 - best.bound / best.cost <= gap or 0 < best.bound <= before:
                break
    except KeyboardInterrupt as interrupt:
        if best.iterations:
            raise RelaxationInterrupted(best.result(problem, gap)) from interrupt
        raise
    return best.result(problem, gap)


def require_relaxable(criterion: Criterion) -> Relaxable:
    """The criterion, if the relaxation can minimise it.

    Raises:
        NotImplementedError: The criterion has no convex form.
    """
    if not isinstance(criterion, Relaxable):
        raise NotImplementedError(f"criterion {criterion.name} has no convex form to relax")
    return criterion


def normalised(problem: Problem, criterion: Criterion) -> Problem:
    """The problem in which a design is judged: for a criterion of degree zero, all candidates have unit trace."""
    return problem.with_unit_trace() if criterion.degree == 0 else problem


@dataclass(frozen=True, eq=False)
class _Step:
    """One master: its weights over the active candidates, and the multiplier with its dearest price."""

    active: Indices
    weights: Array
    M: Array
    multiplier: Array
    top: float
    solver: str


class _Incumbent:
    """The best design and the best proof so far."""

    def __init__(self, problem: Problem, criterion: Relaxable, multipliers: Array | None) -> None:
        self.criterion = criterion
        self.cost, self.bound, self.solver, self.iterations = np.inf, 0.0, "", 0
        self.active, self.weights = np.empty(0, dtype=int), np.empty(0)
        self.M = problem.mean
        self.multipliers = (
            np.empty((0, problem.p, problem.p)) if multipliers is None else multipliers
        )
        self.tops = problem.sensitivities(self.multipliers).max(axis=-1)

    def meet(self, step: _Step, multipliers: Array, tops: Array) -> None:
        """Take what is better of a step: its design, and its proof beside those of earlier members of a family."""
        self.iterations += 1
        if (cost := float(self.criterion.cost(step.M))) < self.cost:
            self.cost, self.M, self.solver = cost, step.M, step.solver
            self.active, self.weights = step.active, step.weights
        Z, t = np.concatenate([multipliers, step.multiplier[None]]), np.append(tops, step.top)
        lower_bound = self.criterion.lower_bound(Z, t, step.M)
        if lower_bound >= self.bound:
            self.multipliers, self.tops, self.bound = Z, t, lower_bound

    def _cost(self, problem: Problem, weights: Array) -> float:
        """Cost of weights over the active candidates."""
        return float(
            self.criterion.cost(np.tensordot(weights, problem.blocks(self.active), axes=1))
        )

    def result(self, problem: Problem, gap: float) -> Relaxation:
        """The relaxation, its weights those of the candidates as they were given."""
        w = self.weights
        if self.criterion.degree == 0:
            trace = np.trace(problem.blocks(self.active), axis1=1, axis2=2)
            w = np.divide(w, trace, out=np.zeros_like(w), where=trace > 0)
        w = w / w.sum()
        few = sparse_weights(problem.packed[:, self.active], w)
        if self._cost(problem, few) <= self._cost(problem, w) * (1 + 0.01 * gap):
            w = few
        weights = np.zeros(problem.n)
        weights[self.active] = w
        cost = float(self.criterion.cost(problem.information(weights)))
        Z, t = self.multipliers, self.tops
        bound = max(self.bound, self.criterion.lower_bound(Z, t, self.M))
        for j in range(
            len(t) - 1, -1, -1
        ):  # fewer multipliers that close the gap as well, if there are
            rest = np.delete(Z, j, 0), np.delete(t, j)
            if len(t) > 1 and (lower_bound := self.criterion.lower_bound(*rest, self.M)) >= min(
                bound, (1 - gap) * cost
            ):
                Z, t, bound = *rest, lower_bound
        return Relaxation(self.criterion, weights, cost, bound, Z, self.solver, self.iterations)


def _generate(
    problem: Problem,
    criterion: Relaxable,
    active: Indices,
    gap: float,
    rounds: int,
    batch: int,
    solvers: Sequence[str],
) -> Iterator[_Step]:
    """Column generation for one convex criterion, step by step, from an active set."""
    incumbent = len(active) > 0
    active = active if incumbent else _spread(problem, batch)
    around, chain = problem.blocks(active).mean(axis=0), list(solvers)
    bound, cost, proof, loose = 0.0, np.inf, None, criterion.convex and len(active) < problem.n
    for _ in range(rounds):
        master = restricted_master_for(criterion, around, max(2 * batch, len(active)))
        try:
            weights, Z, solver = _first_answer(master, problem.blocks(active), chain, loose)
        except RelaxationError:
            if cost < np.inf or incumbent:
                return  # with what there is
            raise
        M = np.tensordot(weights, problem.blocks(active), axes=1)
        trials = _multipliers(criterion, M, Z)
        sensitivities = problem.sensitivities(trials)
        tops = sensitivities.max(axis=-1)
        floors = np.array(
            [criterion.lower_bound(Z[None], t[None], M) for Z, t in zip(trials, tops, strict=True)]
        )
        floors = np.where(np.isfinite(floors), np.maximum(floors, 0.0), 0.0)
        j, kept = int(np.argmax(floors)), weights > 0
        if proof is None or floors[j] > bound:
            bound, proof = floors[j], (trials[j], float(tops[j]))
        yield _Step(active[kept], weights[kept], M, *proof, solver)
        cost = min(cost, float(criterion.cost(M)))
        if 1 - bound / cost <= gap and (gap >= COARSE or not loose):
            return
        newcomers = _dearest(sensitivities[j], active, batch)
        inaccurate = (
            sensitivities[j].argmax() in active
        )  # the master was not solved as the gap asks
        if inaccurate and not loose:
            chain = chain[chain.index(solver) + 1 :]
            if not chain:
                return
        loose = loose and not inaccurate and 1 - bound / cost > FAR
        active = np.concatenate([active[kept], newcomers])
        around = M if not len(newcomers) else 0.5 * (M + problem.blocks(newcomers).mean(axis=0))


def _first_answer(
    master: RestrictedMaster, blocks: Array, chain: Sequence[str], loose: bool
) -> tuple[Array, Array, str]:
    """Weights and multiplier from the first solver of the chain that has an answer."""
    failures = []
    for solver in chain:
        try:
            return *master.solve(blocks, solver, loose), solver
        except RelaxationError as error:
            failures.append(str(error))
    raise RelaxationError(
        f"no solver found a design for criterion {master.criterion.name} ({'; '.join(failures)})"
    )


def _multipliers(criterion: Criterion, M: Array, Z: Array) -> Array:
    """Multipliers to try (r, p, p): the solver's, and where the criterion is smooth minus the gradient at M.

    For a monotone criterion a multiplier must be positive semidefinite, and negative eigenvalues are the solver's
    inaccuracy; they are cut off in the parameters that whiten M.
    """
    if criterion.monotone:
        T = whitener(M)
        S = np.linalg.inv(T)
        z, V = np.linalg.eigh(S @ Z @ S.T)
        Z = T @ (V * np.maximum(z, 0.0)) @ V.T @ T.T
    return np.stack([Z, -criterion.gradient(M)]) if criterion.smooth else Z[None]


def _dearest(sensitivities: Array, active: Indices, batch: int) -> Indices:
    """Indices of dear candidates that are not active, at most `batch`, the dearest first.

    A quarter are the dearest of all, which are often alike; the others are the dearest of as many equal parts of the
    candidates, where these are many.
    """

    def newcomers(chosen: Indices) -> Indices:
        chosen = np.setdiff1d(chosen, active)
        return chosen[np.argsort(-sensitivities[chosen], kind="stable")]

    size = min(batch + len(active), len(sensitivities))
    top = newcomers(np.argpartition(-sensitivities, size - 1)[:size])
    if (parts := 3 * batch // 4) and len(sensitivities) >= 20 * batch:
        width = len(sensitivities) // parts
        spread = sensitivities[: width * parts].reshape(parts, width).argmax(
            axis=1
        ) + width * np.arange(parts)
        top = newcomers(np.union1d(top[: batch - parts], spread))
    return top[:batch]


def _spread(problem: Problem, batch: int) -> Indices:
    """A first active set that identifies every parameter: greedily, the candidate of the largest gain in det.

    The choice is among an evenly spaced sample of the candidates, or all of them if that leaves a direction open.
    """
    sample = np.unique(np.linspace(0, problem.n - 1, SAMPLE).astype(int))
    for chosen in (sample, np.arange(problem.n)):
        part = (
            Problem.of_information(problem.packed[:, chosen])
            if len(chosen) < problem.n
            else problem
        )
        active: list[int] = []
        M = 1e-6 * problem.mean
        for _ in range(min(max(batch, problem.p), part.n)):
            gain = part.sensitivities(np.linalg.inv(M))
            gain[active] = -np.inf
            active.append(int(gain.argmax()))
            M = M + part.blocks(active[-1])
        if not open_directions(part.blocks(active).mean(axis=0), problem.parameters):
            break
    return chosen[active]
