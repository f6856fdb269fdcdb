"""A bound on every plan within limits, from weights within the same limits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from criteria import Criterion, CriterionError, Interest, Relaxable
from criteria.linalg.inverse import root
from edtk.design.bound import Bound, BoundKind
from edtk.design.exact.counts.limits import Limits, Reachable
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import RelaxationInterrupted, relax
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

EQUAL_WEIGHTS = 1e-9  # relative gap at which equal weights are the best
WITHIN = 1e-6  # experiments by which counts may exceed a limit and count as within
COUNTS_GAP = 1e-4  # relative gap at which the bound is good enough
MASTER = 0.1  # of that gap, in the programs over some plans
BOUND_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Scatter:
    """Information about the parameters beside the effects of blocks, which are nuisance.

    The rows X of a block of n experiments tell ``X'X - a (1'X)'(1'X)`` about the parameters, with a
    from `Limits.shares`: with a = 1/n the scatter around the mean of the block. An experiment of
    several rows has an effect of the block for each of them.

    Attributes:
        rows: Rows (n, r, p) of the candidates; not any rows of the same information, since their
            signs matter.
        limits: The blocks, and what every plan has.
    """

    rows: Array
    limits: Limits

    @property
    def n(self) -> int:
        """Number of candidates."""
        return len(self.rows)

    def information(self, places: Indices) -> Array:
        """Information (b, p, p) of plans (b, m), that of every plan included."""
        U = self.rows[places]
        M = np.einsum("bmri,bmrj->bij", U, U, optimize=True) + self.limits.base
        if not self.limits.blocks:
            return np.asarray(M)
        sums = self.sums(places)
        return np.asarray(
            M - np.einsum("k,bkri,bkrj->bij", self.limits.shares, sums, sums, optimize=True)
        )

    def sums(self, places: Indices) -> Array:
        """Sums (b, blocks, r, p) of the rows of each block."""
        starts = np.cumsum((0, *self.limits.blocks[:-1]))
        return np.asarray(np.add.reduceat(self.rows[places], starts, axis=1))

    def joining(self, places: Indices, place: int) -> tuple[Array, float]:
        """How a candidate joins plans (b, m) at a place.

        Of a block with sum s of its other rows, and share a, a candidate U adds
        ``(1 - a) (U - c s)' (U - c s)`` with ``c = a/(1 - a)``: its distance to the block's mean.

        Returns:
            The center ``c s`` (b, r, p), and ``1 - a``.
        """
        block = self.limits.block_of[place]
        share = float(self.limits.shares[block])
        inside = np.flatnonzero(self.limits.block_of == block)
        others = self.rows[places[:, inside]].sum(axis=1) - self.rows[places[:, place]]
        return (share / (1.0 - share) if share < 1.0 else 0.0) * others, 1.0 - share

    def without(self, M: Array, places: Indices, place: int) -> tuple[Array, Array, float]:
        """Take the experiment at one place out of plans (b, m) of information M (b, p, p).

        Returns:
            Information (b, p, p) of the rest; and what `joining` tells.
        """
        U = self.rows[places[:, place]]
        if not self.limits.blocks:
            return M - np.swapaxes(U, -1, -2) @ U, np.zeros_like(U), 1.0
        center, scale = self.joining(places, place)
        leaving = np.sqrt(scale) * (U - center)
        return M - np.swapaxes(leaving, -1, -2) @ leaving, center, scale


Question = tuple[Problem, Relaxable, Limits]


def beside_blocks(problem: Problem, criterion: Criterion, limits: Limits) -> Question | None:
    """Put one effect for all experiments in place of the effects of blocks.

    With ``s_b`` the sum of the rows of block b, and v the variance of its effect, blocks cost
    ``sum_b s_b' s_b / (n_b + 1/v)`` of the information. By the inequality of Cauchy and Schwarz
    this is at least ``s's / (m + B/v)`` with ``s = sum_b s_b``, for B blocks: what one effect costs
    of which the prior information is B/v. So plans in blocks tell no more than plans of the model
    with such an effect as one more parameter, which is nuisance. Plans reach it where all blocks
    have the same mean.

    Args:
        problem: The candidates, without a prior.
        criterion: What is minimised.
        limits: What plans must obey.

    Returns:
        The question to relax; as given where there are no blocks, and None where no relaxation
        bounds its plans.
    """
    if not isinstance(criterion, Relaxable):
        return None
    if not limits.blocks:
        return problem, criterion, limits
    if not criterion.monotone:
        return None
    free = replace(limits, blocks=())
    n, r, p = problem.factors().shape
    try:
        beside = of_interest(criterion, p, r)
    except CriterionError:
        # Without blocks plans tell more: a bound on them is one here, if a weaker one.
        return problem, criterion, free
    # Effects in a unit of the size of the rows: beside very small ones they would look like all.
    unit = float(np.ldexp(1.0, int(np.frexp(np.abs(problem.factors()).max())[1])))
    effects = np.broadcast_to(unit * np.eye(r), (n, r, r))
    rows = np.concatenate([problem.factors(), effects], axis=2)
    base = np.zeros((p + r, p + r))
    base[:p, :p] = limits.base
    precision = len(limits.blocks) / limits.block_variance
    base[p:, p:] = unit**2 * precision * np.eye(r)
    return Problem(rows), beside, replace(free, base=base)


def of_interest(criterion: Relaxable, p: int, r: int) -> Interest:
    """The criterion of p parameters, beside r of nuisance."""
    base = criterion
    K = np.eye(p)
    names = None
    if isinstance(criterion, Interest):
        base = criterion.base
        K = criterion.K
        names = criterion.names
    return Interest(base, np.vstack([K, np.zeros((r, K.shape[1]))]), names)


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
        interrupted: Whether Ctrl-C has ended it, so that a plan is wanted at once.
    """

    counts: Array
    cost: float
    gap: float
    multipliers: Array
    basis: str
    kind: BoundKind = BoundKind.PROVED_ON_CANDIDATES
    interrupted: bool = False

    def is_near(self, cost: float) -> bool:
        """Whether a plan of this cost may well be the best."""
        return self.cost >= cost * (1 - COUNTS_GAP)

    def exceeds(self, limits: Limits) -> bool:
        """Whether these counts break a limit, so that a better bound may be proved."""
        if limits.most is not None and (self.counts > limits.most + WITHIN).any():
            return True
        if limits.linear is not None and not limits.linear.is_obeyed(self.counts, WITHIN):
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
        limits: What plans must obey; `most` and `linear` are not regarded here, nor are costs
            beside a size.
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
    interrupted = False
    try:
        found = _equal(question, criterion) or _relaxed(relax(question, criterion))
    except RelaxationInterrupted as interrupt:
        found = _relaxed(interrupt.best)
        interrupted = True
    weights, bound, multipliers = found
    aside = limits.restricts if limits.sized else limits.linear is not None
    basis = "weights, their limits set aside" if aside else "weights"
    return RelaxedCounts(
        counts=weights * total / each,
        cost=bound.scaled(total).cost,
        gap=bound.gap,
        multipliers=multipliers,
        basis=basis,
        kind=bound.kind,
        interrupted=interrupted,
    )


def _relaxed(found: Relaxation) -> tuple[Array, Bound, Array]:
    """The best weights (n,), their bound, and the multipliers that prove it."""
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
    if not bound >= cost * (1 - EQUAL_WEIGHTS):
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


@dataclass(frozen=True, eq=False)
class CountsBound:
    """A bound, and the counts that come near it.

    Attributes:
        cost: No plan within the limits costs less.
        counts: Counts (n,), not whole, of a plan that costs about as much.
        gap: Relative gap between the bound and these counts.
    """

    cost: float
    counts: Array
    gap: float


def counts_bound(
    problem: Problem,
    criterion: Relaxable,
    limits: Limits,
    start: Array,
    multipliers: Array,
) -> CountsBound:
    """Minimise a criterion over counts within limits that need not be whole.

    A plan X within the limits obeys ``<Z, X> <= <Z, K> + max_n sum_i n_i <Z, M_i>`` for every
    multiplier Z, with K what all plans have; so a criterion's `lower_bound` holds for it too. The
    program over all such plans is solved by Dantzig and Wolfe's decomposition: of a few whole
    plans the best mixture is found by `relax`, whose multiplier tells the plan that joins next.

    Args:
        problem: The candidates, without a prior: `Limits.base` is what all plans have.
        criterion: What is minimised.
        limits: What plans must obey.
        start: Counts (n,) of a plan within the limits, regular.
        multipliers: Multipliers (r, p, p) of a like program.
    """
    plans = CountsPlans(problem, limits)
    M = plans.information(start)
    search = Decomposition(plans, criterion, [start], M)
    search.prove(multipliers, M)
    search.run()
    return CountsBound(search.bound, search.mixture, search.gap)


class Plans(Protocol):
    """All plans of a kind, each an array of whole numbers or not: their mixtures have a bound."""

    def information(self, plan: Any) -> Array:
        """Information (p, p) of a plan."""
        ...

    def largest(self, Z: Array) -> tuple[float, Sequence[Any]]:
        """What ``<Z, M>`` of a plan is at most, and plans that come near it."""
        ...


class CountsPlans:
    """Counts (n,) of candidates within limits.

    Args:
        problem: The candidates, without a prior.
        limits: What plans must obey, and what every plan has.
    """

    def __init__(self, problem: Problem, limits: Limits) -> None:
        self.problem = problem
        self.reachable = Reachable(limits, problem.n)

    def information(self, plan: Array) -> Array:
        """Information (p, p) of counts (n,), with what every plan has."""
        return self.problem.information(plan) + self.reachable.limits.base

    def largest(self, Z: Array) -> tuple[float, Sequence[Array]]:
        """The plan of the largest sensitivities."""
        top, counts = self.reachable.largest(self.problem.sensitivities(Z[None])[0])
        return top + float(np.sum(Z * self.reachable.limits.base)), [counts]


class Decomposition:
    """Some plans of a kind, their best mixture, and the best bound so far (Dantzig and Wolfe).

    Args:
        of: All plans.
        criterion: What is minimised.
        plans: Plans to begin with.
        M: Information (p, p) of a mixture of plans, regular.

    Attributes:
        plans: The plans so far.
        weights: Weights of the best mixture; those behind the last one are zero.
        cost: The cost of the best mixture.
        bound: No plan costs less.
        proof: The multipliers (r, p, p) that prove the bound.
    """

    def __init__(self, of: Plans, criterion: Relaxable, plans: Sequence[Any], M: Array) -> None:
        self.of = of
        self.criterion = criterion
        self.plans: list[Any] = []
        self.columns: list[Array] = []
        self.known: set[bytes] = set()
        for plan in plans:
            self._join(plan)
        self.weights = np.full(len(self.plans), 1.0 / len(self.plans))
        self.cost = float(criterion.cost(M))
        self.bound = 0.0
        self.proof = np.zeros((0, *M.shape))

    @property
    def mixture(self) -> Array:
        """The best mixture of plans that are arrays of numbers."""
        return np.asarray(np.tensordot(self.weights, np.array(self.plans), axes=1))

    @property
    def gap(self) -> float:
        """Relative gap between the best bound and the best mixture."""
        return 1.0 - self.bound / self.cost

    def run(self, gap: float = COUNTS_GAP, rounds: int = BOUND_ROUNDS) -> None:
        """Mix the plans, and let those join that the mixture asks for, until the gap is small."""
        for _ in range(rounds):
            known = len(self.plans)
            if self.gap <= gap or out_of_time():
                break
            try:
                self.improve(MASTER * gap)
            except RelaxationError:
                break
            if len(self.plans) == known:
                break
        self.weights = np.append(self.weights, np.zeros(len(self.plans) - len(self.weights)))

    def improve(self, gap: float) -> None:
        """Mix the plans, and add those that the mixture's multipliers ask for."""
        columns = np.array(self.columns)
        mixed = relax(Problem(root(columns)), self.criterion, gap)
        M = np.tensordot(mixed.weights, columns, axes=1)
        cost = float(self.criterion.cost(M))
        if cost < self.cost:
            self.cost = cost
            self.weights = mixed.weights
        Z = mixed.multipliers
        if self.criterion.smooth:
            Z = np.concatenate([Z, -self.criterion.gradient(M)[None]])
        self.prove(Z, M)

    def prove(self, multipliers: Array, M: Array) -> None:
        """Take over what multipliers (r, p, p) prove near M (p, p), and the plans they ask for."""
        tops = []
        for Z in multipliers:
            top, plans = self.of.largest(Z)
            tops.append(top)
            for plan in plans:
                self._join(plan)
        largest = np.array(tops)
        each = [slice(i, i + 1) for i in range(len(largest))]
        for some in (*each, slice(None)):
            bound = self.criterion.lower_bound(multipliers[some], largest[some], M)
            if np.isfinite(bound) and bound > self.bound:
                self.bound = bound
                self.proof = multipliers[some]

    def _join(self, plan: Any) -> None:
        """Take in a plan that is not there."""
        name = np.round(plan, 9).tobytes()
        if name not in self.known:
            self.known.add(name)
            self.plans.append(plan)
            self.columns.append(self.of.information(plan))
