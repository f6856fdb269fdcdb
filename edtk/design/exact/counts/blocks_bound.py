"""A bound on plans in blocks: the relaxation whose candidates are whole blocks.

A plan in blocks has the information ``base + sum_b B_b``, where the block b of places i tells
``B_b = X'X - a s's``, X its rows and s their sum (`Scatter`). For a multiplier Z every plan obeys
``<Z, M> <= <Z, base> + sum_b max_B <Z, B>``, the maximum over all blocks of the size of b. So a
criterion's `lower_bound` holds for plans in blocks as it does for others, and the best mixture of
blocks has it as its cost (`Decomposition`). A balanced incomplete block design is such a mixture.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import eigenpairs, root
from edtk.design.exact.counts.counts_bound import Decomposition, RelaxedCounts, Scatter
from edtk.design.exact.counts.counts_search import draw_places
from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array, Indices

BLOCK_STARTS = 16  # blocks from which the search for the best one starts
BLOCK_SWEEPS = 30  # over the places of a block, at most
JOINING = 6  # blocks of each size that join the mixture in a round
# Numbers that a proof of the best block may look at: about a fifth of a second.
WORK = 1e7
SAME_BLOCK = 1e-10  # relative difference up to which two blocks are equally good
BLOCKS_GAP = 1e-6  # relative gap between the best mixture of blocks and the bound at which to end
LIFTED = 400  # candidates up to which the eigenvalues of their products are worth their time


@dataclass(frozen=True, eq=False)
class BestBlock:
    """The best block that was found, and what no block is above.

    Attributes:
        upper: No block has more.
        value: What the best one that was found has.
        places: Candidates (c, k) of the best blocks, each in rising order, the best first.
    """

    upper: float
    value: float
    places: Indices

    @property
    def is_exact(self) -> bool:
        """Whether the best one that was found is the best."""
        return self.upper - self.value <= 2 * SAME_BLOCK * abs(self.upper)


@dataclass(frozen=True, eq=False)
class BlockQuadratic:
    """The value of a block for a multiplier, ``sum_i |v_i|^2 - a |sum_i v_i|^2`` over its k places.

    With ``Z = L L'`` the vector of a candidate is ``v_i = vec(U_i L)``. About the mean c of all
    vectors, ``v_i = c + w_i``, it is ``sum_i g_i - a |sum_i w_i|^2`` with linear gains g.

    A whole number has ``n^2 >= n``, so that a part l of the diagonal of ``w_i w_j`` may be counted
    as linear. All of ``sum_i w_i = 0`` and ``sum_i n_i = k`` let l be the least eigenvalue of the
    products beside the vector of ones: the other part, ``W - l (I - 11'/n)``, is semidefinite. For
    treatments that differ from each other alike nothing else is left, and the bound is exact.

    Attributes:
        gains: Linear gains (n,), the part l taken off.
        vectors: Vectors (n, e) of the remaining products.
        share: a.
        lift: ``a l``: what a candidate pays for each pair of places that it takes in a block, half.
        constant: What all blocks of k places have.
        size: k.
        most: How often each candidate may be in a block (n,).
    """

    gains: Array
    vectors: Array
    share: float
    lift: float
    constant: float
    size: int
    most: Indices

    @classmethod
    def of(
        cls, rows: Array, Z: Array, size: int, share: float, most: Indices | None
    ) -> "BlockQuadratic":
        """That of candidates (n, r, p) for a semidefinite multiplier (p, p)."""
        v = (rows @ root(Z).T).reshape(len(rows), -1)
        n, e = v.shape
        center = v.mean(axis=0)
        w = v - center
        free = 1.0 - share * size
        gains = (w**2).sum(axis=1) + 2 * free * (w @ center) + free * float(center @ center)
        lift = 0.0
        constant = 0.0
        if n <= min(e + 1, LIFTED):
            w, least = _without_least(w)
            lift = share * least
            gains = gains - lift
            constant = lift * size**2 / n
        limit = np.full(n, size) if most is None else np.minimum(most, size)
        return cls(gains, w, share, lift, constant, size, limit)

    def values(self, places: Indices) -> Array:
        """Values (b,) of blocks (b, k) in rising order of their candidates."""
        total = self.vectors[places].sum(axis=1)
        pairs = np.zeros(len(places))
        for i in range(1, self.size):
            pairs += (places[:, i:] == places[:, :-i]).sum(axis=1)
        linear = self.gains[places].sum(axis=1)
        squares = self.share * (total**2).sum(axis=1)
        return np.asarray(self.constant + linear - squares - 2 * self.lift * pairs)

    def improved(self, places: Indices) -> Indices:
        """Blocks (b, k) after exchanges of one place at a time, each for the best candidate."""
        places = places.copy()
        each = np.arange(len(places))
        total = self.vectors[places].sum(axis=1)
        own = self.gains - self.share * (self.vectors**2).sum(axis=1)
        for _ in range(BLOCK_SWEEPS):
            before = places.copy()
            for place in range(self.size):
                old = places[:, place].copy()
                rest = total - self.vectors[old]
                places[:, place] = -1
                taken = _counted(places, len(own))
                price = own - 2 * self.share * (rest @ self.vectors.T) - 2 * self.lift * taken
                price[taken >= self.most] = -np.inf
                best = price.argmax(axis=1)
                is_better = price[each, best] > price[each, old] + SAME_BLOCK * abs(
                    price[each, old]
                )
                new = np.where(is_better, best, old)
                places[:, place] = new
                total = rest + self.vectors[new]
            if (places == before).all():
                break
        return np.sort(places, axis=1)

    def best(self, starts: Indices) -> BestBlock:
        """The best block: by exchanges from starts (b, k), then by branch and bound."""
        found = np.unique(self.improved(starts), axis=0)
        values = self.values(found)
        order = np.argsort(-values, kind="stable")
        upper, better = self.proved(float(values[order[0]]))
        found = found[order[:JOINING]]
        value = float(values[order[0]])
        if better is not None:
            found = np.concatenate([better[None], found])
            value = float(self.values(better[None])[0])
        return BestBlock(max(upper, value), value, found)

    def proved(self, known: float) -> tuple[float, Indices | None]:
        """What no block is above, and a block that is better than a known one, if there is any.

        Blocks grow by one place after another, in rising order of candidates, all blocks of as many
        places together. The places to come, of vectors w, cost at least ``-2 a <w, u> - a |u|^2``
        for any u; u is a part of what the places so far are short of zero.
        """
        order = np.argsort(-self.gains, kind="stable")
        gains, vectors, most = self.gains[order], self.vectors[order], self.most[order]
        n, e = vectors.shape
        nodes = _Nodes.first(e)
        work = 0.0
        slack = SAME_BLOCK * abs(known)
        for left in range(self.size, 0, -1):
            work += 2.0 * len(nodes.places) * n * e
            if left < self.size and work > WORK:
                return float(nodes.bounds.max()) + slack, None
            gone = 2 * self.share * (nodes.total @ vectors.T)
            bounds = self._bounds(nodes, gains, gone, left) + self.constant
            taken = _counted(nodes.places, n)
            is_next = np.arange(n) >= nodes.last[:, None]
            bounds[~is_next | (taken >= most)] = -np.inf
            if left == 1:
                squares = self.share * (vectors**2).sum(axis=1)
                exact = self.constant + nodes.linear[:, None] + gains - gone - squares
                exact -= self.share * (nodes.total**2).sum(axis=1)[:, None] + 2 * self.lift * taken
                exact[np.isneginf(bounds)] = -np.inf
                node, last = np.unravel_index(int(exact.argmax()), exact.shape)
                if not exact[node, last] > known + slack:
                    return known + slack, None
                better = np.append(nodes.places[node], last)
                return float(exact[node, last]) + slack, np.sort(order[better])
            parents, children = np.nonzero(bounds > known + slack)
            if not len(parents):
                break
            paid = np.asarray(2 * self.lift * taken[parents, children], dtype=float)
            nodes = nodes.grown(parents, children, gains, vectors, paid, bounds)
        return known + slack, None

    def _bounds(self, nodes: "_Nodes", gains: Array, gone: Array, left: int) -> Array:
        """Bounds (b, n) on blocks that have each candidate as the next one of nodes (b)."""
        squares = self.share * (nodes.total**2).sum(axis=1)
        found = np.full(gone.shape, np.inf)
        for part in (0.0, 0.5, 1.0):
            each = gains - (1 - part) * gone
            later = np.maximum.accumulate(each[:, ::-1], axis=1)[:, ::-1]
            whole = nodes.linear + (part**2 - 1) * squares
            found = np.minimum(found, whole[:, None] + each + (left - 1) * later)
        return found


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Parts of blocks, all of as many places.

    Attributes:
        places: Candidates (b, j) in rising order.
        total: Sums (b, e) of their vectors.
        linear: Sums (b,) of their gains, less what candidates pay that are there more than once.
        bounds: No block that they grow to has more (b,).
    """

    places: Indices
    total: Array
    linear: Array
    bounds: Array

    @classmethod
    def first(cls, e: int) -> "_Nodes":
        """The block without places."""
        return cls(np.zeros((1, 0), dtype=int), np.zeros((1, e)), np.zeros(1), np.full(1, np.inf))

    @property
    def last(self) -> Indices:
        """The candidates (b,) that were chosen last; the first of all for none."""
        return self.places[:, -1] if self.places.shape[1] else np.zeros(len(self.places), int)

    def grown(
        self,
        parents: Indices,
        children: Indices,
        gains: Array,
        vectors: Array,
        paid: Array,
        bounds: Array,
    ) -> "_Nodes":
        """Parents (c,) with one more candidate (c,) each."""
        return _Nodes(
            np.concatenate([self.places[parents], children[:, None]], axis=1),
            self.total[parents] + vectors[children],
            self.linear[parents] + gains[children] - paid,
            bounds[parents, children],
        )


def _without_least(w: Array) -> tuple[Array, float]:
    """Centred vectors (n, e) as (n, n), without the least eigenvalue of their products, and it."""
    n = len(w)
    r, V = eigenpairs(w @ w.T + np.ones((n, n)) * float((w**2).sum()))
    # The vector of ones has the largest eigenvalue by far, and is left out.
    least = max(float(r[:-1].min()), 0.0) * (1 - SAME_BLOCK) if n > 1 else 0.0
    return V[:, :-1] * np.sqrt(np.maximum(r[:-1] - least, 0.0)), least


def _counted(places: Indices, n: int) -> Indices:
    """How often each of n candidates is at places (b, k); -1 is none."""
    offsets = (n + 1) * np.arange(len(places))[:, None] + 1
    counted = np.bincount((places + offsets).ravel(), minlength=(n + 1) * len(places))
    return counted.reshape(len(places), n + 1)[:, 1:]


class JoinedBlocks:
    """Blocks (c, k) of each kind, the best first, of which the next ones start."""

    _known: list[Indices]

    def _joined(self, blocks: Sequence[Indices]) -> list[Indices]:
        """Plans of blocks (c, k) of each kind, the last ones of a kind as often as needed."""
        self._known = [own[:BLOCK_STARTS] for own in blocks]
        most = max(map(len, blocks))
        chosen = [own[np.minimum(np.arange(most), len(own) - 1)] for own in blocks]
        return list(np.concatenate(chosen, axis=1))


class BlockPlans(JoinedBlocks):
    """Plans that have one block of each size, repeated as often as there are blocks of that size.

    Such a plan has the places (k,) of these blocks one after another. All plans in blocks are
    mixtures of these, and none but the best of them is asked for by a multiplier.

    Args:
        scatter: Rows of the candidates, and the blocks.
    """

    def __init__(self, scatter: Scatter) -> None:
        self.scatter = scatter
        limits = scatter.limits
        self.sizes, self.numbers = np.unique(limits.blocks, return_counts=True)
        # Of blocks of as many places all have the same share.
        shares = dict(zip(limits.blocks, limits.shares.tolist(), strict=True))
        self.shares = [shares[int(size)] for size in self.sizes]
        self.is_exact = True
        self._rng = np.random.default_rng(len(scatter.rows))
        self._known = [np.zeros((0, size), dtype=int) for size in self.sizes]

    def enter(self, places: Indices) -> list[Indices]:
        """Start from the blocks of a plan (m,), and give the plans that they make."""
        limits = self.scatter.limits
        parts = np.split(places, np.cumsum(limits.blocks)[:-1])
        own = [np.sort([b for b in parts if len(b) == size], axis=1) for size in self.sizes]
        return self._joined(own)

    def information(self, plan: Indices) -> Array:
        """Information (p, p) of a plan, with what every plan has."""
        M = self.scatter.limits.base.copy()
        for number, block, share in zip(self.numbers, self._blocks(plan), self.shares, strict=True):
            U = self.scatter.rows[block]
            total = U.sum(axis=0)
            own = np.einsum("kri,krj->ij", U, U) - share * total.T @ total
            M += number * own
        return M

    def largest(self, Z: Array) -> tuple[float, Sequence[Indices]]:
        """What ``<Z, M>`` is at most, and the plans that come near it, the best first."""
        upper = float(np.sum(Z * self.scatter.limits.base))
        best = []
        for i, (size, number) in enumerate(zip(self.sizes, self.numbers, strict=True)):
            quadratic = BlockQuadratic.of(
                self.scatter.rows, Z, int(size), self.shares[i], self.scatter.limits.most
            )
            found = quadratic.best(np.concatenate([self._known[i], self._drawn(int(size))]))
            self.is_exact &= found.is_exact
            upper += int(number) * found.upper
            best.append(found.places)
        return upper, self._joined(best)

    def _blocks(self, plan: Indices) -> list[Indices]:
        """The places of each size."""
        return np.split(plan, np.cumsum(self.sizes)[:-1])

    def _drawn(self, size: int) -> Indices:
        """Random blocks (b, k), each candidate at most as often as it may be."""
        alone = Limits(size, self.scatter.limits.base, self.scatter.limits.most)
        return draw_places(self._rng, alone, [np.ones(len(self.scatter.rows))] * BLOCK_STARTS)


def blocks_bound(
    relaxed: RelaxedCounts, scatter: Scatter, criterion: Criterion, places: Indices
) -> RelaxedCounts:
    """The sharper bound of weights of blocks, of plans in blocks of a monotone criterion.

    Args:
        relaxed: The bound beside blocks.
        scatter: Rows of the candidates, the blocks, and what plans must obey.
        criterion: What is minimised.
        places: A regular plan (m,) within the limits.
    """
    limits = scatter.limits
    if not limits.blocks or not isinstance(criterion, Relaxable):
        return relaxed
    plans = BlockPlans(scatter)
    M = scatter.information(places[None])[0]
    search = Decomposition(plans, criterion, plans.enter(places), M)
    if criterion.smooth:
        search.prove(-criterion.gradient(M)[None], M)
    search.run(BLOCKS_GAP)
    if not search.bound > relaxed.cost:
        return relaxed
    how = "exactly" if plans.is_exact else "from above"
    aside = ", their limits set aside" if limits.restricts else ""
    basis = f"weights of blocks, the best block {how}{aside}"
    return replace(relaxed, cost=float(search.bound), gap=search.gap, basis=basis)
