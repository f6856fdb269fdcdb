"""Weights instead of whole numbers of experiments, with the bound that they prove."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion, Relaxable
from edtk.design.bound import Bound, BoundKind
from edtk.design.exact.counts.counts_bound import counts_bound
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.system.typing import Array

EQUAL = 1e-9  # relative gap at which equal weights are the best
WITHIN = 1e-6  # experiments by which counts may exceed a limit and count as within


@dataclass(frozen=True, eq=False)
class RelaxedCounts:
    """What the relaxation tells about plans of one size.

    Attributes:
        counts: Counts (n,), not whole, of the best plan without regard to the limits.
        cost: No plan costs less.
        gap: Relative gap between bound and the best weights.
        multipliers: What proves it (r, p, p).
        basis: What the bound is on, in words.
        kind: Whether it is proved, or a solver's word.
    """

    counts: Array
    cost: float
    gap: float
    multipliers: Array
    basis: str
    kind: BoundKind = BoundKind.PROVED_ON_CANDIDATES

    def exceeds(self, limits: Limits) -> bool:
        """Whether these counts break a limit, so that a better bound may be proved."""
        if limits.most is not None and (self.counts > limits.most + WITHIN).any():
            return True
        if limits.costs is None or not limits.sized:
            return False
        return bool(self.counts @ limits.costs > limits.funds * (1 + WITHIN))


def relaxed_counts(problem: Problem, criterion: Relaxable, limits: Limits) -> RelaxedCounts:
    """Relax the counts of a plan: `relax` with what every plan has as prior information.

    ``K + sum n_i M_i`` of m experiments is m times ``sum w_i (K/m + M_i)`` with ``w = n/m``. With
    no size given, what an experiment costs is the unit instead: ``n_i c_i`` sums to the funds f,
    and ``sum w_i (K/f + M_i/c_i)`` is f times smaller.

    Args:
        problem: The candidates, without a prior.
        criterion: What is minimised.
        limits: What plans must obey; `most` is not regarded here, nor are costs beside a size.
    """
    total = float(limits.m)
    each = np.ones(problem.n)
    question = problem
    if not limits.sized:
        assert limits.costs is not None
        total = limits.funds
        each = limits.costs
        rows = problem.factors() / np.sqrt(each)[:, None, None]
        question = Problem(rows, parameters=problem.parameters)
    if limits.base.any():
        question = question.with_prior(limits.base / total)
    weights, bound, multipliers = _equal(question, criterion) or _relaxed(question, criterion)
    basis = "weights, their limits set aside" if limits.restricts and limits.sized else "weights"
    return RelaxedCounts(
        counts=weights * total / each,
        cost=bound.scaled(total).cost,
        gap=bound.gap,
        multipliers=multipliers,
        basis=basis,
        kind=bound.kind,
    )


def _relaxed(problem: Problem, criterion: Relaxable) -> tuple[Array, Bound, Array]:
    """The best weights (n,), their bound, and the multipliers that prove it."""
    found = relax(problem, criterion)
    return found.weights, found.proved_bound, found.multipliers


def _equal(problem: Problem, criterion: Relaxable) -> tuple[Array, Bound, Array] | None:
    """The same of equal weights, where these are the best: on a cube, or any set of symmetry.

    One look at the candidates tells, and spares a program over hundreds of thousands of them.
    """
    if not criterion.smooth or criterion.degree == 0:
        return None
    M = problem.mean
    cost = float(criterion.cost(M))
    if not np.isfinite(cost):
        return None
    Z = -criterion.gradient(M)[None]
    largest = problem.sensitivities(Z).max(axis=-1)
    bound = criterion.lower_bound(Z, largest, M)
    if not bound >= cost * (1 - EQUAL):
        return None
    proved = Bound.of(criterion, bound, cost, BoundKind.PROVED_ON_CANDIDATES)
    return np.full(problem.n, 1.0 / problem.n), proved, Z


def within_limits(
    relaxed: RelaxedCounts, problem: Problem, criterion: Criterion, limits: Limits, start: Array
) -> RelaxedCounts:
    """The sharper bound of weights that obey the limits, where they are restricted by them.

    Args:
        relaxed: The relaxation without regard to the limits.
        problem: The candidates, without a prior.
        criterion: What is minimised.
        limits: What plans must obey.
        start: Counts (n,) of a plan within the limits, regular.
    """
    # A criterion of degree zero is bounded among designs of unit trace, which limits do not know.
    if not isinstance(criterion, Relaxable) or criterion.degree == 0:
        return relaxed
    if not relaxed.exceeds(limits):
        return relaxed
    sharper = counts_bound(problem, criterion, limits, start, relaxed.multipliers)
    if not sharper.cost > relaxed.cost:
        return relaxed
    return RelaxedCounts(
        sharper.counts,
        sharper.cost,
        sharper.gap,
        relaxed.multipliers,
        "weights within the limits",
        relaxed.kind,
    )
