"""A proof that no plan of whole experiments on some candidates is better, by branch and bound."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic
from typing import NamedTuple

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import unit_scale, whitener
from criteria.linalg.typing import triangle
from edtk.design.exact.counts.counts_bound import RelaxedCounts, relaxed_counts
from edtk.design.exact.counts.limits import ROUNDING_OF_FUNDS as SPENT
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.exact_exchange import exchanged
from edtk.design.exact.exact_kinks import spectral_multipliers
from edtk.design.exact.exact_nodes import Merits, Nodes, Told, is_near
from edtk.design.exact.exact_split import Division, halved_order, parts
from edtk.design.exact.exact_tree import ExactTree, TreeRecord
from edtk.design.exact.exact_weights import best_weights
from edtk.design.exact.exchange import exchange
from edtk.design.information import Known, Rows, sensitivity_rows
from edtk.design.problem import Problem
from edtk.design.relaxation.setting import LARGEST_OF_PARAMETER, SMALLEST_OF_PARAMETER
from edtk.system.errors import UserError
from edtk.system.time_limit import out_of_time, time_limit
from edtk.system.typing import Array, Indices

# Relative distance of two costs that a proof does not tell apart; one half of it is for the
# rounding of whoever checks.
MARGIN = 1e-9
# Condition number of rows whose squares lose ``eps 1e6``, less than `MARGIN`.
MOST_DEPENDENT = 1e3
NODES_AT_ONCE = 256  # nodes
CANDIDATES_AT_ONCE = 200_000  # candidates of them
LOOKS_AT_NODE = 6  # at all candidates of a node, at most
REGULAR = 1e-12  # least eigenvalue at unit diagonal of information that can be whitened
ADDED_FOR_ORDER = 1e-3  # part of all information that is added where it orders the candidates
PROOF_STARTS = 16
AMONG = 5000  # candidates that starts are exchanged among
# The second is for kinks, where the most sensitive candidates are not the best to exchange for.
SHORTLISTS = (8, 512)
# Experiments of the best starts that are exchanged for the best of all candidates: a second or two.
EXCHANGED_PLACES = 32
LIGHT_COUNT = 1e-3  # experiments that are not rounded up
ROUNDED = 1e-6  # distance to a whole number that counts as none
TINY = float(np.finfo(float).tiny)

Progress = Callable[[int, float, float], object]


class UnprovableError(UserError):
    """There is no proof for this criterion or these limits; the message is the reason."""


@dataclass(frozen=True, eq=False)
class ExactProof:
    """What is proved about all plans of whole experiments on some candidates within limits.

    Attributes:
        cost: No plan costs less.
        counts: The best plan known (n,): how often each candidate is chosen anew.
        best: Its cost.
        proved: Whether that is the best of all: `cost` is 2e-9 of it below, or less.
        tree: Why.
        seconds: Duration [s].
        ended: Why it ended: "proved", "budget", "interrupted", or "rounding" where the cost of the
            plan is not known to `MARGIN`.
    """

    cost: float
    counts: Indices
    best: float
    proved: bool
    tree: ExactTree
    seconds: float
    ended: str


def require_provable(criterion: Criterion, limits: Limits) -> None:
    """Check that multipliers can prove something about whole plans.

    Raises:
        UnprovableError: They cannot.
    """
    if not isinstance(criterion, Relaxable) or not criterion.convex or not criterion.monotone:
        raise UnprovableError(f"{criterion.label} has no convex form, and no proof of whole plans")
    if criterion.degree <= 0:
        raise UnprovableError(
            f"{criterion.label} does not depend on the length of the information: no multiplier "
            "leaves a candidate out"
        )
    if limits.blocks:
        raise UnprovableError("plans in blocks have no proof")


def require_told_apart(problem: Problem) -> None:
    """Check that what is known of the candidates keeps enough digits for a proof to `MARGIN`.

    Rows are whitened before they are squared, so that they keep theirs. Squares lose ``eps`` times
    the square of the condition number of the rows, each column scaled to length one; so does what
    the candidates leave open altogether, once it is mixed with what they hardly tell.

    Raises:
        UnprovableError: Parameters are nearly dependent.
    """
    found = problem.conditioning
    told = found.s[found.s > found.least]
    if isinstance(problem.kept, Rows) and len(told) == len(found.s):
        return
    condition = float(told[-1] / told[0]) if len(told) else 1.0
    if condition > MOST_DEPENDENT:
        raise UnprovableError(
            f"the parameters are nearly dependent: the candidates' rows have the condition number "
            f"{condition:.1e}, each column scaled; a proof of whole plans expects "
            f"{MOST_DEPENDENT:.0e} at most, as after centring the variables, or rows that tell all"
        )


@dataclass(frozen=True, eq=False)
class Given:
    """The candidates as they were given, where a proof is about other parameters.

    Attributes:
        problem: The candidates, for parameters k.
        T: Parameters k' (p, p) of the proof, with ``k = T k'``.
        known: What every plan has for each experiment, for k.
    """

    problem: Problem
    T: Array
    known: Known


def prove_exact(
    problem: Problem,
    criterion: Criterion,
    limits: Limits,
    incumbent: Indices | None = None,
    *,
    seconds: float = np.inf,
    relaxed: RelaxedCounts | None = None,
    given: Given | None = None,
    progress: Progress = lambda nodes, cost, bound: None,
) -> ExactProof:
    """Prove that no plan within limits is better than the best that is known, or how much better.

    Branch and bound over multisets of candidates. A node says how many experiments are made in
    each of some groups of candidates; its multiplier closes it, or leaves candidates out
    (`ExactTree`). Groups of several candidates are divided where the best weights, not whole, are:
    so plans of near candidates are bounded together. Of children that differ in the count of a part
    those nearest to the weights are bounded first: their multipliers close most others. The node of
    the largest bound is divided first, so that the bound so far is that of the best node left.
    Weights that are rounded give plans, which become the incumbent where they are better. Ctrl-C,
    the end of `seconds`, and a `time_limit` around leave the bound so far.

    Args:
        problem: The candidates; a prior is part of `Limits.base` already.
        criterion: Convex, monotone, of positive degree.
        limits: What plans must obey.
        incumbent: A plan (n,) within the limits.
        seconds: Time to spend [s].
        relaxed: The relaxation of the same limits.
        given: The candidates as given, of which `problem` is what was whitened. The tree is about
            these; all that it multiplies with is computed from their rows.
        progress: Called with the number of nodes, the best cost, and the bound so far.

    Raises:
        UnprovableError: Nothing can be proved about this criterion or these limits.
        RelaxationError: No weights were found to begin with.
    """
    require_provable(criterion, limits)
    assert isinstance(criterion, Relaxable)
    since = monotonic()
    bare = problem.with_prior(None)
    if relaxed is None:
        relaxed = relaxed_counts(bare, criterion, limits)
    with time_limit(seconds):
        search = _Search(bare, criterion, limits, relaxed, incumbent, given)
        ended = search.run(progress)
    return search.proof(monotonic() - since, ended)


@dataclass(frozen=True, eq=False)
class _Working:
    """Candidates in parameters of order one, equal ones together.

    Where places may stay empty there is one candidate more, of the next number, that tells and
    costs nothing.

    Attributes:
        merits: Merits of plans of them.
        T: The parameters, of those as given.
        members: One candidate (n,) for each of them.
        place: Which of them each candidate, and the empty one, is.
        unit: What the costs (k,) of each budget are counted in.
    """

    merits: Merits
    T: Array
    members: Indices
    place: Indices
    unit: Array

    @classmethod
    def of(
        cls,
        problem: Problem,
        criterion: Relaxable,
        limits: Limits,
        weights: Array,
        given: Given,
    ) -> "_Working":
        """Whiten the mean of the best weights and of all candidates."""
        M = 0.5 * (problem.mean + problem.information(weights) / limits.m) + limits.base / limits.m
        own = _parameters(M)
        transformed, unit_of_cost = _of_order_one(criterion, own)
        T = given.T @ own
        kept = given.problem.kept.times(T)
        error = given.problem.kept.rounding_of_times(T)
        packed = kept.packed()
        if isinstance(kept, Rows):
            error = 2.0 * error * np.sqrt(np.square(kept.A).sum(axis=(1, 2)))
        prices, funds, unit = _prices(limits, problem.n)
        empty = 0 if limits.sized else 1
        packed = np.concatenate([packed, np.zeros((len(packed), empty))], axis=1)
        most = limits.most
        members = place = np.arange(problem.n + empty)
        if most is None:
            same = np.concatenate([given.problem.packed, prices[:, : problem.n]])
            _, members, place = np.unique(same, axis=1, return_index=True, return_inverse=True)
            place = np.append(place.ravel(), np.full(empty, len(members)))
            members = np.append(members, np.arange(problem.n, problem.n + empty))
        elif empty:
            most = np.append(most, limits.m)
        twice = sensitivity_rows(np.ones((problem.p, problem.p)))
        F = np.concatenate([twice[:, None] * packed, -prices])[:, members]
        merits = Merits(
            criterion=transformed,
            F=np.ascontiguousarray(F.T),
            K=np.append(sensitivity_rows(limits.m * given.known.times(T)), funds),
            error=float(error.max()),
            m=limits.m,
            most=most,
            budgets=len(funds),
            unit=unit_of_cost,
        )
        return cls(merits, T, members, place, unit)


def _of_order_one(criterion: Relaxable, T: Array) -> tuple[Relaxable, float]:
    """The criterion of k' with ``k = T k'``, and the unit of its costs: their size at the identity.

    What a criterion is about may be in any units. A factor s on T, a power of two, changes no
    digit, and multiplies costs by ``s^(2 degree)``.
    """
    found = criterion.transformed(T)
    assert isinstance(found, Relaxable)
    size = float(found.cost(np.eye(len(T))))
    if SMALLEST_OF_PARAMETER < size < LARGEST_OF_PARAMETER or not 0 < size < np.inf:
        return found, 1.0
    power = int(-np.log2(size) / (2 * criterion.degree))
    found = criterion.transformed(np.ldexp(T, power))
    assert isinstance(found, Relaxable)
    return found, float(2.0 ** (-2 * criterion.degree * power))


def _prices(limits: Limits, n: int) -> tuple[Array, Array, Array]:
    """Costs (k, n or n + 1) of budgets, their funds (k,), and the units (k,) of both.

    Where places may stay empty the last candidate is the empty one.
    """
    width = n if limits.sized else n + 1
    if limits.costs is None:
        return np.zeros((0, width)), np.zeros(0), np.ones(0)
    costs = np.atleast_2d(limits.costs)
    funds = np.atleast_1d(np.asarray(limits.funds, dtype=float))
    unit = np.abs(costs).max(axis=1)
    prices = np.concatenate([costs, np.zeros((len(costs), width - n))], axis=1)
    # Plans may exceed their funds by as much as a sum of costs is rounded.
    return prices / unit[:, None], (funds + 2 * SPENT * np.abs(funds)) / unit, unit


def _parameters(M: Array) -> Array:
    """T (p, p) of parameters in which information M (p, p) is of order one.

    Candidates of a criterion of some parameters may leave others open; they are scaled only.
    """
    scale = unit_scale(np.diag(M))
    if np.linalg.eigvalsh(M / np.outer(scale, scale))[0] > REGULAR:
        return whitener(M)
    return np.diag(1.0 / scale)


@dataclass(frozen=True, eq=False)
class _Open:
    """A node that is left to be divided.

    Attributes:
        bound: No plan of it has a larger merit.
        index: Its number in the tree.
        nodes: The node itself.
        Z: Its multiplier (q,).
        multiplier: The number of that in the tree.
    """

    bound: float
    index: int
    nodes: Nodes
    Z: Array
    multiplier: int

    def __lt__(self, other: "_Open") -> bool:
        """Whether it is divided first: the one of the largest bound, and of these the last one."""
        return (self.bound, self.index) > (other.bound, other.index)


class _Best(NamedTuple):
    """The best multipliers of nodes (b,) so far.

    Attributes:
        told: What they tell.
        Z: The multipliers (b, q + k).
        near: The information (b, p, p) near which each was made.
    """

    told: Told
    Z: Array
    near: Array

    def or_better(self, nodes: Nodes, other: "_Best") -> "_Best":
        """Of each node the multiplier that bounds it better."""
        one, two = self.told, other.told
        better = two.merit < one.merit
        of_groups = better[nodes.node_of_group]
        told = Told(
            np.where(better, two.merit, one.merit),
            np.where(better[nodes.node_of], two.sensitivities, one.sensitivities),
            np.where(of_groups, two.marginal, one.marginal),
            np.where(of_groups, two.tops, one.tops),
        )
        near = np.where(better[:, None, None], other.near, self.near)
        return _Best(told, np.where(better[:, None], other.Z, self.Z), near)


class _Search:
    """Open nodes, the best first, and the tree so far.

    Attributes:
        best: Cost of the best plan so far.
        counts: That plan (n,).
    """

    def __init__(
        self,
        problem: Problem,
        criterion: Relaxable,
        limits: Limits,
        relaxed: RelaxedCounts,
        incumbent: Indices | None,
        given: Given | None = None,
    ) -> None:
        if given is None:
            known = Known.of(limits.base).shared(limits.m)
            given = Given(problem, np.eye(problem.p), known)
        self.limits = limits
        self.criterion = criterion
        self.problem = problem
        self.joining: Merits | None = None  # once it is known what the root leaves
        self.working = _Working.of(problem, criterion, limits, relaxed.counts, given)
        self.inside = np.linalg.solve(given.T, self.working.T)
        self.merits = self.working.merits
        self.m = limits.m
        self.record = TreeRecord()
        self.open: list[_Open] = []
        self.best = np.inf
        self.counts = np.zeros(problem.n, dtype=int)
        if incumbent is not None:
            self.counts = incumbent
            self.best = self._cost(incumbent)
        empty = max(limits.m - float(relaxed.counts.sum()), 0.0)
        weights = np.append(relaxed.counts, empty)[: len(self.working.place)]
        together = np.bincount(self.working.place, weights).astype(float)
        self._plant(together, relaxed.multipliers)

    @property
    def target(self) -> float:
        """The cost below which a plan is better by more than the margin."""
        return self.best * (1.0 - MARGIN)

    @property
    def least(self) -> float:
        """The merit of that cost."""
        return self.merits.merit_of(self.target)

    @property
    def bound(self) -> float:
        """No plan costs less."""
        if not self.open:
            return self.target
        return min(self.target, self.merits.cost_of(self.open[0].bound))

    def _plant(self, weights: Array, known: Array) -> None:
        """The root, and an order of the candidates that it leaves."""
        alone = np.zeros(1, dtype=int)
        n = len(weights)
        self.order = np.arange(n)
        whole = Nodes(np.arange(n), weights, alone, np.array([self.m]), alone, alone, alone)
        root, best = self._settled(whole, self._first(whole, known))
        told, Z, _ = best
        self._round(root)
        starts = self._starts(root, told)
        keep, alive = told.fixed(root, self.least)
        left = np.flatnonzero(keep & alive[0])
        points = self._points(root, Z[0], float(told.merit[0]), left)
        inside = halved_order(points) if len(left) else alone[:0]
        self.order = np.concatenate([left[inside], np.flatnonzero(~(keep & alive[0]))])
        self.merits = self.merits[self.order]
        self.points = points[inside]
        self.joining = self.merits[np.arange(len(left))] if len(left) else None
        nothing = -np.ones(1, dtype=int)
        index = self.record.add_multipliers(Z, self.merits.shares(Z, best.near))
        self.record.add(nothing, nothing, alone, np.array([n]), np.array([self.m]), index)
        if len(left):
            self._exchange_starts(starts)
            kept = replace(
                whole, candidates=np.arange(len(left)), weights=root.weights[left[inside]]
            )
            self._push(kept.with_weights(kept.weights), told.merit, Z, alone, index)

    def _first(self, whole: Nodes, known: Array) -> _Best:
        """The best multiplier of the weights, or of some that are known (r, p, p)."""
        X = self.merits.information(whole, whole.weights)
        Z = self.merits.priced(whole, self.merits.multipliers(X))
        best = _Best(self.merits.tell(whole, Z), Z, X)
        S = np.linalg.inv(self.inside)
        for own in known:
            Z = self.merits.priced(whole, self.merits.scaled((S @ own @ S.T)[None], X))
            best = best.or_better(whole, _Best(self.merits.tell(whole, Z), Z, X))
        return best

    def _points(self, root: Nodes, Z: Array, merit: float, left: Indices) -> Array:
        """Features (k, q + k) of candidates, in parameters that whiten the best weights."""
        if not len(left):
            return np.zeros((0, 1))
        X = self.merits.information(root, root.weights)[0]
        # The best weights for a part of the parameters may be singular.
        R = whitener(X + ADDED_FOR_ORDER * np.trace(X) * np.eye(self.merits.p))
        rows, columns = triangle(self.merits.p)
        q = self.merits.q
        blocks = self.merits.unpacked(self.merits.F[left] / self.merits.twice)
        told = (R.T @ blocks @ R)[:, rows, columns] * np.sqrt(self.merits.twice[:q])
        # The price of a cost in parts of all merit, of which each of p directions is one.
        worth = Z[q:] * self.merits.p / max(merit, TINY)
        return np.asarray(np.concatenate([told, self.merits.F[left, q:] * worth], axis=1))

    def run(self, progress: Progress) -> str:
        """Divide node after node until none is left; why it ended."""
        try:
            while self.open:
                if out_of_time():
                    return "budget"
                progress(self.record.nodes, self.best, self.bound)
                self._divide()
        except KeyboardInterrupt:
            return "interrupted"
        return "proved"

    def _divide(self) -> None:
        """Divide the best nodes together; an interruption leaves them as they were."""
        some: list[_Open] = []
        size = 0
        least = self.least
        while self.open and len(some) < NODES_AT_ONCE and size < CANDIDATES_AT_ONCE:
            if self.open[0].bound <= least:  # a better plan has closed it, and all others
                self.open.clear()
                break
            some.append(heapq.heappop(self.open))
            size += len(some[-1].nodes.candidates)
        try:
            if some:
                self._branch(some)
        except KeyboardInterrupt:
            for own in some:
                heapq.heappush(self.open, own)
            raise

    def _branch(self, some: list[_Open]) -> None:
        """Divide nodes, and bound their children."""
        parents = Nodes.joined([own.nodes for own in some])
        Z = np.array([own.Z for own in some])
        index = np.array([own.index for own in some])
        inherited = np.array([own.bound for own in some])
        multiplier = np.array([own.multiplier for own in some])
        division = Division.of(parents, parts(parents, self.points), self.merits, Z, self.least)
        part, of = division.part, division.parent
        # First the parent's multiplier.
        children = division.children
        Z = Z[division.of_children]
        told = self.merits.told(children, Z, division.sensitivities)
        keep, alive = told.fixed(children, self.least)
        bound = np.minimum(inherited[division.of_children], told.merit)[alive]
        open_ = division.built[alive]
        own = multiplier[of]
        left = children.kept(keep, alive)
        nowhere = np.zeros((left.n, self.merits.p, self.merits.p))
        known = _Best(told.kept(children, keep, alive), Z[alive], nowhere)
        side, rank = division.siblings(parents, open_)
        settled, own[open_] = self._in_turn(left, known, side, rank, own[open_])
        nodes = self.record.add(
            index[of], parents.numbers[part.group][of], part.first[of], part.stop[of],
            division.counts, own,
        )  # fmt: skip
        for which, left, best in settled:
            keep, alive = best.told.fixed(left, self.least)
            lower = np.minimum(bound[which], best.told.merit)[alive]
            which = open_[which[alive]]
            self._push(left.kept(keep, alive), lower, best.Z[alive], nodes[which], own[which])

    def _in_turn(
        self, nodes: Nodes, known: _Best, side: Indices, rank: Indices, multiplier: Indices
    ) -> tuple[list[tuple[Indices, Nodes, _Best]], Indices]:
        """Settle siblings, those first whose counts are the nearest to the weights.

        The bound of one multiplier is linear in the count. So one that closes a sibling closes
        those farther out, too, as a rule, and these need none of their own.

        Args:
            nodes: The siblings (b,).
            known: Their parents' multipliers.
            side: Number of the parent and the side (b,), see `Division.siblings`.
            rank: How far out each is there (b,).
            multiplier: Numbers (b,) of the known multipliers in the tree.

        Returns:
            Which nodes were settled together, these with their weights, and their best multipliers;
            and numbers (b,) of the best multipliers in the tree.
        """
        settled = []
        multiplier = multiplier.copy()
        every = np.ones(len(nodes.candidates), dtype=bool)
        waiting = np.ones(nodes.n, dtype=bool)
        for nearest in (rank == 0, rank > 0):
            now = waiting & nearest
            which = np.flatnonzero(now)
            if not len(which):
                continue
            waiting &= ~now
            some = nodes.kept(every, now)
            before = _Best(known.told.kept(nodes, every, now), known.Z[now], known.near[now])
            some, best = self._settled(some, before)
            self._round(some)
            better = best.told.merit < before.told.merit
            shares = self.merits.shares(best.Z[better], best.near[better])
            multiplier[which[better]] = self.record.add_multipliers(best.Z[better], shares)
            settled.append((which, some, best))
            latest = np.full(side.max() + 1, -1)
            latest[side[which]] = np.arange(len(which))
            heirs = waiting & (latest[side] >= 0)
            by = latest[side[heirs]]
            closed = self.merits.tell(nodes.kept(every, heirs), best.Z[by]).merit <= self.least
            out = np.flatnonzero(heirs)[closed]
            multiplier[out] = multiplier[which[by[closed]]]
            waiting[out] = False
        return settled, multiplier

    def _push(
        self, nodes: Nodes, bound: Array, Z: Array, index: Indices, multiplier: Indices
    ) -> None:
        """Keep nodes that are left to be divided; those that are one plan alone are tried now."""
        nodes = nodes.with_weights(nodes.weights)
        is_plan = nodes.sizes == np.bincount(nodes.node_of_group, minlength=nodes.n)
        if is_plan.any():
            plans = nodes.kept(np.ones(len(nodes.candidates), dtype=bool), is_plan)
            self._round(plans)
        for i, own in enumerate(nodes.apart()):
            if is_plan[i]:
                continue
            entry = _Open(float(bound[i]), int(index[i]), own, Z[i], int(multiplier[i]))
            heapq.heappush(self.open, entry)

    def _settled(self, nodes: Nodes, best: _Best) -> tuple[Nodes, _Best]:
        """Find weights of nodes that are nearly the best, and keep the multipliers that bound best.

        A few candidates of each take part. Where others turn out to be more sensitive than these,
        they join, and nodes that are neither closed nor near their bound are settled once more.

        Args:
            nodes: The nodes (b,).
            best: Known multipliers of them.

        Returns:
            The nodes with their last weights, and the best multipliers.
        """
        told, Z, near = best
        merit = np.zeros(nodes.n)
        every = np.ones(len(nodes.candidates), dtype=bool)
        for _ in range(LOOKS_AT_NODE):
            open_ = ~is_near(best.told.merit, merit, self.least, self.merits.near)
            if not open_.any():
                break
            some = nodes.kept(every, open_)
            some, own, X = self._multipliers(some, told.kept(nodes, every, open_), best.Z[open_])
            told = told.put(nodes, open_, self.merits.tell(some, own))
            Z, near, merit = Z.copy(), near.copy(), merit.copy()
            Z[open_], near[open_] = own, X
            merit[open_] = self.merits.merits(some)
            weights = nodes.weights.copy()
            weights[open_[nodes.node_of]] = some.weights
            nodes = replace(nodes, weights=weights)
            best = best.or_better(nodes, _Best(told, Z, near))
        return nodes, best

    def _multipliers(self, nodes: Nodes, told: Told, Z: Array) -> tuple[Nodes, Array, Array]:
        """The best weights of nodes, their multipliers (b, q + k), and information near which.

        Args:
            nodes: The nodes (b,).
            told: What the last multipliers tell of them.
            Z: The best ones so far (b, q + k).
        """
        merits = self.merits
        if merits.floor is None:
            weights = best_weights(merits, nodes, told.sensitivities, self.least)
            nodes = nodes.with_weights(weights)
            X = merits.information(nodes, nodes.weights)
            return nodes, merits.priced(nodes, merits.multipliers(X)), X
        Z, weights = spectral_multipliers(merits, nodes, told.sensitivities, Z, self.least)
        # The polar does not depend on the information.
        one = np.broadcast_to(np.eye(merits.p), (nodes.n, merits.p, merits.p))
        prices = Z[:, merits.q :]
        Z = merits.scaled(merits.unpacked(Z), one)
        Z[:, merits.q :] = prices
        return nodes.with_weights(weights), Z, one

    def _round(self, nodes: Nodes) -> None:
        """Round the weights of nodes to whole experiments, and take over the best plan."""
        some = np.flatnonzero(nodes.weights > LIGHT_COUNT)
        group = nodes.group_of[some]
        weights = nodes.weights[some]
        whole = np.floor(weights + ROUNDED)
        groups = len(nodes.heads)
        missing = nodes.counts - np.bincount(group, whole, groups)
        order = np.lexsort((whole - weights, group))
        rank = np.empty(len(order), dtype=int)
        rank[order] = np.arange(len(order))
        rank -= np.searchsorted(group, np.arange(groups))[group]
        own = whole + (rank < missing[group])
        counts = np.zeros(len(nodes.weights))
        counts[some] = own
        information = self.merits.information(nodes, counts)
        costs = self.merits.unit * self.merits.criterion.cost(information)
        # Some have more experiments than candidates of any weight.
        short = np.bincount(group, own, groups) != nodes.counts
        costs[nodes.node_of_group[short]] = np.inf
        costs[~self.merits.allows(nodes, counts)] = np.inf
        least = int(costs.argmin())
        if costs[least] < self.best:
            chosen = np.flatnonzero((nodes.node_of == least) & (counts > 0))
            members = self.working.members[self.order[nodes.candidates[chosen]]]
            self.best = float(costs[least])
            n = len(self.counts)
            # What is behind the candidates stays empty.
            self.counts = np.bincount(members, counts[chosen], n + 1)[:n].astype(int)
            self._exchange(self._places)

    def _starts(self, root: Nodes, told: Told) -> Indices:
        """Plans (b, m) of some starts among the most sensitive candidates, the best first."""
        if not self._may_exchange:
            return np.zeros((0, self.m), dtype=int)
        some = np.argsort(-told.sensitivities, kind="stable")[:AMONG]
        chance = root.weights[some] / root.weights[some].sum() + 1.0 / len(some)
        rng = np.random.default_rng(0)
        places = rng.choice(len(some), size=(PROOF_STARTS, self.m), p=chance / chance.sum())
        members = self.working.members[some]
        beside = self.problem.with_prior(self.limits.base / self.m)[members]
        found, costs = exchange(
            beside, self.criterion, places, shortlists=SHORTLISTS, thorough=False
        )
        _, first = np.unique(np.sort(members[found], axis=1), axis=0, return_index=True)
        first = first[np.argsort(costs[first], kind="stable")]
        self._take(members[found[first[0]]])
        return members[found[first]]

    def _take(self, places: Indices) -> None:
        """Take over a plan (k,) of the candidates as given, where it is better than the best."""
        counts = np.bincount(places, minlength=self.problem.n)
        cost = self._cost(counts)
        if cost < self.best:
            self.best = cost
            self.counts = counts

    @property
    def _places(self) -> Indices:
        """The candidates (m,) of the best plan's experiments."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def _cost(self, counts: Indices) -> float:
        """The cost of a plan (n,)."""
        M = self.problem.information(counts) + self.limits.base
        return float(self.criterion.cost(M))

    def _exchange_starts(self, starts: Indices) -> None:
        """Improve the best of some plans (b, m), and the best plan, by exchanges."""
        for places in starts[: max(1, EXCHANGED_PLACES // self.m)]:
            self._exchange(places)
        self._exchange(self._places)

    def _exchange(self, places: Indices) -> None:
        """Improve a plan (k,) by exchanges, where no limits forbid some.

        A plan that is better than the best has no other candidates than those that are left.
        """
        merits = self.joining
        if merits is None or not self._may_exchange or not len(places):
            return
        blocks = np.swapaxes(self.inside, 0, 1) @ self.problem.blocks(places) @ self.inside
        features = merits.packed(blocks) * merits.twice
        own = merits.of(merits.unpacked(((merits.K + features.sum(axis=0)) / merits.twice)[None]))
        found = exchanged(merits, features, float(own[0])).places
        members = self.working.members[self.order[np.maximum(found, 0)]]
        self._take(np.where(found < 0, places, members))

    @property
    def _may_exchange(self) -> bool:
        """Whether any candidate may take a place of any plan."""
        return self.limits.sized and not self.limits.restricts

    def proof(self, seconds: float, ended: str) -> ExactProof:
        """What is proved so far."""
        bound = self.bound
        order = self.working.members[self.order]
        tree = self.record.tree(self.working.T, order, self.merits, self.working.unit, bound)
        return ExactProof(
            cost=bound * (1.0 - MARGIN),
            counts=self.counts,
            best=self.best,
            proved=not self.open,
            tree=tree,
            seconds=seconds,
            ended=ended,
        )
