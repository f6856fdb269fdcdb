"""Many nodes of a proof at once: their groups of candidates, and what multipliers tell of them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from criteria import Relaxable
from criteria.linalg.inverse import EPS, eigenpairs
from criteria.linalg.typing import triangle
from edtk.design.information import order, unpack
from edtk.system.typing import Array, Indices, Mask

# Part of its trace that is added to the information at which a multiplier is taken: a node of few
# experiments may be singular. The bound holds for any multiplier.
TRACE_RIDGE = 1e-6
LARGE_NODE = 48  # candidates of a node from which on a product of its own is quicker
DENSE = 4  # positions for each candidate up to which the product is one of all of them
SHARPNESS = 128.0  # of soft maxima
BLURRED = 2.0 / SHARPNESS  # part of a merit that these may take
STRETCHES = 128  # of a node, of which each has a candidate that is heard
FEWEST_STRETCHES = 16  # of a group
SOME = 1e-3  # part of a group's experiments from which on a weight is some
# Distance of a bound that is near, in parts of what it leaves. Tuned on the paper's example: the
# trees of nearer bounds are no smaller; at kinks each digit takes many steps.
NEAR = 2e-3
NEAR_AT_KINKS = 3e-2
NEAREST = 1e-7  # in parts of the merit
PRICED = 8  # looks at the candidates for the best price of a budget
LEAST_PRICE = 1e-4  # part of a bound by which another price still matters


def is_near(bound: Array, merit: Array, least: float, near: float) -> Mask:
    """Whether bounds (b,) of nodes close these, or are near merits (b,) of some of their weights.

    A node that is not to be closed needs no bound that is nearer than what it leaves open. What is
    no number is as near as it comes.

    Args:
        bound: No plan of a node has a larger merit.
        merit: The merit of some weights.
        least: A node of no larger merit is closed.
        near: Distance of a bound that is near, in parts of what it leaves open.
    """
    distance = np.maximum(near * (merit - least), NEAREST * merit)
    return np.asarray(~(bound > least) | ~(bound - merit > distance))


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes (b,), each with its groups of candidates; groups without experiments are left out.

    Attributes:
        candidates: Positions (s,) of the candidates, group after group, ascending in each.
        weights: Weights (s,), not whole, that sum to the counts in each group.
        heads: Where each group (g,) begins.
        counts: Experiments (g,) in each.
        numbers: Number (g,) of each in its node, see `ExactTree`.
        first_groups: The first group (b,) of each node.
        depths: Depth (b,) of each node, which is the number of its latest group.
    """

    candidates: Indices
    weights: Array
    heads: Indices
    counts: Indices
    numbers: Indices
    first_groups: Indices
    depths: Indices

    @cached_property
    def n(self) -> int:
        """Number of nodes."""
        return len(self.first_groups)

    @cached_property
    def starts(self) -> Indices:
        """Where each node (b,) begins among the candidates."""
        return self.heads[self.first_groups]

    @cached_property
    def lengths(self) -> Indices:
        """Candidates (g,) of each group."""
        return np.diff(self.heads, append=len(self.candidates))

    @cached_property
    def sizes(self) -> Indices:
        """Candidates (b,) of each node."""
        return np.diff(self.starts, append=len(self.candidates))

    @cached_property
    def group_of(self) -> Indices:
        """The group (s,) of each candidate."""
        return np.repeat(np.arange(len(self.heads)), self.lengths)

    @cached_property
    def node_of(self) -> Indices:
        """The node (s,) of each candidate."""
        return np.repeat(np.arange(self.n), self.sizes)

    @cached_property
    def node_of_group(self) -> Indices:
        """The node (g,) of each group."""
        number = np.diff(self.first_groups, append=len(self.heads))
        return np.repeat(np.arange(self.n), number)

    def kept(self, keep: Mask, alive: Mask) -> "Nodes":
        """Some candidates (s,) of some nodes (b,); each of their groups keeps at least one."""
        keep = keep & alive[self.node_of]
        groups = alive[self.node_of_group]
        lengths = np.add.reduceat(keep.astype(int), self.heads)[groups]
        number = np.diff(self.first_groups, append=len(self.heads))[alive]
        return Nodes(
            candidates=self.candidates[keep],
            weights=self.weights[keep],
            heads=np.cumsum(lengths) - lengths,
            counts=self.counts[groups],
            numbers=self.numbers[groups],
            first_groups=np.cumsum(number) - number,
            depths=self.depths[alive],
        )

    def with_weights(self, weights: Array) -> "Nodes":
        """Other weights (s,), scaled to the counts of the groups; equal ones where all are zero."""
        sums = np.add.reduceat(weights, self.heads)
        if not sums.all():
            weights = np.where((sums == 0)[self.group_of], 1.0, weights)
            sums = np.add.reduceat(weights, self.heads)
        return replace(self, weights=weights * (self.counts / sums)[self.group_of])

    def spread(self, z: Array) -> tuple[Indices, Mask]:
        """Candidates (b, c) of each node that stand for all, and where there is one.

        They are those that have some weight, and of every stretch of a group the one of the largest
        z (s,): the order of candidates keeps near ones together, so that all regions are heard.

        Returns:
            Positions (b, c) among the candidates of all nodes, and a mask (b, c).
        """
        groups = np.bincount(self.node_of_group, minlength=self.n)[self.node_of_group]
        stretches = np.maximum(STRETCHES // groups, FEWEST_STRETCHES)
        stretches = np.minimum(stretches, self.lengths)[self.group_of]
        within = np.arange(len(self.candidates)) - self.heads[self.group_of]
        stretch = within * stretches // self.lengths[self.group_of]
        begins = np.append(True, (np.diff(self.group_of) != 0) | (np.diff(stretch) != 0))
        top = np.maximum.reduceat(z, np.flatnonzero(begins))[np.cumsum(begins) - 1]
        heard = (z >= top) | (self.weights > SOME * self.counts[self.group_of])
        some = np.flatnonzero(heard)
        sizes = np.bincount(self.node_of[some], minlength=self.n)
        known = np.arange(int(sizes.max())) < sizes[:, None]
        chosen = np.zeros(known.shape, dtype=int)
        chosen[known] = some
        return chosen, known

    def grouped(self, chosen: Indices, known: Mask) -> tuple[Array, Array]:
        """Experiments (b, g) of each group, and groups (b, c, g) of candidates as ones and zeros.

        Args:
            chosen: Positions (b, c) of the candidates.
            known: Where there is one (b, c).
        """
        place = np.arange(len(self.heads)) - self.first_groups[self.node_of_group]
        groups = int(place.max()) + 1
        counts = np.zeros((self.n, groups))
        counts[self.node_of_group, place] = self.counts
        own = (place[self.group_of[chosen]][..., None] == np.arange(groups)) & known[..., None]
        return counts, own.astype(float)

    def apart(self) -> list["Nodes"]:
        """Each node alone."""
        ends = np.append(self.starts, len(self.candidates))
        group_ends = np.append(self.first_groups, len(self.heads))
        alone = np.zeros(1, dtype=int)
        return [
            Nodes(
                self.candidates[ends[i] : ends[i + 1]],
                self.weights[ends[i] : ends[i + 1]],
                self.heads[group_ends[i] : group_ends[i + 1]] - ends[i],
                self.counts[group_ends[i] : group_ends[i + 1]],
                self.numbers[group_ends[i] : group_ends[i + 1]],
                alone,
                self.depths[i : i + 1],
            )
            for i in range(self.n)
        ]

    @classmethod
    def joined(cls, nodes: list["Nodes"]) -> "Nodes":
        """Nodes one after another."""
        sizes = np.array([len(own.candidates) for own in nodes])
        groups = np.array([len(own.heads) for own in nodes])
        heads = np.concatenate([own.heads for own in nodes])
        return cls(
            candidates=np.concatenate([own.candidates for own in nodes]),
            weights=np.concatenate([own.weights for own in nodes]),
            heads=heads + np.repeat(np.cumsum(sizes) - sizes, groups),
            counts=np.concatenate([own.counts for own in nodes]),
            numbers=np.concatenate([own.numbers for own in nodes]),
            first_groups=np.cumsum(groups) - groups,
            depths=np.concatenate([own.depths for own in nodes]),
        )


class Line(NamedTuple):
    """Linear functions (b,) of a price: the value at none, and the slope."""

    value: Array
    slope: Array

    def at(self, price: Array) -> Array:
        """Values (b,) at prices."""
        return np.asarray(self.value + price * self.slope)

    def crossing(self, other: "Line") -> Array:
        """Prices (b,) at which these, which fall, meet others that fall less.

        Where these fall, too, it is one at which they are below zero.
        """
        steep = other.slope - self.slope
        rise = self.value - other.value
        meets = np.divide(rise, steep, out=np.zeros_like(steep), where=steep > 0)
        falls = other.slope < 0
        nothing = np.zeros_like(steep)
        zero = np.divide(-np.abs(other.value), other.slope, out=nothing, where=falls)
        return np.asarray(np.maximum(np.maximum(meets, 2.0 * zero), 0.0))

    def where(self, chosen: Mask, other: "Line") -> "Line":
        """Another one for some (b,)."""
        return Line(
            np.where(chosen, other.value, self.value), np.where(chosen, other.slope, self.slope)
        )


class Told(NamedTuple):
    """What multipliers tell of nodes (b,).

    Attributes:
        merit: No plan of a node has a larger merit (b,).
        sensitivities: Sensitivities (s,) of the candidates.
        marginal: What an experiment of each group (g,) adds at least to `merit`.
        tops: What all experiments of each group (g,) add.
    """

    merit: Array
    sensitivities: Array
    marginal: Array
    tops: Array

    def kept(self, nodes: Nodes, keep: Mask, alive: Mask) -> "Told":
        """The same of some candidates of some nodes, see `Nodes.kept`."""
        return Told(
            self.merit[alive],
            self.sensitivities[keep & alive[nodes.node_of]],
            self.marginal[alive[nodes.node_of_group]],
            self.tops[alive[nodes.node_of_group]],
        )

    def put(self, nodes: Nodes, which: Mask, other: "Told") -> "Told":
        """The same with what others tell of some nodes, with all their candidates."""
        groups = which[nodes.node_of_group]
        places = (which, which[nodes.node_of], groups, groups)
        arrays = [own.copy() for own in self]
        for own, place, new in zip(arrays, places, other, strict=True):
            own[place] = new
        return Told(*arrays)

    def fixed(self, nodes: Nodes, least: float) -> tuple[Mask, Mask]:
        """The candidates (s,) that stay, and the nodes (b,) that do, for a merit above `least`."""
        alive = self.merit > least
        slack = (self.merit - least)[nodes.node_of_group] - self.marginal
        return slack[nodes.group_of] + self.sensitivities > 0, alive


@dataclass(frozen=True, eq=False)
class Merits:
    """Merits of plans of candidates in parameters of order one, and multipliers that bound them.

    *Budgets.* Let the counts r of a plan obey ``C r <= f`` for k budgets. Then any prices
    ``mu >= 0`` bound its merit by ``<Z, X> + <mu, f - C r>``. That is linear in r as ``<Z, X>`` is:
    a candidate's features are its information and minus its costs, what every plan has is K and f,
    and a multiplier is Z and mu. Of a node without a plan within its budgets some mu makes the
    bound negative.

    Attributes:
        criterion: The criterion of these parameters.
        F: Features (n, q + k) of the candidates: information, packed, entries off the diagonal
            twice, and minus the costs.
        K: The same of what every plan has (q + k,).
        error: Bound on the rounding of a candidate's information, its largest (Frobenius).
        m: Number of experiments.
        most: How often each candidate may be chosen (n,); None for no limit.
        budgets: Their number k.
        unit: What the criterion's costs are counted in, so that they are of order one.
    """

    criterion: Relaxable
    F: Array
    K: Array
    error: float
    m: int
    most: Indices | None = None
    budgets: int = 0
    unit: float = 1.0

    @cached_property
    def q(self) -> int:
        """Number of entries of a triangle."""
        return self.F.shape[1] - self.budgets

    @cached_property
    def p(self) -> int:
        """Number of parameters."""
        return order(self.q)

    @cached_property
    def twice(self) -> Array:
        """How often each entry (q + k,) of a triangle stands in a matrix; budgets once."""
        rows, columns = triangle(self.p)
        return np.append(np.where(rows == columns, 1.0, 2.0), np.ones(self.budgets))

    @cached_property
    def largest(self) -> float:
        """The largest information of a candidate (Frobenius)."""
        return float(np.sqrt((np.square(self.F) / self.twice).sum(axis=1).max()))

    @cached_property
    def floor(self) -> Array | None:
        """F (p, p) of a criterion whose merit is the largest t with ``t F <= X``; else None."""
        band = self.criterion.spectral_band(self.p)
        return None if band is None or band.a else np.asarray(band.floor)

    @cached_property
    def smooth(self) -> Relaxable:
        """The criterion, or a smooth one in its place."""
        if self.criterion.smooth:
            return self.criterion
        smoothed = self.criterion.smoothed(SHARPNESS)
        assert isinstance(smoothed, Relaxable)
        return smoothed

    @property
    def near(self) -> float:
        """Distance of a bound that is near, see `is_near`."""
        return NEAR if self.floor is None else NEAR_AT_KINKS

    def __getitem__(self, chosen: Indices) -> "Merits":
        """Those of some candidates."""
        most = None if self.most is None else self.most[chosen]
        return replace(self, F=np.ascontiguousarray(self.F[chosen]), most=most)

    def merit_of(self, cost: float) -> float:
        """The merit of a plan's cost."""
        return float((cost / self.unit) ** (-1.0 / self.criterion.degree))

    def cost_of(self, merit: float) -> float:
        """The cost of a plan's merit; inf where it is zero."""
        return self.unit * float(merit**-self.criterion.degree) if merit > 0 else np.inf

    def unpacked(self, features: Array) -> Array:
        """Matrices (b, p, p) of features (b, q + k) that have each entry once."""
        return unpack(features[:, : self.q].T)

    def packed(self, Z: Array) -> Array:
        """Multipliers (b, q + k) of matrices Z (b, p, p), at no price."""
        rows, columns = triangle(self.p)
        return np.concatenate([Z[:, rows, columns], np.zeros((len(Z), self.budgets))], axis=1)

    def information(self, nodes: Nodes, counts: Array) -> Array:
        """Information (b, p, p) of counts (s,), whole or not, of the nodes' candidates."""
        from scipy.sparse import csr_array

        some = np.flatnonzero(counts)
        starts = np.searchsorted(some, np.append(nodes.starts, len(counts)))
        shape = (nodes.n, len(self.F))
        chosen = csr_array((counts[some], nodes.candidates[some], starts), shape=shape)
        return self.unpacked((chosen @ self.F + self.K) / self.twice)

    def merits(self, nodes: Nodes) -> Array:
        """Merits (b,) of the weights of nodes; zero where these leave something open."""
        return self.of(self.information(nodes, nodes.weights))

    def of(self, X: Array) -> Array:
        """Merits (b,) of information (b, p, p); zero where it leaves something open."""
        return np.asarray(self.criterion.cost(X) ** (-1.0 / self.criterion.degree))

    def sensitivities(self, nodes: Nodes, Z: Array) -> Array:
        """``<Z, M_i>`` (s,) of the candidates of nodes with multipliers (b, q + k)."""
        found = np.empty(len(nodes.candidates))
        starts = nodes.starts
        large = np.flatnonzero(nodes.sizes >= LARGE_NODE)
        for i in large:
            part = slice(starts[i], starts[i] + nodes.sizes[i])
            found[part] = self._of_one(nodes.candidates[part], Z[i])
        if len(large) < nodes.n:
            rest = np.flatnonzero((nodes.sizes < LARGE_NODE)[nodes.node_of])
            own = self.F[nodes.candidates[rest]]
            found[rest] = np.einsum("ij,ij->i", own, Z[nodes.node_of[rest]])
        # Of a multiplier that is no number; what it tells is that.
        return np.nan_to_num(found, copy=False)

    def _of_one(self, chosen: Indices, z: Array) -> Array:
        """``<z, M_i>`` (k,) of candidates; of a dense range a copy would take most of the time."""
        low = chosen.min()
        high = chosen.max() + 1
        if high - low <= DENSE * len(chosen):
            return (self.F[low:high] @ z)[chosen - low]
        return self.F[chosen] @ z

    def tell(self, nodes: Nodes, Z: Array) -> Told:
        """What multipliers (b, q + k) tell of nodes (b,), rounding included.

        Every product of a multiplier and information errs by less than ``p^2 eps`` times the
        lengths of both, and by what the information itself does.
        """
        return self.told(nodes, Z, self.sensitivities(nodes, Z))

    def told(self, nodes: Nodes, Z: Array, z: Array) -> Told:
        """What they tell with the sensitivities (s,) that are known."""
        tops, marginal = self._tops(nodes, z)
        whole = np.add.reduceat(tops, nodes.first_groups)
        length = np.sqrt((np.square(Z) * self.twice).sum(axis=1))
        of_products = 4 * self.p**2 * EPS * (np.linalg.norm(self.K) + self.m * self.largest)
        merit = Z @ self.K + whole + length * (of_products + self.m * self.error)
        merit[np.isnan(merit)] = np.inf
        return Told(merit, z, marginal, tops)

    def _tops(self, nodes: Nodes, z: Array) -> tuple[Array, Array]:
        """The largest sums (g,) of z that the experiments of each group have, and the least term.

        They are minus infinity for a group that must have more experiments than it may.
        """
        if self.most is None:
            marginal = np.maximum.reduceat(z, nodes.heads)
            return np.asarray(nodes.counts * marginal), np.asarray(marginal)
        order, taken, begun = self._taken(nodes, z)
        tops = np.add.reduceat(taken * z[order], nodes.heads)
        last = nodes.heads + np.add.reduceat(begun.astype(int), nodes.heads) - 1
        short = np.add.reduceat(taken, nodes.heads) < nodes.counts
        return np.where(short, -np.inf, tops), z[order][last]

    def _taken(self, nodes: Nodes, z: Array) -> tuple[Indices, Indices, Mask]:
        """An order (s,) by descending z in each group, and what the largest sum takes of each.

        The last array says which of them it comes to.
        """
        assert self.most is not None
        order = np.lexsort((-z, nodes.group_of))
        most = self.most[nodes.candidates[order]]
        before = np.cumsum(most) - most
        before -= before[nodes.heads][nodes.group_of]
        counts = nodes.counts[nodes.group_of]
        return order, np.clip(counts - before, 0, most), before < counts

    def allows(self, nodes: Nodes, counts: Array) -> Mask:
        """Whether plans (b,) of counts (s,) are within the limits."""
        exceeds = np.zeros(nodes.n, dtype=bool)
        if self.most is not None:
            over = counts > self.most[nodes.candidates]
            exceeds |= np.bincount(nodes.node_of, over, nodes.n) > 0
        for left, own in self._of_budgets(nodes):
            exceeds |= np.bincount(nodes.node_of, counts * own, nodes.n) > left
        return np.asarray(~exceeds)

    def _of_budgets(self, nodes: Nodes) -> Iterator[tuple[float, Array]]:
        """The funds of each budget, and the costs (s,) of the candidates."""
        for j in range(self.q, self.F.shape[1]):
            yield float(self.K[j]), -self.F[nodes.candidates, j]

    def priced(self, nodes: Nodes, Z: Array) -> Array:
        """The same multipliers (b, q + k) with prices of budgets that bound nodes (b,) well.

        By a price mu the bound is a maximum of lines ``v + mu s``, one for each plan, where s is
        what it leaves of the funds. So the lines at two prices on either side of the least one
        cross at a better price (Kelley 1960). The last price is the side that the sequence has
        found to be the lower one.
        """
        Z = Z.copy()
        for j, (funds, costs) in enumerate(self._of_budgets(nodes), start=self.q):
            Z[:, j] = 0.0
            z = self.sensitivities(nodes, Z)
            own = np.nan_to_num(Z[:, : self.q] @ self.K[: self.q])
            rest = own + Z[:, self.q :] @ self.K[self.q :]
            Z[:, j] = self._price(nodes, z, rest, costs, funds)
        return Z

    def _price(self, nodes: Nodes, z: Array, own: Array, costs: Array, funds: float) -> Array:
        """Prices (b,) of one budget, for sensitivities (s,) at no price of it."""
        low = self._line(nodes, z, z, own, costs, funds)
        best, at = low.value, np.zeros(nodes.n)
        matters = low.slope < 0
        if not matters.any():
            return at
        high = self._line(nodes, -costs, z, own, costs, funds)
        for _ in range(PRICED):
            price = low.crossing(high)
            reduced = z - price[nodes.node_of] * costs
            line = self._line(nodes, reduced, z, own, costs, funds)
            value = line.at(price)
            better = matters & (value < best)
            best, at = np.where(better, value, best), np.where(better, price, at)
            # No price brings the bound below the crossing; a negative one closes the node.
            matters &= (best > 0) & (best - low.at(price) > LEAST_PRICE * best)
            if not matters.any():
                break
            left = line.slope < 0
            low = low.where(left, line)
            high = high.where(~left, line)
        return at

    def _line(
        self, nodes: Nodes, reduced: Array, z: Array, own: Array, costs: Array, funds: float
    ) -> "Line":
        """What the plan of the largest reduced sensitivities has, and what it leaves."""
        counts = self._best_plan(nodes, reduced)
        value = own + np.bincount(nodes.node_of, counts * z, nodes.n)
        spent = np.bincount(nodes.node_of, counts * costs, nodes.n)
        return Line(value, np.asarray(funds - spent))

    def _best_plan(self, nodes: Nodes, z: Array) -> Array:
        """Counts (s,) of the experiments of the largest z in each group, as far as these go."""
        counts = np.zeros(len(z))
        if self.most is None:
            top = np.maximum.reduceat(z, nodes.heads)
            reach = np.flatnonzero(z >= top[nodes.group_of])
            chosen = np.empty(len(nodes.heads), dtype=int)
            chosen[nodes.group_of[reach]] = reach
            counts[chosen] = nodes.counts
            return counts
        order, taken, _ = self._taken(nodes, z)
        counts[order] = taken
        return counts

    def multipliers(self, X: Array) -> Array:
        """Multipliers (b, q + k) that bound merits best at information X (b, p, p), at no price.

        Of a convex cost f of degree d the gradient -Z at X has ``<Z, X> = d f(X)``, and every Y
        with ``<Z, Y> <= <Z, X>`` costs f(X) at least. So ``Z/d f^(-1/d-1)`` bounds the merit. At
        kinks the gradient of a smoothed cost is closer to the best multiplier; its polar then
        takes the place of this formula. Either errs by ``p^2 eps`` times the condition number.
        """
        p = self.p
        regular = self.regular(X)
        if not self.criterion.smooth:
            _, G = self.smooth.cost_and_gradient(regular)
            return self.scaled(-G, X)
        cost, G = self.criterion.cost_and_gradient(regular)
        d = self.criterion.degree
        scale = cost ** (-1.0 / d - 1.0) / d
        size = np.trace(regular, axis1=1, axis2=2)
        error = 8 * p * p * EPS * size * np.trace(np.linalg.inv(regular), axis1=1, axis2=2)
        return self.packed(-G * (scale * (1.0 + error))[:, None, None])

    def scaled(self, Z: Array, X: Array) -> Array:
        """Multipliers (b, q + k) of any matrices Z (b, p, p), by their polars near X (b, p, p).

        Rounding may leave them eigenvalues below zero, which are raised to none. They are no
        numbers where a matrix proves nothing: what is no number bounds no merit.
        """
        z, V = eigenpairs(0.5 * (Z + np.swapaxes(Z, 1, 2)))
        Z = V * np.maximum(z, 0.0)[:, None] @ np.swapaxes(V, 1, 2)
        X = self.regular(X)
        polars = self.criterion.polars(Z, X)
        proves = np.where(polars > 0, polars, np.nan)
        error = 8 * self.p**2 * EPS * np.linalg.cond(X)
        scale = proves ** (-1.0 / self.criterion.degree) * (1.0 + error)
        return self.packed(Z * scale[:, None, None])

    def shares(self, Z: Array, X: Array) -> Array | None:
        """The shares (b, k) that turn multipliers (b, q + k), made near X (b, p, p), to bounds.

        They are part of a proof of a criterion that is the worst of several, as other shares prove
        another bound; None for a criterion that needs none.
        """
        matrices = zip(self.unpacked(Z), self.regular(X), strict=True)
        found = [self.criterion.dual_weights(own, near) for own, near in matrices]
        return None if not found or found[0] is None else np.array(found)

    def regular(self, X: Array) -> Array:
        """Information (b, p, p) with a little of all directions: empty places tell none."""
        size = np.trace(X, axis1=1, axis2=2) + TRACE_RIDGE * self.largest
        return np.asarray(X + (TRACE_RIDGE * size / self.p)[:, None, None] * np.eye(self.p))
