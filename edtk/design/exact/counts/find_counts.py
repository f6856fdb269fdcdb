"""The search for the best plan of whole experiments on the candidates of a problem."""

from dataclasses import dataclass, replace
from functools import cached_property
from time import monotonic

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.estimable import open_directions
from edtk.design.bound import BLURRED, Bound, BoundKind
from edtk.design.exact.counts.blocks_bound import blocks_bound
from edtk.design.exact.counts.counts_bound import (
    Question,
    RelaxedCounts,
    Scatter,
    beside_blocks,
    relaxed_counts,
    within_limits,
)
from edtk.design.exact.counts.counts_search import CountsSearch, FoundPlaces
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.pricing_for import search_for
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.prove_exact import (
    MARGIN,
    ExactProof,
    Given,
    UnprovableError,
    prove_exact,
    require_provable,
    require_told_apart,
)
from edtk.design.information import Known, Rows
from edtk.design.problem import Problem, RankDeficientError, missing_of
from edtk.design.relaxation.proof import errors
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.design.relaxation.setting import OrderOne, Setting
from edtk.system.errors import UserError
from edtk.system.time_limit import Progress, time_limit
from edtk.system.typing import Array, Indices

# Margins that may be between the best plan and the bound: the proof has two, its cost one.
SURE = 3
PROVED_STARTS = 1  # of a search that a proof continues


def find_counts(
    problem: Problem,
    criterion: Criterion,
    limits: Limits,
    kept: Indices,
    elsewhere: int = 0,
    seed: int = 0,
    starts: int | None = None,
    progress: Progress = lambda step, cost: None,
    thorough: bool = True,
    prove: float | None = None,
    known: Rows | None = None,
) -> ProblemPlan:
    """Search for the best plan within limits, and bound how much better any plan can be.

    From random places, and from places drawn by the weights of the relaxation, plans are improved
    by exchanges (`descend_places`), kicked out of their local optimum a few times, and improved
    again. The same seed gives the same plan. Ctrl-C ends the search with the best plan so far, and
    the relaxation with the first plan that can be given.

    Args:
        problem: The candidates; its prior is part of `Limits.base` already.
        criterion: The criterion to minimise.
        limits: Size, limits on counts, costs, blocks, and what every plan has.
        kept: How often each candidate is measured in every plan (n,); counts of the result have it
            too.
        elsewhere: Number of kept experiments that are none of the candidates.
        seed: Seed.
        starts: Number of starts; None to go on until nothing better is found.
        progress: Called with a line about the current step, and the best cost.
        thorough: Whether no exchange of one place for any candidate shall improve the plan, which
            is wasted on places that move afterwards.
        prove: Seconds for a proof that no plan is better [s]. It goes on where a first start ends
            that tries the most sensitive candidates, finds better plans, and ends the search. None
            for no proof.
        known: Rows (k, 1, p) that every plan has beside `Limits.base`, such as those of kept
            experiments, whose squares may have lost digits.

    Raises:
        UnprovableError: A proof was asked for, and multipliers can prove nothing about such plans.
        UserError: No plan of so few experiments was found that identifies all parameters.
        RankDeficientError: No plan of these candidates identifies all parameters.
    """
    since = monotonic()
    proves = prove is not None
    asked = _Asked.of(problem, criterion, limits, known)
    plain = criterion.without_prior
    asked.require(problem, plain, proves)
    inside = asked.inside(plain)
    search = _BoundedSearch.of(inside, thorough and not proves, seed)
    found = search.run(seed, PROVED_STARTS if proves and starts is None else starts, progress)
    counts = limits.counts(found.places[None], problem.n)[0]
    proof = search.proof(counts, prove, progress)
    counts = counts if proof is None else proof.counts
    cost, of_cost = inside.cost(counts, found.places)
    if proof is not None:
        proof = _outward(_within(proof, cost, of_cost), asked.sized, criterion)
    _require_regular(cost, limits, problem, criterion)
    relaxed = search.beside(counts, found.places, cost)
    _, of_bound = inside.errors(counts, inside.left(found.places), relaxed)
    return ProblemPlan(
        problem=problem,
        criterion=criterion,
        counts=counts + kept,
        cost=asked.sized.cost(cost, criterion),
        accuracy=of_cost + of_bound,
        lower_bound=told_bound(criterion, relaxed, asked.sized, cost, of_cost, of_bound),
        basis=f"no bound: {search.reason}" if relaxed is None else relaxed.basis,
        starts=found.starts,
        found=found.found,
        ended=found.ended if proof is None else proof.ended,
        seconds=monotonic() - since,
        kept=kept,
        elsewhere=elsewhere,
        block_counts=_by_block(found.places, limits, problem.n),
        most=None if limits.most is None else limits.most + kept,
        exact_bound=None if proof is None else _exact_bound(criterion, proof),
        proof=proof,
        limits=asked.limits,
    )


@dataclass(frozen=True, eq=False)
class _Asked:
    """A question about plans, in a unit in which information is of order one.

    Attributes:
        sized: The candidates, beside what every plan has in equal parts for each experiment.
        limits: What plans must obey; its base is all that every plan has.
        known: What the base is made of.
    """

    sized: OrderOne
    limits: Limits
    known: Known

    @classmethod
    def of(
        cls, problem: Problem, criterion: Criterion, limits: Limits, known: Rows | None
    ) -> "_Asked":
        """The question as it was given to `find_counts`, a Bayesian prior included."""
        every = Known.of(limits.base)
        if known is not None:
            every = replace(every, rows=known)
        if criterion.precision is not None:
            every = every.plus(criterion.precision)
        sized = OrderOne.of(problem.with_prior(every.shared(limits.m)))
        every = every.in_unit(sized.power)
        return cls(sized, replace(limits, base=every.information), every)

    def require(self, problem: Problem, criterion: Criterion, proves: bool) -> None:
        """Check that plans can tell what a criterion without a prior needs.

        Raises:
            UnprovableError: A proof is asked for, and multipliers can prove nothing.
            RankDeficientError: No plan of these candidates identifies all parameters.
        """
        self.sized.problem.require_identifiable(criterion)
        self._require_enough(criterion, problem.p)
        if proves:
            if self.limits.linear is not None:
                raise UnprovableError("plans under constraints on sums of counts have no proof")
            require_provable(criterion, self.limits)
            require_told_apart(self.sized.problem)
        if self.limits.blocks:
            plain = self.placed.with_prior(None)
            question = beside_blocks(plain, criterion, self.limits)
            _require_beside_blocks(question, problem)

    def _require_enough(self, criterion: Criterion, p: int) -> None:
        """Check that so few experiments can tell all parameters: a row tells one.

        Raises:
            UserError: They cannot, wherever they are.
        """
        if not criterion.needs_all:
            return
        limits = self.limits
        # Each block of unknown effect loses its mean.
        places = limits.m - len(limits.blocks) * bool(np.isinf(limits.block_variance))
        known = int(self.known.root.any(axis=1).sum())
        for model in self.sized.problem.each:
            told = places * model.factors().shape[1] + known
            if told < model.p:
                message = f"they tell {told} at most; more experiments are needed"
                raise _untold(limits, p, criterion, "identifies", message)

    @cached_property
    def placed(self) -> Problem:
        """The candidates, about their middle where plans in blocks do not depend on it."""
        limits = self.limits
        unknown = bool(limits.blocks) and np.isinf(limits.block_variance)
        return _centred(self.sized.problem) if unknown else self.sized.problem

    def inside(self, criterion: Criterion) -> "_Inside":
        """The question in parameters that the candidates tell equally well."""
        limits = self.limits
        problem = self.placed
        if not isinstance(criterion, Relaxable):
            return _Inside(self, criterion, criterion, None, problem.with_prior(None), limits)
        setting = Setting.of(problem, criterion, as_rows=bool(limits.blocks))
        if setting.whitened is not None:
            limits = replace(limits, base=self.known.times(setting.whitened.T))
        bare = setting.problem.with_prior(None)
        return _Inside(self, criterion, setting.criterion, setting, bare, limits)


@dataclass(frozen=True, eq=False)
class _Inside:
    """The question in parameters in which squares of rows lose no digits.

    Attributes:
        asked: The question as it was given, in a good unit.
        given: The criterion of the parameters as given.
        criterion: The criterion there.
        setting: What rounding the parameters cost; None where the criterion cannot follow others.
        problem: The candidates, without a prior.
        limits: What plans must obey, with what every plan has.
    """

    asked: _Asked
    given: Criterion
    criterion: Criterion
    setting: Setting | None
    problem: Problem
    limits: Limits

    def cost(self, counts: Indices, places: Indices) -> tuple[float, float]:
        """The cost of a plan, and the relative error that rounding may have made in it.

        Some candidates may be nearly dependent where all together are not: a plan is judged in
        parameters that its own rows tell equally well.

        Args:
            counts: The plan (n,).
            places: The same as places (m,), which blocks depend on.
        """
        size = max(int(counts.sum()), 1)
        nothing = np.zeros((0, self.problem.p, self.problem.p))
        M = self.left(places)
        if M is not None:
            return float(self.criterion.cost(M)), self.errors(counts, M, None)[0]
        support = np.flatnonzero(counts)
        known = self.asked.known.shared(size)
        own = self.asked.sized.problem[support].with_prior(known)
        weights = counts[support] / size
        if not isinstance(self.given, Relaxable):
            M = own.information(weights)
            lost, _ = errors(own, self.given, weights, nothing)
            return float(self.given.cost(size * M)), lost
        setting = Setting.of(own, self.given)
        M = setting.problem.information(weights)
        return float(setting.criterion.cost(size * M)), setting.errors(weights, nothing)[0]

    def left(self, places: Indices) -> Array | None:
        """What blocks leave of the information (p, p) of places (m,); None without blocks."""
        if not self.limits.blocks:
            return None
        scatter = Scatter(self.problem.factors(), self.limits)
        return np.asarray(scatter.information(places[None])[0])

    def errors(
        self, counts: Indices, M: Array | None, relaxed: RelaxedCounts | None
    ) -> tuple[float, float]:
        """Relative errors of the cost of counts (n,) in these parameters, and of the bound.

        Args:
            counts: The plan.
            M: Its information (p, p), where it is less than the sum of its experiments.
            relaxed: The bound with its multipliers; those of effects of blocks do not matter.
        """
        if self.setting is None:
            return 0.0, 0.0
        size = max(int(counts.sum()), 1)
        p = self.problem.p
        beside = self.problem.with_prior(self.limits.base / size)
        known = self.asked.known.shared(size)
        setting = replace(self.setting, problem=beside, known=known)
        Z = np.zeros((0, p, p)) if relaxed is None else relaxed.multipliers[:, :p, :p]
        return setting.errors(counts / size, Z, None if M is None else M / size)

    @property
    def whence(self) -> Given:
        """The candidates that a proof about these is about."""
        problem = self.asked.sized.problem
        of = None if self.setting is None else self.setting.whitened
        T = np.eye(problem.p) if of is None else of.T
        return Given(problem, T, self.asked.known.shared(self.limits.m))


@dataclass(frozen=True, eq=False)
class _BoundedSearch:
    """The search in good parameters, beside a bound that is known before it.

    Attributes:
        inside: The question in these parameters.
        question: What the bound is about; None where there is none.
        relaxed: The bound; None where there is none.
        reason: Why there is none.
        search: The search, which knows the bound.
        needs_plan: Whether only a plan better than the first gives the bound of blocks.
        interrupted: Whether Ctrl-C came before the search, which then is one start.
    """

    inside: _Inside
    question: Question | None
    relaxed: RelaxedCounts | None
    reason: str
    search: CountsSearch
    needs_plan: bool
    interrupted: bool

    @classmethod
    def of(cls, inside: _Inside, thorough: bool, seed: int) -> "_BoundedSearch":
        """The bound, and the search that it helps."""
        problem, criterion, limits = inside.problem, inside.criterion, inside.limits
        question = beside_blocks(problem, criterion, limits)
        relaxed, reason, interrupted = _relaxed(question, criterion)
        search = search_for(problem, criterion, limits, relaxed, thorough)
        try:
            relaxed, needs_plan = _of_blocks(relaxed, search, seed)
        except KeyboardInterrupt:
            interrupted, needs_plan = True, False
        search = replace(search, bound=0.0 if relaxed is None else relaxed.cost)
        return cls(inside, question, relaxed, reason, search, needs_plan, interrupted)

    def run(self, seed: int, starts: int | None, progress: Progress) -> FoundPlaces:
        """Search from so many starts; after Ctrl-C take the first plan that can be given."""
        with time_limit(0.0 if self.interrupted else np.inf):
            found = self.search.run(
                seed,
                1 if self.interrupted else starts,
                lambda number, cost: progress(f"start {number}", cost),
            )
        return replace(found, ended="interrupted") if self.interrupted else found

    def proof(
        self, counts: Indices, seconds: float | None, progress: Progress
    ) -> ExactProof | None:
        """The proof that goes on from a plan (n,).

        Returns:
            The proof; None without time for it or a bound, and after Ctrl-C.
        """
        if seconds is None or self.relaxed is None or self.interrupted:
            return None
        return prove_exact(
            self.inside.problem,
            self.inside.criterion,
            self.inside.limits,
            counts,
            seconds=seconds,
            relaxed=self.relaxed,
            given=self.inside.whence,
            progress=lambda nodes, best, bound: progress(f"node {nodes}", best),
        )

    def beside(self, counts: Indices, places: Indices, cost: float) -> RelaxedCounts | None:
        """The bound that is sharpest beside a plan of such counts (n,), places (m,) and cost."""
        relaxed = self.relaxed
        if relaxed is None or self.question is None or self.interrupted:
            return relaxed
        relaxed = within_limits(relaxed, *self.question, counts.astype(float))
        if self.needs_plan or relaxed.is_near(cost):
            return blocks_bound(relaxed, self.search.scatter, self.search.criterion, places)
        return relaxed


def _centred(problem: Problem) -> Problem:
    """The same question about plans in blocks of unknown effects, which take up a common row.

    Rows ``U - c`` have the same scatter in each block; of a c in the middle of the candidates they
    lose nothing, where squares of U lose all that differs in blocks. A difference of two numbers of
    which neither is more than twice the other is exact (Sterbenz); where entries are further apart,
    c is zero: it would help little, and would round what tells nearly dependent columns apart.
    """
    kept = problem.kept
    assert isinstance(kept, Rows)
    alike = kept.sigma is None or bool((kept.sigma == kept.sigma[0]).all())
    rows, sigma = (kept.given, kept.sigma) if alike else (kept.A, None)
    middle = rows.mean(axis=0, dtype=np.longdouble).astype(float)
    size = np.abs(rows)
    is_exact = (
        (np.sign(rows) == np.sign(middle))
        & (2 * size >= np.abs(middle))
        & (size <= 2 * np.abs(middle))
    )
    middle = np.where(is_exact.all(axis=0), middle, 0.0)
    return problem.of_candidates(Rows(rows - middle, sigma))


def _of_blocks(
    relaxed: RelaxedCounts | None, search: CountsSearch, seed: int
) -> tuple[RelaxedCounts | None, bool]:
    """The bound of weights of blocks beside a first plan; and whether only a better plan gives it.

    A plan from one start is regular in all but rare cases.
    """
    if relaxed is None or not search.limits.blocks:
        return relaxed, False
    first = search.run(seed, 1, lambda starts, cost: None)
    if not np.isfinite(first.cost):
        return relaxed, True
    return blocks_bound(relaxed, search.scatter, search.criterion, first.places), False


def _outward(proof: ExactProof, sized: OrderOne, criterion: Criterion) -> ExactProof:
    """A proof about the candidates as given: merits and costs have other units there."""
    tree = replace(
        proof.tree,
        T=np.ldexp(proof.tree.T, sized.power),
        multipliers=np.ldexp(proof.tree.multipliers, -2 * sized.power),
        prices=np.ldexp(proof.tree.prices, -2 * sized.power),
        target=sized.cost(proof.tree.target, criterion),
    )
    return replace(
        proof,
        cost=sized.cost(proof.cost, criterion),
        best=sized.cost(proof.best, criterion),
        tree=tree,
    )


def _within(proof: ExactProof, cost: float, error: float) -> ExactProof:
    """A proof beside the cost of its plan as it is judged, which rounding leaves to an error.

    A plan whose cost is not known to `MARGIN` is not told from others that are as good.
    """
    found = replace(proof, cost=min(proof.cost, cost * (1 - max(error, MARGIN))), best=cost)
    if proof.proved and found.cost < cost * (1 - SURE * MARGIN):
        return replace(found, proved=False, ended="rounding")
    return found


def _exact_bound(criterion: Criterion, proof: ExactProof) -> Bound:
    """The bound of a proof of plans as an object; its gap is that to the best plan known."""
    gap = 1.0 - proof.cost / proof.best
    kind = BoundKind.PROVED_ON_CANDIDATES
    return Bound(proof.cost, kind, criterion.degree, criterion.sense, gap)


def _require_beside_blocks(question: Question | None, problem: Problem) -> None:
    """Check that effects of blocks leave what the criterion needs to be told."""
    if question is None:
        return
    extended, criterion, free = question
    names = (*problem.parameters, *(f"effect {i + 1}" for i in range(extended.p - problem.p)))
    named = Problem.of_kept(extended.kept, names, free.base / free.m)
    named.is_exact = extended.is_exact
    missing = missing_of(named, criterion)
    if missing:
        apart = problem.factors() - problem.factors().mean(axis=0)
        constant = open_directions(np.einsum("nrp,nrq->pq", apart, apart), problem.parameters)
        raise RankDeficientError(
            f"beside fixed effects of blocks nothing tells {' or '.join(constant or missing)}: "
            "leave such parameters out of the model, name the others as interest, or give a "
            "block_variance"
        )


def _relaxed(
    question: Question | None, criterion: Criterion
) -> tuple[RelaxedCounts | None, str, bool]:
    """The relaxation, or why there is none; and whether Ctrl-C ended it."""
    if question is None:
        if isinstance(criterion, Relaxable):
            return None, f"in blocks {criterion.label} may be better with less information", False
        return None, f"{criterion.label} has no convex form", False
    try:
        found = relaxed_counts(*question)
    except RelaxationError:
        return None, "no solver found weights", False
    except KeyboardInterrupt:
        return None, "interrupted before one was found", True
    if found.cost > 0:
        return found, "", found.interrupted
    return None, "the multipliers found prove nothing", False


def _require_regular(cost: float, limits: Limits, problem: Problem, criterion: Criterion) -> None:
    """Check that the best plan identifies what the criterion needs."""
    if not np.isfinite(cost):
        message = "more experiments, or starts, are needed"
        raise _untold(limits, problem.p, criterion, "was found that identifies", message)


def _untold(limits: Limits, p: int, criterion: Criterion, how: str, message: str) -> UserError:
    """The error that so few experiments do not tell what the criterion needs."""
    blocks = f" in {len(limits.blocks)} blocks" if limits.blocks else ""
    experiments = f"{limits.m} new experiment{'s' if limits.m > 1 else ''}"
    needed = f"the {p} parameters" if criterion.needs_all else f"what {criterion.label} needs"
    return UserError(f"no plan of {experiments}{blocks} {how} {needed}; {message}")


def told_bound(
    criterion: Criterion,
    relaxed: RelaxedCounts | None,
    sized: OrderOne,
    cost: float,
    of_cost: float,
    of_bound: float,
) -> Bound:
    """The bound as an object; zero, which says nothing, where there is none.

    It is lowered by its rounding, and is never above the cost of the plan that was found.
    """
    if relaxed is None:
        kind = BoundKind.PROVED_ON_CANDIDATES
        return Bound(0.0, kind, criterion.degree, criterion.sense, 1.0)
    found = Bound.of(criterion, relaxed.cost, cost, relaxed.kind, of_bound, max(of_cost, BLURRED))
    return replace(found, cost=sized.cost(found.cost, criterion), gap=relaxed.gap)


def _by_block(places: Indices, limits: Limits, n: int) -> Indices | None:
    """Counts (b, n) of each block."""
    if not limits.blocks:
        return None
    ends = np.cumsum(limits.blocks)[:-1]
    return np.array([np.bincount(own, minlength=n) for own in np.split(places, ends)])
