"""A proof that no plan of whole experiments costs less, replayed by numpy alone.

A plan of m experiments has ``X = K + sum r_i M_i``, with K what every plan has. A criterion of
degree d has the merit ``cost^(-1/d)``; of every semidefinite Z with the least cost P under
``<Z, X> <= 1`` it is at most ``<Z, X> P^(-1/d)``. The tree divides all plans. A node has
some groups of candidates, with a number of experiments in each; so ``<Z, X>`` is at most
``u = <Z, K> + sum of number * (largest <Z, M_i> of the group)``, and a node whose u is below the
merit of the stated bound has no better plan. Of others, candidates without which u would be below
it are left out, and a group is divided: its children have every number of experiments in one part
of it, and the rest in the other. Nothing in the file is believed: that a tree misses no plan, and
each u, is computed here, with rounding on the safe side.

Where the counts r of plans obey ``C r <= f``, any prices ``mu >= 0`` may be added, as
``<mu, f - C r> >= 0``: what every plan has is K and f, what an experiment adds is M_i and minus its
costs. Where places may stay empty there is one candidate more, that tells and costs nothing.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute.array_criteria import Part
from edtk.certificate.recompute.arrays import Candidates, Design, Frame
from edtk.certificate.recompute.candidates import require
from edtk.certificate.recompute.plain_data import in_range, numbers, rows, table
from edtk.certificate.recompute.tasks import EPS
from edtk.certificate.recompute.values import factor_of
from edtk.system.typing import Array, Indices, Mask

TREE = ("T", "order", "multipliers", "multiplier", "parent", "group", "first", "stop", "count")
MOST_NODES = 2_000_000
MOST_SIZE = 5000  # experiments of a plan
CANDIDATES_AT_ONCE = 400_000  # candidates of nodes that are looked at together
PER_VISIT = 0.15  # of a candidate of a node [us]
WHOLE = 2**53
SPENT = 2e-12  # part of the funds by which the rounding of a sum of costs may exceed them
SURE = 1e-12  # part that rounding may take of an eigenvalue, far below what a proof leaves


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes and multipliers as a file has them, with numbers in their ranges.

    Attributes:
        T: Multipliers are those of parameters k' with ``k = T k'`` (p, p).
        order: Candidate (n,) at each position.
        multipliers: Upper triangles (r, q), row by row.
        prices: Prices (r, k) of budgets beside each.
        shares: Shares (r, groups) that go with each, of a criterion that is the worst of several.
        columns: Multiplier, parent, group, first, stop and count (6, nodes).
    """

    T: Array
    order: Indices
    multipliers: Array
    prices: Array
    shares: Array | None
    columns: Indices

    @classmethod
    def of(cls, given: Any, n: int, p: int, budgets: int = 0) -> "Tree":
        """Read a tree about n candidates, p parameters, and a number of budgets.

        Raises:
            ValueError: It is none; one line says where.
        """
        table(given, TREE, "tree", ("shares", "prices"))
        T = numbers(given["T"], (p, p), "tree.T")
        order = _whole(given["order"], 0, n - 1, "tree.order")
        Z = numbers(given["multipliers"], (None, p * (p + 1) // 2), "tree.multipliers")
        prices = np.zeros((len(Z), 0))
        if given.get("prices") is not None:
            prices = numbers(given["prices"], (len(Z), budgets), "tree.prices")
            if not (prices >= 0).all():
                raise ValueError("tree.prices: expected prices that are not negative")
        shares = None
        if given.get("shares") is not None:
            shares = numbers(given["shares"], (len(Z), None), "tree.shares")
            if not (shares >= 0).all() or not (shares.sum(axis=1) > 0).all():
                raise ValueError("tree.shares: expected shares that are not negative")
            shares = shares / shares.sum(axis=1, keepdims=True)
        names = ("multiplier", "parent", "group", "first", "stop", "count")
        columns = [_whole(given[name], -1, WHOLE, f"tree.{name}") for name in names]
        if len({len(column) for column in columns}) > 1 or not 0 < len(columns[0]) <= MOST_NODES:
            raise ValueError("tree: expected as many entries of each node, and one node or more")
        found = cls(T, order, Z, prices, shares, np.array(columns))
        found._require_order()
        return found

    def _require_order(self) -> None:
        """Check that parents come first, and that children of one parent divide it alike."""
        multiplier, parent, group, first, stop, count = self.columns
        n = len(self.order)
        if len(np.unique(self.order)) < n:
            raise ValueError("tree.order: expected each candidate once")
        if parent[0] != -1 or (parent[1:] < 0).any() or (parent >= np.arange(len(parent))).any():
            raise ValueError("tree.parent: expected parents before their children")
        if (multiplier < 0).any() or (multiplier >= len(self.multipliers)).any():
            raise ValueError("tree.multiplier: expected numbers of multipliers")
        inside = (first >= 0) & (first < stop) & (stop <= n) & (count >= 0)
        if not inside.all() or (group[1:] < 0).any():
            raise ValueError("tree: expected parts of the candidates, and counts from zero")
        alike = np.array([group, first, stop])[:, self.by_parent]
        same = np.diff(parent[self.by_parent]) == 0
        if (np.diff(alike, axis=1)[:, same] != 0).any():
            raise ValueError("tree: expected children that divide their parent alike")

    @cached_property
    def by_parent(self) -> Indices:
        """Nodes in the order of their parents, children of one in the order of their counts."""
        return np.lexsort((self.columns[5], self.columns[1]))

    def children(self, nodes: Indices) -> tuple[Indices, Indices]:
        """Where the children of nodes (b,) begin in `by_parent`, and how many each has."""
        parents = self.columns[1][self.by_parent]
        begin = np.searchsorted(parents, nodes)
        return begin, np.searchsorted(parents, nodes, side="right") - begin


def _whole(given: Any, least: int, most: int, where: str) -> Indices:
    """Whole numbers (k,) in a range."""
    found = numbers(given, (None,), where)
    if (found != np.floor(found)).any() or (found < least).any() or (found > most).any():
        raise ValueError(f"{where}: expected whole numbers from {least} to {most}")
    return found.astype(int)


@dataclass(frozen=True, eq=False)
class _Batch:
    """Nodes (b,) with the candidates that they leave, node after node.

    Attributes:
        nodes: Their numbers in the tree.
        counts: Experiments (b, g) in each group.
        groups: How many groups (b,) each node has had.
        own: <Z, K> (b,) of each node's multiplier, rounding included.
        node: The node (s,) of each candidate, in this batch.
        position: Its position (s,).
        group: Its group (s,).
        z: Its sensitivity (s,) to the node's multiplier.
    """

    nodes: Indices
    counts: Indices
    groups: Indices
    own: Array
    node: Indices
    position: Indices
    group: Indices
    z: Array

    def some(self, chosen: Mask, keep: Mask) -> "_Batch":
        """Some nodes (b,), with some of the candidates (s,) of these."""
        keep = keep & chosen[self.node]
        place = np.cumsum(chosen) - 1
        return _Batch(
            self.nodes[chosen],
            self.counts[chosen],
            self.groups[chosen],
            self.own[chosen],
            place[self.node[keep]],
            self.position[keep],
            self.group[keep],
            self.z[keep],
        )

    def parts(self) -> list["_Batch"]:
        """The same in batches of fewer candidates."""
        sizes = np.bincount(self.node, minlength=len(self.nodes))
        number = np.cumsum(sizes) // CANDIDATES_AT_ONCE
        every = np.ones(len(self.node), dtype=bool)
        return [self.some(number == i, every) for i in np.unique(number)]

    def fixed(self, least: float, most: Indices | None) -> tuple[Mask, Mask]:
        """The nodes (b,) that may have a better plan, and the candidates (s,) that may be in it.

        Args:
            least: The merit that a better plan exceeds.
            most: How often the candidate at each position may be chosen (n,); None for no limit.
        """
        used = self.counts > 0
        # A group of experiments without candidates, or with too few, leaves no plan.
        sums, last = self._alone() if most is None else self._limited(most)
        u = self.own + np.where(used, sums, 0.0).sum(axis=1)
        slack = u[self.node] - last[self.node, self.group] + self.z
        inside = used[self.node, self.group]
        # What is no number closes nothing.
        return ~(u <= least), inside & ~(slack <= least)

    def _alone(self) -> tuple[Array, Array]:
        """The largest sums (b, g) of sensitivities in each group, and the least term of each."""
        b, g = self.counts.shape
        tops = np.full(b * g, -np.inf)
        np.maximum.at(tops, self.node * g + self.group, self.z)
        tops = tops.reshape(b, g)
        used = self.counts > 0
        return np.asarray(self.counts * np.where(used, tops, 0.0), dtype=float), tops

    def _limited(self, most: Indices) -> tuple[Array, Array]:
        """The same where candidates may be chosen so often at most."""
        b, g = self.counts.shape
        key = self.node * g + self.group
        order = np.lexsort((-self.z, key))
        key = key[order]
        limit = most[self.position[order]]
        before = np.cumsum(limit) - limit
        before -= before[np.searchsorted(key, key)]
        count = self.counts.ravel()[key]
        taken = np.clip(count - before, 0, limit)
        sums = np.bincount(key, taken * self.z[order], b * g)
        short = np.bincount(key, taken, b * g) < self.counts.ravel()
        last = np.full(b * g, np.inf)
        np.minimum.at(last, key[taken > 0], self.z[order][taken > 0])
        return np.where(short, -np.inf, sums).reshape(b, g), last.reshape(b, g)


@dataclass(frozen=True, eq=False)
class Budget:
    """What the new experiments of a plan may cost together.

    Attributes:
        costs: Costs (n,) of an experiment, above zero; where places may stay empty, a last zero.
        funds: Their sum at most.
    """

    costs: Array
    funds: float

    @property
    def unit(self) -> float:
        """What both are counted in, so that they are of order one."""
        return float(self.costs.max())

    @property
    def most(self) -> float:
        """The funds, with the rounding of a sum of costs."""
        return self.funds * (1 + SPENT)

    def number(self, most: Indices | None) -> int:
        """The largest number of experiments that the funds pay for."""
        order = np.argsort(self.costs[self.costs > 0], kind="stable")
        left = self.most
        number = 0
        for i in order:
            affordable = math.floor(left / self.costs[i])
            bought = affordable if most is None else min(affordable, int(most[i]))
            number += bought
            left -= bought * self.costs[i]
        return number


@dataclass(frozen=True, eq=False)
class Replay:
    """A tree on its candidates, ready to be replayed.

    Attributes:
        tree: The tree.
        part: The criterion.
        candidates: The candidates, what every plan has as their prior.
        m: Number of experiments.
        most: How often each candidate may be chosen (n,); None for no limit.
        budget: What plans may cost; None for no limit.
        power: A unit of rows, or of what the criterion is about: costs as given are
            ``2^(2 power degree)`` times those here.
    """

    tree: Tree
    part: Part
    candidates: Candidates
    m: int
    most: Indices | None = None
    budget: "Budget | None" = None
    power: int = 0

    def given(self, cost: float) -> float:
        """The cost in the units that were given, of a cost here."""
        return float(np.ldexp(cost, int(2 * self.power * self.part.degree)))

    def proves(self, cost: float) -> str:
        """Why no plan is proved to cost at least so much; empty if it is."""
        multiplier, _, _, first, stop, count = self.tree.columns
        cost = float(np.ldexp(cost, -int(2 * self.power * self.part.degree)))
        n = len(self.tree.order)
        if (first[0], stop[0], count[0]) != (0, n, self.m):
            return "the root is not all plans"
        if self._misses_candidates():
            return "a candidate is missing that equals no other"
        least = float(np.power(cost, -1.0 / self.part.degree)) * (1 - 4 * EPS)
        visits = 0
        root = int(multiplier[0])
        alone = np.zeros(1, dtype=int)
        z = self.F @ self.Z[root]
        whole = _Batch(
            alone, np.array([[self.m]]), np.ones(1, dtype=int), self.own[[root]],
            np.zeros(n, dtype=int), np.arange(n), np.zeros(n, dtype=int), z,
        )  # fmt: skip
        waiting = [whole.some(*whole.fixed(least, self.limit))]
        while waiting:
            batch = waiting.pop()
            if not len(batch.nodes):
                continue
            begin, number = self.tree.children(batch.nodes)
            reason = self._leaves(batch, number == 0, cost) or _incomplete(
                batch, self.tree, begin, number
            )
            if reason:
                return reason
            for one in batch.some(number > 0, np.ones(len(batch.node), dtype=bool)).parts():
                sizes = np.bincount(one.node, minlength=len(one.nodes))
                visits += int(sizes @ self.tree.children(one.nodes)[1])
                require(visits * PER_VISIT, "the nodes of the tree")
                waiting.append(self._divided(one, least))
        return ""

    def _divided(self, batch: _Batch, least: float) -> _Batch:
        """The children that may have a better plan, with the candidates that they leave."""
        multiplier, _, group, first, stop, count = self.tree.columns
        begin, number = self.tree.children(batch.nodes)
        of = np.repeat(np.arange(len(batch.nodes)), number)
        ends = np.cumsum(number)
        nodes = self.tree.by_parent[np.arange(len(of)) + (begin - ends + number)[of]]
        sizes = np.bincount(batch.node, minlength=len(batch.nodes))
        heads = np.cumsum(sizes) - sizes
        child = np.repeat(np.arange(len(of)), sizes[of])
        tails = np.cumsum(sizes[of])
        source = np.arange(len(child)) + (heads[of] - tails + sizes[of])[child]
        position = batch.position[source]
        own = batch.group[source]
        groups = batch.groups[of]
        inside = (own == group[nodes][child]) & (position >= first[nodes][child])
        inside &= position < stop[nodes][child]
        own = np.where(inside, groups[child], own)
        each = np.arange(len(of))
        width = max(batch.counts.shape[1], int(groups.max()) + 1)
        counts = np.zeros((len(of), width), dtype=int)
        counts[:, : batch.counts.shape[1]] = batch.counts[of]
        counts[each, group[nodes]] -= count[nodes]
        counts[each, groups] = count[nodes]
        made = _Batch(
            nodes, counts, groups + 1, batch.own[of], child, position, own, batch.z[source]
        )
        # First by the multiplier of the parent, then by its own.
        made = made.some(*made.fixed(least, self.limit))
        number_of = multiplier[made.nodes]
        z = made.z.copy()
        other = number_of != multiplier[self.tree.columns[1][made.nodes]]
        those = np.flatnonzero(other[made.node])
        for some in (
            np.array_split(those, -(-len(those) // CANDIDATES_AT_ONCE)) if len(those) else ()
        ):
            Z = self.Z[number_of[made.node[some]]]
            z[some] = np.einsum("ij,ij->i", self.F[made.position[some]], Z)
        made = _Batch(
            made.nodes, made.counts, made.groups, self.own[number_of],
            made.node, made.position, made.group, z,
        )  # fmt: skip
        return made.some(*made.fixed(least, self.limit))

    def _leaves(self, batch: _Batch, leaves: Mask, cost: float) -> str:
        """Why a node without children leaves a plan below a cost; empty if none does."""
        if not leaves.any():
            return ""
        own = batch.some(leaves, np.ones(len(batch.node), dtype=bool))
        sizes = np.bincount(own.node, minlength=len(own.nodes))
        if (sizes > (own.counts > 0).sum(axis=1)).any():
            return "a node is left open"
        frame = Frame.of_candidates(self.candidates)
        for i in range(len(own.nodes)):
            some = own.node == i
            counts = np.zeros(self.number)
            counts[self.tree.order[own.position[some]]] = own.counts[i, own.group[some]]
            if self.budget is not None and counts @ self.budget.costs > self.budget.most:
                continue
            counts = counts[: self.candidates.n]
            design = Design.of(self.candidates, frame, counts)
            if self.part.needs_all and len(design.root.hidden):
                continue
            if self.part.cost(design)[0] < cost:
                return "a plan of the tree costs less"
        return ""

    def _misses_candidates(self) -> bool:
        """Whether a candidate without a position differs from all that have one."""
        if len(self.tree.order) == self.number:
            return False
        if self.most is not None:
            return True
        packed = _packed(self.candidates, np.eye(self.candidates.p))[0]
        if self.budget is not None:
            packed = np.append(packed, self.budget.costs[: len(packed), None], axis=1)
        if self.number > len(packed):
            # The empty place: of a kind of its own, as no experiment is for nothing.
            packed = np.append(packed, np.zeros((1, packed.shape[1])), axis=0)
        _, kinds = np.unique(packed, axis=0, return_inverse=True)
        return len(np.unique(kinds)) > len(np.unique(kinds[self.tree.order]))

    @cached_property
    def limit(self) -> Indices | None:
        """How often the candidate at each position may be chosen (n,); None for no limit."""
        if self.most is None:
            return None
        most = np.append(self.most, np.full(self.number - len(self.most), self.m))
        return np.asarray(np.minimum(most, self.m)[self.tree.order])

    @property
    def number(self) -> int:
        """Number of candidates, with the empty place where there is one."""
        return self.candidates.n if self.budget is None else len(self.budget.costs)

    @cached_property
    def twice(self) -> Array:
        """How often each entry (q + k,) of a triangle stands in a matrix; budgets once."""
        i, j = np.triu_indices(self.candidates.p)
        budgets = self.tree.prices.shape[1]
        return np.append(np.where(i == j, 1.0, 2.0), np.ones(budgets))

    @cached_property
    def _information(self) -> tuple[Array, float]:
        """Features (n, q + k) at each position, and a bound on the rounding of the worst."""
        packed, error = _packed(self.candidates, self.tree.T)
        empty = np.zeros((self.number - len(packed), packed.shape[1]))
        packed = np.concatenate([packed, empty])
        if self.budget is not None:
            packed = np.append(packed, -self.budget.costs[:, None] / self.budget.unit, axis=1)
        return packed[self.tree.order], error

    @cached_property
    def F(self) -> Array:
        """Triangles (n, q) whose product with a multiplier's is a sensitivity."""
        return np.ascontiguousarray(self._information[0] * self.twice)

    @cached_property
    def Z(self) -> Array:
        """Multipliers (r, q + k), scaled so that no merit is above ``<Z, X>``.

        Raises:
            ValueError: One is not positive semidefinite.
        """
        p = self.candidates.p
        i, j = np.triu_indices(p)
        M = np.empty((len(self.tree.multipliers), p, p))
        M[:, i, j] = M[:, j, i] = self.tree.multipliers
        # A multiplier proves the same at any length; squares of a long one are no doubles.
        length = np.abs(M).max(axis=(1, 2), initial=0.0)
        power = -np.frexp(length)[1][:, None]
        M = np.ldexp(M, power[:, :, None])
        r = np.linalg.eigvalsh(M)
        lift = 8 * p * EPS * np.abs(r).max(axis=1, initial=0.0)
        if not (r[:, 0] + lift >= 0).all():
            raise ValueError("tree.multipliers: expected positive semidefinite matrices")
        M = M + (2 * lift)[:, None, None] * np.eye(p)
        features = M[:, i, j]
        if self.budget is not None:
            # Any price proves something; in this unit it belongs to its multiplier.
            prices = np.ldexp(self.tree.prices, power) * self.budget.unit
            features = np.append(features, prices, axis=1)
        return np.asarray(features * self._scales(M)[:, None])

    def _scales(self, Z: Array) -> Array:
        """``P^(-1/d)`` (r,), rounded up; infinite of a multiplier that bounds nothing."""
        part = self.part
        frame = Frame(self.tree.T)
        side = frame.side(part.K)
        in_range(len(side.J) * side.J, "tree.T")
        least = np.zeros(len(Z))
        unsure = np.ones(len(Z), dtype=bool)
        if part.form != "worst" and part.K.shape[1] <= self.candidates.p:
            # All at once; where squares lose digits, each by itself.
            J = side.J
            N = J.T @ Z @ J
            length = np.linalg.norm(J) * np.linalg.norm(Z, axis=(1, 2))
            lost = 2 * length * np.linalg.norm(side.error)
            lost += 16 * len(J) * EPS * length * np.linalg.norm(J)
            e = np.linalg.eigvalsh(N) - lost[:, None]
            least = self._least(np.maximum(e, 0.0)) ** part.power
            unsure = ~(lost <= SURE * e[:, 0])
        shares = self.tree.shares
        for i in np.flatnonzero(unsure):
            own = part.least(factor_of(Z[i]), side, None if shares is None else shares[i])
            least[i] = max(own, least[i])
        with np.errstate(divide="ignore"):
            return np.asarray((least * (1 - 64 * EPS)) ** (-1.0 / part.degree))

    def _least(self, e: Array) -> Array:
        """The least of a form by squared singular values (r, s), see `array_criteria`."""
        s = e.shape[1]
        if self.part.is_volume:
            with np.errstate(divide="ignore"):
                logs = np.log(e).sum(axis=1) + 2 * (self.part.logs - self.part.lost)
                return np.asarray(s * np.exp(logs / s))
        if self.part.form == "sum":
            return np.asarray(np.sqrt(e).sum(axis=1) ** 2)
        if self.part.form == "longest":
            return np.asarray(e.sum(axis=1))
        if self.part.form == "lengths":
            return np.asarray((e ** (1 / 3)).sum(axis=1) ** 1.5)
        r = self.part.q / (1 + self.part.q)
        return np.asarray(s * ((e**r).mean(axis=1)) ** (1 / r))

    @cached_property
    def own(self) -> Array:
        """``<Z, K>`` (r,), and what rounding may have made of any ``<Z, X>`` in the tree."""
        packed, error = self._information
        p = self.candidates.p
        K, wrong = Frame(self.tree.T).squares(self.candidates.prior)
        K = K.astype(float)
        i, j = np.triu_indices(p)
        every = K[i, j]
        if self.budget is not None:
            every = np.append(every, self.budget.funds * (1 + SPENT) / self.budget.unit)
        length = np.sqrt((np.square(self.Z) * self.twice).sum(axis=1))
        largest = float(np.sqrt((np.square(packed) * self.twice).sum(axis=1).max()))
        size = float(np.linalg.norm(every * np.sqrt(self.twice))) + self.m * largest
        rounding = (4 * p * p + self.m) * EPS * size + self.m * error + float(np.linalg.norm(wrong))
        return np.asarray(self.Z @ (every * self.twice) + length * rounding)


def _incomplete(batch: _Batch, tree: Tree, begin: Indices, number: Indices) -> str:
    """Why the children of nodes are not all that there are; empty if they are."""
    inner = np.flatnonzero(number)
    if not len(inner):
        return ""
    first = tree.by_parent[begin[inner]]
    group = tree.columns[2][first]
    if (group >= batch.groups[inner]).any():
        return "a node divides a group that it does not have"
    whole = batch.counts[inner, group]
    if (number[inner] != whole + 1).any():
        return "a node has not all children"
    of = np.repeat(np.arange(len(inner)), number[inner])
    place = np.arange(len(of)) - (np.cumsum(number[inner]) - number[inner])[of]
    counts = tree.columns[5][tree.by_parent[begin[inner][of] + place]]
    return "" if (counts == place).all() else "a node has not all children"


def _packed(candidates: Candidates, T: Array) -> tuple[Array, float]:
    """Triangles (n, q) of ``T'M_i T``, and a bound on the rounding of any (Frobenius).

    The prior is left out.
    """
    p = candidates.p
    i, j = np.triu_indices(p)
    packed = np.empty((candidates.n, len(i)))
    error = 0.0
    size = np.abs(T)
    frame = Frame(T)
    for part in candidates.parts():
        if candidates.information is None:
            # Where a prior tells what they do not, terms of rows cancel.
            X, wrong = candidates.framed(frame, part)
            own = np.swapaxes(X, 1, 2) @ X
            length = np.linalg.norm(X, axis=(1, 2))
            lost = (2 * length + wrong) * wrong + len(X[0]) * p * EPS * length**2
        else:
            M = candidates.information[part]
            own = T.T @ M @ T
            lost = 4 * p * EPS * np.linalg.norm(size.T @ np.abs(M) @ size, axis=(1, 2))
        packed[part] = own[:, i, j]
        error = max(error, float(lost.max()))
    return packed, error


def counts_of(given: Any, n: int, where: str) -> Indices:
    """How often each of n candidates stands in a list (n,)."""
    chosen = _whole(rows(given, MOST_SIZE, where), 0, n - 1, where)
    return np.bincount(chosen, minlength=n)


def plan_of(given: Any, n: int) -> Indices:
    """Counts (n,) of a plan's candidates."""
    places = counts_of(given["candidate"], n, "plan.candidate")
    counts: Array = numbers(given["count"], (None,), "plan.count")
    chosen = np.array(given["candidate"], dtype=int)
    is_whole = (counts == np.floor(counts)).all() and (counts > 0).all() and counts.sum() < 1e6
    if len(counts) != len(chosen) or not is_whole or places.max(initial=0) > 1:
        raise ValueError("plan: expected each candidate once, with a whole number of experiments")
    return np.bincount(chosen, counts, n).astype(int)
