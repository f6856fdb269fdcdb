"""The best weights of nodes of a proof, by Newton's method.

The best multiplier of a node belongs to its best weights w, not whole, of information
``X = K + sum w_i M_i``: these have the largest merit of all with ``sum w_i = c_g`` in each group g
of c_g experiments, ``w_i <= l_i`` where a candidate may be chosen l_i times, and ``C w <= f`` where
budgets limit costs. The log of the merit is concave. Of its slope Z at X, ``<Z, X> = 1``, and for
any ``v, mu >= 0`` no plan of the node has a merit above

    merit(X) (<Z, K> + <mu, f> + <l, v> + sum_g c_g max_g (<Z, M_i> - <mu, C_i> - v_i)).

A primal-dual interior point method (Nocedal and Wright, Numerical Optimization, chapter 19) follows
``w_i s_i = (l_i - w_i) v_i = mu_j (f - C w)_j`` to zero, with ``s_i = y_g - <Z, M_i> + <mu, C_i> +
v_i``. With H minus the second derivative of the log, and ``J = (B, E, C)`` the entries of the
candidates' information, their groups, and their costs, a step is

    dw = W (rho - J x),   x = (H u, dy, dmu),   u = B'dw,   1/W = s/w + v/(l - w),

so that its equations have the order of these three, however many candidates there are. The bound
here is one of the candidates that take part; whoever proves computes it anew from all.
"""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from criteria.criterion import derivatives
from criteria.linalg.typing import triangle
from edtk.design.exact.exact_nodes import BLURRED, Merits, Nodes, is_near
from edtk.system.typing import Array, Indices, Mask

WEIGHT_STEPS = 30
REACH = 0.95  # part of the way to the boundary
# Part of a group's experiments that is spread over its candidates at the beginning.
SPREAD_IN_GROUP = 0.1
BEGIN = 0.1  # part of the first gap that is left for the products of the beginning
LEAST_GAP = 1e-6  # of the beginning
FILLED = 0.9  # part of a limit, or of funds, that weights take at most at the beginning
ALLOWED = 1e-6  # part by which weights may miss their sums
LEAST_SHRINKING_OF_GROUPS = 1e-3  # of the products in one step


def best_weights(merits: Merits, nodes: Nodes, z: Array, least: float) -> Array:
    """Weights (s,) of the candidates of nodes that are nearly the best.

    Args:
        merits: Merits of plans.
        nodes: The nodes (b,), with weights to start from.
        z: Sensitivities (s,) by which candidates are chosen that take part.
        least: The merit below which a node is closed, and no better weights are of use.
    """
    if merits.smooth is not merits.criterion:
        least *= 1.0 - BLURRED
    chosen, known = nodes.spread(z)
    if merits.most is not None:
        known &= merits.most[nodes.candidates[chosen]] > 0
    game = _Game.of(merits, nodes, chosen, known)
    some = np.arange(nodes.n)
    point = game.first(nodes.weights[chosen])
    best = np.full(nodes.n, np.inf)
    found = point.w.copy()
    for step in range(WEIGHT_STEPS):
        slope = _Slope.at(merits, game, point.w)
        gap = game.gap(point, slope)
        bound = slope.merit * (1.0 + gap)
        within = game.allows(point)
        # A step that rounding has lost is no number; as long as none is within, the last one is.
        better = np.where(
            np.isfinite(best[some]), within & (bound < best[some]), np.isfinite(bound)
        )
        best[some[better]] = np.where(within, bound, np.inf)[better]
        found[some[better]] = point.w[better]
        # Weights that exceed their limits reach too much.
        open_ = ~is_near(bound, np.where(within, slope.merit, 0.0), least, merits.near)
        if not open_.any():
            break
        if step == 0:
            point = game.begun(point, slope, gap)
        some, point, game, slope = some[open_], point[open_], game[open_], slope[open_]
        point = game.stepped(point, slope)
    weights = np.zeros(len(nodes.candidates))
    weights[chosen[known]] = found[known]
    return weights


class OfNodes:
    """Arrays of which the first axis is that of nodes."""

    def __getitem__(self, some: Indices | Mask) -> Self:
        """Those of some nodes."""
        arrays = {own.name: getattr(self, own.name)[some] for own in fields(self)}  # type: ignore[arg-type]
        return replace(self, **arrays)  # type: ignore[type-var]


@dataclass(frozen=True, eq=False)
class _Point(OfNodes):
    """Weights and multipliers of nodes (b,).

    Attributes:
        w: Weights (b, c); one where there is no candidate.
        s: Their slacks (b, c).
        v: Prices (b, c) of the limits on them; zero where there is none.
        y: Bounds (b, g) on the sensitivities of each group.
        price: Prices (b, k) of budgets.
        left: What is left (b, k) of these.
    """

    w: Array
    s: Array
    v: Array
    y: Array
    price: Array
    left: Array


@dataclass(frozen=True, eq=False)
class _Slope(OfNodes):
    """What the log of the merit tells at some weights of nodes (b,).

    Attributes:
        merit: The merit (b,).
        known: ``<Z, K>`` (b,) of its slope Z.
        H: Minus its second derivative (b, q, q) by the entries of a triangle.
        z: Sensitivities (b, c) of the candidates.
    """

    merit: Array
    known: Array
    H: Array
    z: Array

    @classmethod
    def at(cls, merits: Merits, game: "_Game", w: Array) -> Self:
        """That at weights (b, c) of the candidates of a game."""
        rows, columns = triangle(merits.p)
        twice = merits.twice[: merits.q]
        K = merits.K[: merits.q] / twice
        X = merits.unpacked(K + ((w * game.known)[:, None] @ game.B)[:, 0])
        cost, G, H = derivatives(merits.smooth, merits.regular(X))
        d = merits.criterion.degree
        # The log of the merit is minus that of the cost by the degree.
        slope = -G[:, rows, columns] * twice / (d * cost)[:, None]
        H = H / (d * cost)[:, None, None] - d * slope[:, :, None] * slope[:, None]
        z = (game.B @ slope[..., None])[..., 0]
        return cls(cost ** (-1.0 / d), slope @ K, H, z)


@dataclass(frozen=True, eq=False)
class _Game(OfNodes):
    """The candidates of nodes (b,) that take part, and what binds their weights.

    Attributes:
        B: Entries (b, c, q) of their information, zeros where there is no candidate.
        J: These, their groups as ones and zeros, and their costs (b, c, q + g + k).
        known: Where there is a candidate (b, c).
        most: Limits (b, c) on their weights; inf for none.
        counts: Experiments (b, g) in each group; zero of groups that a node has not.
        funds: What the costs (b, k) may be.
    """

    B: Array
    J: Array
    known: Mask
    most: Array
    counts: Array
    funds: Array

    @classmethod
    def of(cls, merits: Merits, nodes: Nodes, chosen: Indices, known: Mask) -> Self:
        """Those of nodes with chosen candidates (b, c)."""
        counts, own = nodes.grouped(chosen, known)
        places = nodes.candidates[chosen]
        B = merits.F[places] / merits.twice * known[..., None]
        q = merits.q
        most = np.full(known.shape, np.inf)
        most[known] = np.inf if merits.most is None else merits.most[places[known]]
        funds = np.broadcast_to(merits.K[q:], (nodes.n, merits.budgets))
        J = np.concatenate([B[..., :q], own, -B[..., q:]], axis=2)
        return cls(B[..., :q], J, known, most, counts, funds)

    @property
    def own(self) -> Array:
        """The groups (b, c, g) of the candidates, as ones and zeros."""
        q = self.B.shape[2]
        return self.J[:, :, q : q + self.counts.shape[1]]

    @property
    def costs(self) -> Array:
        """Costs (b, c, k) of the candidates."""
        return self.J[:, :, self.B.shape[2] + self.counts.shape[1] :]

    @property
    def is_limited(self) -> Mask:
        """Where a candidate (b, c) has a limit."""
        return np.isfinite(self.most)

    def first(self, weights: Array) -> _Point:
        """Weights to begin with (b, c), near some that need not sum to the counts."""
        own = self.own
        weights = weights * self.known
        sums = _sums(own, weights)
        share = np.divide(self.counts, sums, out=np.zeros_like(sums), where=sums > 0)
        # The less of its experiments a group has, the less tell the weights of how to share them.
        mix = np.clip(np.divide(1.0, share, out=np.zeros_like(share), where=share > 0), 0.0, 1.0)
        mix = np.minimum(mix, 1.0 - SPREAD_IN_GROUP)
        even = self.counts / np.maximum(own.sum(axis=1), 1.0)
        w = _each(own, mix * share) * weights + _each(own, (1.0 - mix) * even)
        w = np.where(self.known, np.minimum(w, FILLED * self.most), 1.0)
        nothing = np.zeros_like(self.funds)
        return _Point(w, np.ones_like(w), np.zeros_like(w), np.zeros_like(sums), nothing, nothing)

    def allows(self, point: _Point) -> Mask:
        """Whether weights (b,) sum to the counts, and spend no more than the funds."""
        sums = _sums(self.own, point.w * self.known)
        spent = _sums(self.costs, point.w * self.known)
        amiss = np.abs(sums - self.counts) > ALLOWED * self.counts
        exceeds = spent - self.funds > ALLOWED * np.abs(self.funds)
        return np.asarray(~amiss.any(axis=1) & ~exceeds.any(axis=1))

    def reduced(self, point: _Point, slope: _Slope) -> Array:
        """Sensitivities (b, c), less the prices."""
        return slope.z - point.v - _each(self.costs, point.price)

    def gap(self, point: _Point, slope: _Slope) -> Array:
        """By what part (b,) of the merit of these weights another plan may be better."""
        tops = self._tops(self.reduced(point, slope))
        of_limits = np.where(self.is_limited, self.most, 0.0) * point.v
        of_funds = (point.price * self.funds).sum(axis=1)
        whole = (self.counts * tops).sum(axis=1)
        return np.asarray(slope.known + of_funds + of_limits.sum(axis=1) + whole - 1.0)

    def _tops(self, z: Array) -> Array:
        """The largest (b, g) of each group."""
        tops = np.where(self.own > 0, z[..., None], -np.inf).max(axis=1)
        return np.where(self.counts > 0, tops, 0.0)

    def begun(self, point: _Point, slope: _Slope, gap: Array) -> _Point:
        """Multipliers near the path for first weights that have a gap (b,)."""
        room = BEGIN * np.maximum(gap, LEAST_GAP)
        product = (room / self._terms)[:, None]
        y = self._tops(slope.z) + (room / np.maximum(self.counts.sum(axis=1), 1.0))[:, None]
        s = np.maximum(_each(self.own, y) - slope.z, np.minimum(product / point.w, 1.0))
        v = np.where(self.is_limited, product / (self.most - point.w), 0.0)
        spent = _sums(self.costs, point.w * self.known)
        left = np.maximum(self.funds - spent, (1.0 - FILLED) * np.abs(self.funds))
        return replace(
            point, s=np.where(self.known, s, 1.0), v=v, y=y, price=product / left, left=left
        )

    @property
    def _terms(self) -> Array:
        """Number (b,) of products."""
        return self.known.sum(axis=1) + self.is_limited.sum(axis=1) + self.funds.shape[1]

    def stepped(self, point: _Point, slope: _Slope) -> _Point:
        """One step along the path.

        All changes are linear in the product that is aimed at; where a step to none may go far, it
        is small.
        """
        straight, centring = self._directions(point, slope)
        reach = self._reach(point, straight)
        product = self._product(point) * np.maximum(
            np.square(1.0 - reach), LEAST_SHRINKING_OF_GROUPS
        )
        change = [
            one + product.reshape(-1, *[1] * (one.ndim - 1)) * other
            for one, other in zip(straight, centring, strict=True)
        ]
        reach = self._reach(point, change)
        moved = [
            getattr(point, own.name) + reach[:, None] * by
            for own, by in zip(fields(point), change, strict=True)
        ]
        return _Point(*moved)

    def _product(self, point: _Point) -> Array:
        """The mean (b,) of the products."""
        of_weights = np.where(self.known, point.w * point.s, 0.0).sum(axis=1)
        room = np.where(self.is_limited, self.most - point.w, 0.0)
        of_limits = (room * point.v).sum(axis=1)
        return np.asarray(
            (of_weights + of_limits + (point.left * point.price).sum(axis=1)) / self._terms
        )

    def _reach(self, point: _Point, change: list[Array]) -> Array:
        """How far (b,) a step may go, one at most."""
        dw, ds, dv, _, dprice, dleft = change
        fastest = np.maximum(-dw / point.w, -ds / point.s).max(axis=1)
        if self.is_limited.any():
            room = np.where(self.is_limited, self.most - point.w, 1.0)
            v = np.where(self.is_limited, point.v, 1.0)
            limited = np.maximum(dw / room, -dv / v) * self.is_limited
            fastest = np.maximum(fastest, limited.max(axis=1))
        if self.funds.shape[1]:
            budgets = np.maximum(-dprice / point.price, -dleft / point.left)
            fastest = np.maximum(fastest, budgets.max(axis=1))
        return np.asarray(REACH / np.maximum(fastest, REACH))

    def _directions(self, point: _Point, slope: _Slope) -> tuple[list[Array], list[Array]]:
        """The change of a point to products of none, and what a product adds to it."""
        w, s, v = point.w, point.s, point.v
        room = self.most - w
        W = np.where(self.known, 1.0 / (s / w + v / room), 0.0)
        wrong = _each(self.own, point.y) - self.reduced(point, slope) - s
        rho = np.stack([-wrong - s + v, 1.0 / w - 1.0 / room], axis=2) * self.known[..., None]
        dx = self._solution(point, slope, W, rho)
        q = self.B.shape[2]
        g = self.counts.shape[1]
        dprice = dx[:, q + g :]
        dw = W[..., None] * (rho - self.J @ dx)
        ds = _complement(s, w, dw) * self.known[..., None]
        dv = _complement(v, room, -dw) * self.is_limited[..., None]
        dleft = _complement(point.left, point.price, dprice)
        changes = (dw, ds, dv, dx[:, q : q + g], dprice, dleft)
        return [own[..., 0] for own in changes], [own[..., 1] for own in changes]

    def _solution(self, point: _Point, slope: _Slope, W: Array, rho: Array) -> Array:
        """The changes ``x = (H u, dy, dmu)`` (b, q + g + k, 2) of a step."""
        q = self.B.shape[2]
        g = self.counts.shape[1]
        JW = np.swapaxes(self.J * W[..., None], 1, 2)
        A = JW @ self.J
        A[:, :, :q] = A[:, :, :q] @ slope.H
        each = np.arange(A.shape[1])
        A[:, each[:q], each[:q]] += 1.0
        A[:, each[q : q + g], each[q : q + g]] += self.counts == 0
        A[:, each[q + g :], each[q + g :]] += point.left / point.price
        right = JW @ rho
        right[:, q : q + g, 0] -= self.counts - _sums(self.own, point.w * self.known)
        right[:, q + g :, 0] -= self.funds - _sums(self.costs, point.w * self.known)
        right[:, q + g :, 1] += 1.0 / point.price
        x = solved(A, right)
        x[:, :q] = slope.H @ x[:, :q]
        return x


def _complement(dual: Array, primal: Array, change: Array) -> Array:
    """How numbers (b, c) change whose products with others, that change by (b, c, 2), are aimed at.

    The last axis is that of `_Game._directions`.
    """
    found = -(dual / primal)[..., None] * change
    found[..., 0] -= dual
    found[..., 1] += 1.0 / primal
    return np.asarray(found)


def _each(own: Array, values: Array) -> Array:
    """Of each candidate (b, c) the sum of values (b, g) by its own (b, c, g)."""
    return np.asarray((own @ values[..., None])[..., 0])


def _sums(own: Array, values: Array) -> Array:
    """Sums (b, g) of values (b, c) by what is their own (b, c, g)."""
    return np.asarray((values[:, None] @ own)[:, 0])


def solved(A: Array, right: Array) -> Array:
    """Solutions (b, n, r) of equations; no numbers where there is none."""
    try:
        return np.asarray(np.linalg.solve(A, right))
    except np.linalg.LinAlgError:
        if len(A) == 1:
            return np.full(right.shape, np.nan)
        each = zip(A[:, None], right[:, None], strict=True)
        return np.concatenate([solved(one, own) for one, own in each])
