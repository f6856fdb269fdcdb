"""Multipliers of nodes of a proof by a criterion of the least eigenvalue, which has kinks.

With floor F the merit of X is the largest t with ``t F <= X``. So the best weights and the best
multiplier of a node whose groups g have c_g experiments each solve

    max t:  K + sum_i w_i M_i - t F = S >= 0,   sum of w_i in g = c_g,   w >= 0,
    min <Z, K> + sum_g c_g y_g:  s_i = y_g - <Z, M_i> >= 0,   <Z, F> = 1,   Z >= 0.

At the optimum ``w_i s_i = 0`` and ``S Z = 0``. A primal-dual method aims at a product in place of
zero, which it lowers. With the scaling of Nesterov and Todd (1997), ``W Z W = S``, the products
change as

    w_i ds_i + s_i dw_i = product - w_i s_i,    W dZ W + dS = product Z^-1 - S,

and dw and dS are eliminated, so that a step costs a system in the entries of Z and in y. Budgets
``C r <= f`` have prices ``mu >= 0`` beside Z, see `Merits`. The multiplier always bounds. The
weights are at first those of the parent, scaled to the counts, to which they sum from then on; with
budgets they obey these after the first whole step. Only candidates that are near the largest of
their group take part; the bound is computed anew from all, for whatever multiplier comes out.
"""

from dataclasses import dataclass, fields

import numpy as np

from criteria.linalg.inverse import eigenpairs
from criteria.linalg.typing import triangle
from edtk.design.exact.exact_nodes import NEAR_AT_KINKS, Merits, Nodes, is_near
from edtk.design.exact.exact_weights import (
    ALLOWED,
    LEAST_SHRINKING_OF_GROUPS,
    REACH,
    OfNodes,
    solved,
)
from edtk.design.information import order, sensitivity_rows, unpack
from edtk.system.typing import Array, Indices, Mask

KINK_STEPS = 30
BEGIN_AT_KINKS = 0.05  # part of the merit that the distance may have at the beginning
CENTRAL = 0.3  # part of the first weights that is the larger, the smaller the slack
REGULAR_PART = 0.1  # part of the first multiplier that is regular
ROUNDING_OF_OTHERS = 1e-14  # part of the largest eigenvalue that rounding leaves of others


def spectral_multipliers(
    merits: Merits, nodes: Nodes, z: Array, Z: Array, least: float
) -> tuple[Array, Array]:
    """Multipliers (b, q + k) of nodes (b,), and weights (s,) of their candidates.

    Args:
        merits: Of a criterion with a floor.
        nodes: The nodes.
        z: Sensitivities (s,) by which candidates are chosen that take part.
        Z: Known multipliers (b, q + k).
        least: The merit below which a node is closed, and no better multiplier of use.
    """
    chosen, known = nodes.spread(z)
    game = _Game.of(merits, nodes, chosen, known)
    point = game.begun(merits, Z, merits.tell(nodes, Z).merit, nodes.weights[chosen])
    some = np.arange(nodes.n)
    left = point
    for _ in range(KINK_STEPS):
        open_ = ~is_near(game.bound(left), game.merit(left), least, NEAR_AT_KINKS)
        if not open_.any():
            break
        some, game, left = some[open_], game[open_], left[open_]
        moved = game.stepped(left)
        # Rounding may leave no step; the last multiplier then stays.
        told = moved.is_number
        some, game, left = some[told], game[told], moved[told]
        for own in fields(point):
            getattr(point, own.name)[some] = getattr(left, own.name)
    weights = np.zeros(len(nodes.candidates))
    weights[chosen[known]] = point.w[known]
    rows, columns = triangle(merits.p)
    return np.concatenate([point.Z[:, rows, columns], point.price], axis=1), weights


@dataclass(frozen=True, eq=False)
class _Point(OfNodes):
    """Weights and multipliers of nodes (b,).

    Attributes:
        Z: Multipliers (b, p, p).
        S: What the information (b, p, p) of the weights has above the floor.
        w: Weights (b, c); one where there is no candidate.
        s: Their slacks (b, c).
        y: Bounds (b, g) on the sensitivities of each group.
        price: Prices (b, k) of budgets.
        left: What is left (b, k) of these.
        t: The largest multiple (b,) of the floor.
        missing: Part (b,) of the first distance of the weights from their sums that is left.
    """

    Z: Array
    S: Array
    w: Array
    s: Array
    y: Array
    price: Array
    left: Array
    t: Array
    missing: Array

    @property
    def is_number(self) -> Mask:
        """Whether nodes (b,) have numbers in all places."""
        every = [getattr(self, own.name).reshape(len(self.t), -1) for own in fields(self)]
        return np.asarray(np.isfinite(np.concatenate(every, axis=1)).all(axis=1))


@dataclass(frozen=True, eq=False)
class _Scaling:
    """Parameters of nodes (b,) in which Z is one, and S diagonal.

    Eigenvalues that rounding loses are raised: some of many nodes may be all but singular, which
    Cholesky's factors refuse.

    Attributes:
        A: ``Z = A A'`` (b, p, p).
        B: ``Z^-1 = B B'``, the inverse of A' (b, p, p).
        d: ``S = B diag(d) B'`` (b, p).
    """

    A: Array
    B: Array
    d: Array

    @classmethod
    def of(cls, point: _Point) -> "_Scaling":
        """Those of a point."""
        z, V = eigenpairs(point.Z)
        root = np.sqrt(np.maximum(z, ROUNDING_OF_OTHERS * z[:, -1:]))[:, None]
        d, Q = eigenpairs(_turned(V * root, point.S))
        return cls(V * root @ Q, V / root @ Q, np.maximum(d, ROUNDING_OF_OTHERS * d[:, -1:]))

    @property
    def W(self) -> Array:
        """The scaling (b, p, p) with ``W Z W = S``."""
        return self.B * np.sqrt(self.d)[:, None] @ np.swapaxes(self.B, 1, 2)

    @property
    def inverse(self) -> Array:
        """Inverses (b, p, p) of the multipliers."""
        return np.asarray(self.B @ np.swapaxes(self.B, 1, 2))


@dataclass(frozen=True, eq=False)
class _Change:
    """How a point of nodes (b,) changes: to products of none, and what a product adds.

    Each array has the name that it has in a point, and a last axis of these two.

    Attributes:
        Z: In the parameters of the scaling.
        S: In units of its diagonal there.
    """

    Z: Array
    S: Array
    w: Array
    s: Array
    y: Array
    price: Array
    left: Array
    t: Array

    def at(self, product: Array) -> "_Change":
        """The change to products (b,), without a last axis."""
        arrays = [getattr(self, own.name) for own in fields(self)]
        return _Change(
            *(
                own[..., 0] + product.reshape(-1, *[1] * (own.ndim - 2)) * own[..., 1]
                for own in arrays
            )
        )


@dataclass(frozen=True, eq=False)
class _Game(OfNodes):
    """The problems of nodes (b,).

    Attributes:
        J: Derivatives (b, c, q + k + g) of the slacks by the multiplier, the prices and the bounds.
        known: Where there is a candidate (b, c).
        counts: Experiments (b, g) in each group; zero of groups that a node has not.
        K: What every plan has, and the funds (b, q + k).
        floor: F (b, q), entries off the diagonal twice.
    """

    J: Array
    known: Mask
    counts: Array
    K: Array
    floor: Array

    @classmethod
    def of(cls, merits: Merits, nodes: Nodes, chosen: Indices, known: Mask) -> "_Game":
        """Those of nodes with chosen candidates (b, c)."""
        assert merits.floor is not None
        counts, own = nodes.grouped(chosen, known)
        F = merits.F[nodes.candidates[chosen]] * known[..., None]
        alike = (merits.K, sensitivity_rows(merits.floor))
        K, floor = (np.tile(one, (nodes.n, 1)) for one in alike)
        return cls(np.concatenate([-F, own], axis=2), known, counts, K, floor)

    @property
    def q(self) -> int:
        """Number of entries of a triangle."""
        return self.floor.shape[1]

    @property
    def p(self) -> int:
        """Number of parameters."""
        return order(self.q)

    @property
    def twice(self) -> Array:
        """How often each entry (q,) stands in a matrix."""
        return sensitivity_rows(np.ones((self.p, self.p)))

    @property
    def terms(self) -> Array:
        """Number (b,) of products."""
        return self.p + self.K.shape[1] - self.q + self.known.sum(axis=1)

    def begun(self, merits: Merits, Z: Array, merit: Array, weights: Array) -> _Point:
        """A start inside, near multipliers (b, q + k) that prove merits (b,), and weights (b, c).

        The weights sum to their counts; with budgets they need not be within these.
        """
        q = self.q
        rows, columns = triangle(self.p)
        unit = np.zeros_like(Z)
        unit[:, np.flatnonzero(rows == columns)] = 1.0
        # A multiplier that proves nothing is no beginning.
        scale = (Z[:, :q] * self.floor).sum(axis=1)
        proves = np.isfinite(Z).all(axis=1) & (scale > 0)
        Z = np.where(proves[:, None], Z, unit)
        Z = Z / (Z[:, :q] * self.floor).sum(axis=1)[:, None]
        regular = unit / (unit[:, :q] * self.floor).sum(axis=1)[:, None]
        M = unpack(((1.0 - REGULAR_PART) * Z + REGULAR_PART * regular)[:, :q].T)
        merit = np.where(np.isfinite(merit) & (merit > 0), merit, 1.0)
        room = BEGIN_AT_KINKS * merit
        price = Z[:, q:] + room[:, None] / np.maximum(np.abs(self.K[:, q:]), ROUNDING_OF_OTHERS)
        own = self.J[:, :, q + price.shape[1] :]
        x = np.concatenate([self._entries(M), price], axis=1)
        z = -(self.J[:, :, : x.shape[1]] @ x[..., None])[..., 0]
        tops = np.where(own > 0, z[..., None], -np.inf).max(axis=1)
        y = tops + (room / np.maximum(self.counts.sum(axis=1), 1.0))[:, None]
        y = np.where(self.counts > 0, y, 0.0)
        s = np.where(self.known, (own @ y[..., None])[..., 0] - z, 1.0)
        central = self._summed(np.where(self.known, 1.0 / s, 0.0))
        w = (1.0 - CENTRAL) * self._summed(np.where(self.known, weights, 0.0)) + CENTRAL * central
        w = self._summed(w)
        X = (self.K[:, :q] - (w[:, None] @ self.J[:, :, :q])[:, 0]) / self.twice
        t = merits.of(unpack(X.T)) - room
        return _Point(
            Z=M,
            S=unpack((X - t[:, None] * self.floor / self.twice).T),
            w=np.where(self.known, w, 1.0),
            s=s,
            y=y,
            price=price,
            left=(room / self.terms)[:, None] / price,
            t=t,
            missing=np.full(len(Z), float(price.shape[1] > 0)),
        )

    def _summed(self, w: Array) -> Array:
        """Weights (b, c), scaled to the counts of groups; zero where a group has none."""
        own = self.J[:, :, self.K.shape[1] :]
        sums = (w[:, None] @ own)[:, 0]
        share = np.divide(self.counts, sums, out=np.zeros_like(sums), where=sums > 0)
        return np.asarray(w * (own @ share[..., None])[..., 0])

    def bound(self, point: _Point) -> Array:
        """The merit (b,) that no plan of these candidates exceeds."""
        x = np.concatenate([self._entries(point.Z), point.price], axis=1)
        return np.asarray((self.K * x).sum(axis=1) + (self.counts * point.y).sum(axis=1))

    def merit(self, point: _Point) -> Array:
        """The merit (b,) of the weights; zero where they do not sum to their counts yet."""
        return np.where(point.missing <= ALLOWED, point.t, 0.0)

    def stepped(self, point: _Point) -> _Point:
        """One step along the path.

        All changes are linear in the product that is aimed at; where a step to none may go far, it
        is small.
        """
        scaling = _Scaling.of(point)
        change = self._change(point, scaling)
        some, others = self._reach(point, change.at(np.zeros(len(point.t))))
        shrinking = np.maximum((1.0 - some) * (1.0 - others), LEAST_SHRINKING_OF_GROUPS)
        step = change.at(self._product(point, scaling) * shrinking)
        some, others = self._reach(point, step)
        root = scaling.B * np.sqrt(scaling.d)[:, None]
        return _Point(
            Z=point.Z + _times(others, _turned(np.swapaxes(scaling.A, 1, 2), step.Z)),
            S=point.S + _times(some, _turned(np.swapaxes(root, 1, 2), step.S)),
            w=point.w + _times(some, step.w),
            s=point.s + _times(others, step.s),
            y=point.y + _times(others, step.y),
            price=point.price + _times(others, step.price),
            left=point.left + _times(some, step.left),
            t=point.t + some * step.t,
            missing=point.missing * (1.0 - some),
        )

    def _product(self, point: _Point, scaling: _Scaling) -> Array:
        """The mean (b,) of the products."""
        of_weights = np.where(self.known, point.w * point.s, 0.0).sum(axis=1)
        of_prices = (point.price * point.left).sum(axis=1)
        return np.asarray((scaling.d.sum(axis=1) + of_weights + of_prices) / self.terms)

    def _reach(self, point: _Point, step: _Change) -> tuple[Array, Array]:
        """How far (b,) weights and multipliers may go, one at most."""
        of_weights = [-step.w / point.w, -_eigenvalues(step.S), -step.left / point.left]
        of_slacks = [-step.s / point.s, -_eigenvalues(step.Z), -step.price / point.price]
        fastest = (np.concatenate(own, axis=1).max(axis=1) for own in (of_weights, of_slacks))
        some, others = (REACH / np.maximum(own, REACH) for own in fastest)
        return some, others

    def _change(self, point: _Point, scaling: _Scaling) -> _Change:
        """How a step changes a point."""
        q = self.q
        end = self.K.shape[1]
        ratio = np.where(self.known, point.w / point.s, 0.0)
        rise = np.where(self.known, 1.0 / point.s, 0.0)
        x = self._solution(point, scaling, ratio, rise)
        dx = x[:, :-1]
        ds = self.J @ dx
        dw = -ratio[..., None] * ds
        dw[..., 0] -= np.where(self.known, point.w, 0.0)
        dw[..., 1] += rise
        dprice = dx[:, q:end]
        dleft = -(point.left / point.price)[..., None] * dprice
        dleft[..., 0] -= point.left
        dleft[..., 1] += 1.0 / point.price
        dZ = np.stack([_turned(scaling.B, unpack(dx[:, :q, i].T)) for i in (0, 1)], axis=-1)
        dS = -dZ
        each = np.arange(self.p)
        dS[:, each, each, 0] -= 1.0
        dS[:, each, each, 1] += 1.0 / scaling.d
        dt = -x[:, -1]
        dt[:, 0] -= point.t
        return _Change(dZ, dS, dw, ds, dx[:, end:], dprice, dleft, dt)

    def _solution(self, point: _Point, scaling: _Scaling, ratio: Array, rise: Array) -> Array:
        """The changes of Z, prices and bounds, and minus the new t (b, q + k + g + 1, 2)."""
        q = self.q
        end = self.K.shape[1]
        size = self.J.shape[2]
        H = np.zeros((len(rise), size + 1, size + 1))
        H[:, :size, :size] = np.swapaxes(self.J * ratio[..., None], 1, 2) @ self.J
        H[:, :q, :q] += self._curvature(scaling.W)
        budgets = np.arange(q, end)
        H[:, budgets, budgets] += point.left / point.price
        each = np.arange(end, size)
        H[:, each, each] += self.counts == 0
        H[:, size, :q] = H[:, :q, size] = self.floor
        right = np.zeros((len(rise), size + 1, 2))
        right[:, :size, 0] = -np.concatenate([self.K, self.counts], axis=1)
        right[:, :size, 1] = (rise[:, None] @ self.J)[:, 0]
        right[:, :q, 1] += self.twice * self._entries(scaling.inverse)
        right[:, q:end, 1] += 1.0 / point.price
        return solved(H, right)

    def _curvature(self, W: Array) -> Array:
        """The products (b, q, q) of entries of a triangle of Z with those of ``W Z W``."""
        i, j = triangle(self.p)
        products = W[:, i[:, None], i] * W[:, j[:, None], j]
        products += W[:, i[:, None], j] * W[:, j[:, None], i]
        return np.asarray(0.5 * np.outer(self.twice, self.twice) * products)

    def _entries(self, Z: Array) -> Array:
        """Each entry (b, q) of a triangle of matrices (b, p, p)."""
        rows, columns = triangle(self.p)
        return np.asarray(Z[:, rows, columns])


def _eigenvalues(M: Array) -> Array:
    """Eigenvalues (b, p) of matrices (b, p, p); zeros of those that are no numbers."""
    is_number = np.asarray(np.isfinite(M).all(axis=(1, 2)))
    return np.linalg.eigvalsh(np.where(is_number[:, None, None], M, 0.0))


def _turned(B: Array, M: Array) -> Array:
    """``B' M B`` (b, p, p)."""
    return np.asarray(np.swapaxes(B, 1, 2) @ M @ B)


def _times(reach: Array, change: Array) -> Array:
    """Changes (b, ...) of which each node goes a part (b,)."""
    return np.asarray(reach.reshape(-1, *[1] * (change.ndim - 1)) * change)
