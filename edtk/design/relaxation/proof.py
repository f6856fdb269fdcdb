"""Why no weights have a lower cost: multipliers, and the digits that rounding leaves."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import EPS, ROUNDING, eigenpairs, unit_scale, whitener
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices

NO_PART = 1e-13  # part of a combination that an open direction may have by rounding alone


def is_normalised(criterion: Criterion) -> bool:
    """Whether designs are compared at unit trace, because the cost has degree zero.

    Such a cost does not depend on the length of M, so that no bound on ``<Z, M>`` tells anything
    about it. Among designs of unit trace a bound does, and these are means of candidates of unit
    trace, with other weights than the design itself.
    """
    return criterion.degree == 0


def normalised(problem: Problem, criterion: Criterion) -> Problem:
    """The problem that the relaxation solves and whose sensitivities prove its bound.

    Args:
        problem: The candidates as they are.
        criterion: Tells whether candidates must have unit trace, see `is_normalised`.

    Returns:
        The problem itself, or the one of candidates of unit trace.
    """
    return problem.with_unit_trace(criterion.trace_root) if is_normalised(criterion) else problem


def trace_matrix(criterion: Criterion, p: int) -> Array:
    """The matrix P (p, p) of the trace ``<P, M>`` that candidates are brought to, ``B B'``."""
    B = criterion.trace_root
    return np.eye(p) if B is None else np.asarray(B @ B.T)


def original_weights(
    problem: Problem, criterion: Criterion, chosen: Indices, weights: Array
) -> Array:
    """Weights of the candidates as they are, from those of the normalised problem.

    Args:
        problem: The candidates as they are.
        criterion: What the weights minimise.
        chosen: Indices (k,) of the candidates that have weights.
        weights: Weights (k,) in the normalised problem.

    Returns:
        Weights (k,) of sum one, of a design whose information has the same direction.
    """
    if is_normalised(criterion):
        trace = problem[chosen].traces(criterion.trace_root)
        weights = np.divide(weights, trace, out=np.zeros_like(weights), where=trace > 0)
    return weights / weights.sum()


def experiment_blocks(problem: Problem, chosen: Indices) -> Array:
    """Information ``M0 + A_i' A_i / sigma^2`` (k, p, p) of one experiment in some candidates each.

    Weights of sum one make of them the information matrix of a design, the prior M0 included. The
    candidates alone are `Problem.blocks`.

    Args:
        problem: The candidates, and the prior information per experiment.
        chosen: Indices (k,) of the candidates.
    """
    blocks = problem.blocks(chosen)
    return blocks if problem.prior is None else blocks + problem.prior


def experiment_entries(problem: Problem, chosen: Indices) -> Array:
    """The same (k, e) of several models: the entries of their blocks alone, see `Models.entries`.

    Args:
        problem: The candidates, and prior information that is block diagonal.
        chosen: Indices (k,) of the candidates.
    """
    entries = problem.kept.entries(chosen)
    return entries if problem.prior is None else entries + problem.prior[problem.models.entries]


@dataclass(frozen=True, eq=False)
class InnerProof:
    """Multipliers Z' of the information about parameters k' with ``k = T k'``.

    As multipliers of k they are ``T Z' T'``. Where parameters are nearly dependent, these entries
    cancel in every sensitivity, and only T and Z' apart keep the digits.

    Attributes:
        T: Regular matrix (p, p).
        Z: Symmetric multipliers (r, p, p).
    """

    T: Array
    Z: Array

    def outward(self) -> Array:
        """The multipliers (r, p, p) of k."""
        found = self.T @ self.Z @ self.T.T
        return np.asarray(0.5 * (found + np.swapaxes(found, 1, 2)))


@dataclass(frozen=True, eq=False)
class Proof:
    """A bound on the cost of all weights of the candidates.

    Attributes:
        multiplier: A multiplier Z (p, p).
        largest: The largest sensitivity ``<Z, M_i>`` of a candidate to it.
        lower_bound: The bound on the cost that both prove.
    """

    multiplier: Array
    largest: float
    lower_bound: float

    @classmethod
    def of(
        cls,
        problem: Problem,
        criterion: Relaxable,
        M: Array,
        tried: Sequence[Array],
        enough: float = np.inf,
    ) -> "tuple[Proof, Array]":
        """Find what multipliers prove near a design.

        Args:
            problem: The candidates (n).
            criterion: What is minimised.
            M: The design (p, p).
            tried: Multipliers (p, p): minus the gradient at M of a smooth cost, and a solver's.
            enough: A bound with which no other multiplier is tried.

        Returns:
            The best proof, and the sensitivities (n,) of all candidates to its multiplier.
        """
        found: list[tuple[Proof, Array]] = []
        for Z in _trial_multipliers(criterion, M, tried):
            sensitivities = problem.sensitivities(Z)
            largest = sensitivities.max(keepdims=True)
            bound = criterion.lower_bound(Z[None], largest, M)
            # A solver's multiplier may be so far off that its bound is negative or not a number.
            bound = max(bound, 0.0) if np.isfinite(bound) else 0.0
            found.append((cls(Z, float(largest[0]), float(bound)), sensitivities))
            if bound >= enough:
                break
        return max(found, key=lambda each: each[0].lower_bound)


def _trial_multipliers(criterion: Relaxable, M: Array, tried: Sequence[Array]) -> Iterator[Array]:
    """Those of multipliers (p, p) that are numbers, as what they should be but for rounding.

    A gradient may be no number where M is all but singular, as the best design for a part of the
    parameters may be. Without another one the inverse is tried: any multiplier proves something.
    """
    T = whitener(M)
    trials = [trial for trial in tried if np.isfinite(trial).all()]
    for trial in trials or [T @ T.T]:
        # A small difference of large parts may be symmetric only to the rounding of the parts.
        Z = 0.5 * (trial + trial.T)
        yield _semidefinite(Z, T) if criterion.monotone else Z


def _semidefinite(Z: Array, T: Array) -> Array:
    """A multiplier (p, p) without what rounding or a solver's inaccuracy has left.

    A multiplier of a monotone criterion must be positive semidefinite. Its negative eigenvalues are
    cut off in the parameters that T whitens, where they are small beside the others. A parameter of
    which it has a rounding of zero gets zeros: other units would make that of order one.
    """
    S = np.linalg.inv(T)
    z, V = eigenpairs(S @ Z @ S.T)
    if z[0] < 0:
        F = T @ V * np.sqrt(np.maximum(z, 0.0))
        Z = F @ F.T
    rounding = len(Z) * ROUNDING * z[-1] * np.square(T).sum(axis=1)
    has_some = np.diag(Z) > rounding
    return np.where(has_some[:, None] & has_some, Z, 0.0)


def rounding_of_inverse(M: Array, variances: Array) -> float:
    """About the relative error of a cost that is computed from the inverse of a design.

    An inverse has entries of the size of the largest variance, and so has its rounding.
    Combinations that are told well lose these digits where others are all but open: with R = M at
    unit diagonal, about ``eps trace(R^-1)`` of their variances.

    Args:
        M: Design (p, p).
        variances: The diagonal (p,) of its inverse.
    """
    return EPS * float(np.diag(M) @ variances)


def safe_cost(criterion: Criterion, M: Array) -> float:
    """The cost of a design M (p, p), not below that of a regular design close to it.

    An inverse of a singular M leaves open directions out. Where a combination c of interest has a
    part a along such a direction v, beyond rounding, c is not told at all. With a little weight e
    elsewhere the cost C becomes about ``C (1 + e) + a^2/e``, which is least at ``C + 2 a C^(1/2)``;
    at unit diagonal ``C >= |c|^2/p``, so that C is too low by at most the part ``2 p^(1/2) a/|c|``.

    Args:
        criterion: What is minimised.
        M: The design (p, p).
    """
    cost = float(criterion.cost(M))
    if criterion.needs_all or not np.isfinite(cost):
        return cost
    strayed = criterion.strayed(M)
    return cost if strayed <= NO_PART else cost * (1 + 2 * len(M) ** 0.5 * strayed)


def errors(
    problem: Problem,
    criterion: Criterion,
    weights: Array | None,
    multipliers: Array,
    rounding: Array | None = None,
    of_squares: bool = False,
    design: Array | None = None,
) -> tuple[float, float]:
    """Bound the relative errors that rounding makes in a cost and in its lower bound.

    *Cost.* Let W whiten the part of the design M that counts, ``W'M W = I``, and let M be wrong by
    dM. With ``delta = |W' dM W|`` the true matrix is between ``(1 - delta) M`` and
    ``(1 + delta) M``, and a monotone cost of degree d is wrong by the factor ``(1 + delta)^d`` at
    most. An entry of dM is a rounding of a sum of products, below ``p eps (M_ii M_jj)^(1/2)``;
    where the criterion is about nearly dependent combinations, the square of that comes in besides.
    Rows ``X_i = A_i T`` of transformed parameters are wrong by E_i besides, which adds
    ``2 |W| (sum w_i |E_i|^2)^(1/2)`` to delta, as ``|X W| = 1``. Transformed squares that are wrong
    by E_i add ``|W|^2 sum w_i |E_i|``.

    *Bound.* It is proportional to ``t^-d``, t the largest sensitivity ``<Z, M_i>``. Rounding of a
    sensitivity is below ``2 p eps`` times that to ``p diag(Z)``; wrong rows add
    ``2 |E_i| (|Z| t_i)^(1/2)``, wrong squares ``|E_i| |Z|``. What Z proves is computed by roots
    and determinants of matrices that are conditioned as M is: the rounding of dM counts once more.
    Of criteria that are not monotone, costs and bounds are products of an extreme of M and one of
    cov, and a bound has the largest rounding of a row, not that of the weighted ones.

    Powers and determinants are exponentials of logarithms, each of which is rounded to eps of its
    size: the error of both counts ``eps`` for each decade that M and the cost are from one.

    First-order terms are counted; numbers as they were given are taken to be exact.

    Args:
        problem: The candidates (n).
        criterion: What was minimised.
        weights: Weights (n,); None for equal ones, with the largest rounding of a row.
        multipliers: Multipliers (r, p, p) of the bound.
        rounding: Bounds (n,) on ``|E_i|``, if rows or squares were transformed.
        of_squares: Whether they are of squares.
        design: The design M (p, p), where it is a difference: what blocks leave of the sum.

    Returns:
        The errors of the cost and of the bound; inf where nothing is known.
    """
    p = problem.p
    summed = problem.mean if weights is None else problem.information(weights)
    M = summed if design is None else design
    W = criterion.whitener(M)
    own = np.maximum(np.diag(summed), 0.0)
    spread = np.linalg.norm(np.sqrt(own)[:, None] * W, 2) ** 2
    scale = unit_scale(own)
    of_sums = float(p * p * EPS * spread * criterion.dependence(scale) ** 2)
    of_rows = _of_rows(W, weights, rounding, of_squares)
    of_powers = 4 * p * EPS * (1 + _size_of_logarithms(own, float(criterion.cost(M))))
    if not criterion.monotone:
        times = 1 + criterion.degree
        worst = of_sums + _of_rows(W, None, rounding, of_squares)
        return times * (of_sums + of_rows) + of_powers, times * worst + of_powers
    lost = max((_lost(problem, M, Z, rounding, of_squares) for Z in multipliers), default=0.0)
    of_cost = criterion.degree * (of_sums + of_rows) + of_powers
    return float(of_cost), float(criterion.degree * (of_sums + lost) + of_powers)


def _of_rows(W: Array, weights: Array | None, rounding: Array | None, of_squares: bool) -> float:
    """The part of delta that wrong rows or squares make, with these weights or with any."""
    if rounding is None:
        return 0.0
    size = float(np.linalg.norm(W, 2))
    if of_squares:
        return size**2 * float(rounding.max() if weights is None else weights @ rounding)
    squares = np.square(rounding)
    return 2 * size * float(np.sqrt(squares.max() if weights is None else weights @ squares))


def _size_of_logarithms(own: Array, cost: float) -> float:
    """The size of the logarithms of the entries of a diagonal (p,) and of a cost, the largest."""
    numbers = np.append(own, cost)
    told = numbers[np.isfinite(numbers) & (numbers > 0)]
    return float(np.abs(np.log(told)).max(initial=0.0))


def _lost(problem: Problem, M: Array, Z: Array, rounding: Array | None, of_squares: bool) -> float:
    """Relative error of the largest sensitivity to Z (p, p)."""
    p = problem.p
    own = np.abs(np.diag(Z))
    t = float(np.sum(Z * M))  # a little below t itself
    if not t > 0:
        return float("inf")
    error = 2 * p * p * EPS * float(own @ problem.largest)
    if rounding is not None:
        norm = float(np.abs(np.linalg.eigvalsh(Z)).max())
        if of_squares:
            return (error + norm * float(rounding.max())) / t
        along = np.sqrt(norm) * np.sqrt(np.maximum(problem.sensitivities(Z), 0.0))
        error += 2 * float((rounding * along).max())
    return error / t


@dataclass(frozen=True, eq=False)
class WarmStart:
    """Candidates with the weights and the multiplier that they had last.

    Attributes:
        candidates: Indices (k,) of the candidates; none where nothing is known.
        weights: Their weights (k,), of sum one; zero for those that are new.
        multiplier: The multiplier (p, p) of these weights, if it is known.
    """

    candidates: Indices
    weights: Array
    multiplier: Array | None = None

    @classmethod
    def none(cls) -> "WarmStart":
        """Nothing is known."""
        return cls(np.empty(0, dtype=int), np.empty(0))

    @classmethod
    def alike(cls, candidates: Indices) -> "WarmStart":
        """Candidates (k,) of equal weights."""
        return cls(candidates, np.full(len(candidates), 1.0 / len(candidates)))

    def __len__(self) -> int:
        """Number of candidates."""
        return len(self.candidates)

    def inside(self, part: Indices) -> "WarmStart":
        """The same, as indices into a part of all candidates (k, ascending) that has them all."""
        return replace(self, candidates=np.searchsorted(part, self.candidates))

    def outside(self, part: Indices) -> "WarmStart":
        """The same as indices into all candidates, from those into a part (k, ascending)."""
        return replace(self, candidates=part[self.candidates])


@dataclass(frozen=True, eq=False)
class Step:
    """One solved restricted master problem.

    Attributes:
        active: Indices (k,) of the candidates that carry weight.
        weights: Their weights (k,), positive, of sum one.
        M: Information matrix (p, p) of these weights.
        cost: Their cost.
        proof: The best proof of this and all earlier steps.
        solver: The solver that found the weights.
        last: All candidates of the problem, with weight or without, and the solver's multiplier.
    """

    active: Indices
    weights: Array
    M: Array
    cost: float
    proof: Proof
    solver: str
    last: WarmStart
