"""Multipliers of nodes of a proof by a criterion of the least eigenvalue, which has kinks.

With floor F the merit of X is the largest t with ``t F <= X``. So the best multiplier of a node
whose groups g have c_g experiments each minimises

    <Z, K> + sum_g c_g y_g,   y_g >= <Z, M_i> of each candidate i of g,   <Z, F> = 1,   Z >= 0.

The barrier ``-log det Z - sum_i log(y_g - <Z, M_i>)`` is added with a factor 1/tau (Vandenberghe,
Boyd 1996); Newton's method follows its minima to larger tau. There the numbers
``w_i = 1/(tau (y_g - z_i))`` are weights of the candidates, with ``sum w_i = c_g`` in each group,
and p + n is tau times the distance of both problems. Budgets ``C r <= f`` have prices ``mu >= 0``
beside Z, see `Merits`, with logarithms of mu and of what is left to a largest price: plans that
spend all would let it grow without end. Only candidates that are near the largest of
their group take part; the bound is computed anew from all, for whatever multiplier comes out.
"""

from dataclasses import dataclass

import numpy as np

from criteria.linalg.typing import triangle
from edtk.design.exact.exact_nodes import NEAR_AT_KINKS, Merits, Nodes, is_near
from edtk.design.exact.exact_weights import solved
from edtk.design.information import order, sensitivity_rows
from edtk.system.typing import Array, Indices, Mask

STEPS = 40  # of Newton's method, at most
BEGIN = 0.05  # part of the merit that the distance may have at the beginning
INSIDE = 0.1  # part of the first multiplier that is regular
CENTRED = 0.6  # length of a Newton step from which on tau grows
FASTER = 12.0  # growth of tau
REACH = 0.8  # part of the way to the boundary
DEAREST = 1e4  # largest price of the dearest experiment, in parts of the merit
SMALL = 1e-14  # part of the largest eigenvalue that rounding leaves of others


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
    merit = merits.tell(nodes, Z).merit
    game = _Game.of(merits, nodes, chosen, known, merit, least)
    state = game.begun(Z, merit)
    for _ in range(STEPS):
        some = np.flatnonzero(game.open(state))
        if not len(some):
            break
        state.put(some, game[some].stepped(state[some]))
    weights = np.zeros(len(nodes.candidates))
    weights[chosen[known]] = game.weights(state)[known]
    # Of a candidate at the boundary.
    weights[~np.isfinite(weights)] = 0.0
    return game.packed(state), weights


@dataclass(frozen=True, eq=False)
class _State:
    """Where Newton's method is, in each of some nodes (b,).

    Attributes:
        Z: Multipliers (b, p, p).
        price: Prices (b, k) of budgets.
        y: Bounds (b, g) on the sensitivities of each group.
        tau: Factors (b,) of the objective.
        centred: Whether (b,) the minimum for that factor is near.
        lost: Whether (b,) rounding left no further step.
    """

    Z: Array
    price: Array
    y: Array
    tau: Array
    centred: Mask
    lost: Mask

    def __getitem__(self, some: Indices) -> "_State":
        """That of some nodes."""
        return _State(
            self.Z[some], self.price[some], self.y[some], self.tau[some], self.centred[some],
            self.lost[some],
        )  # fmt: skip

    def put(self, some: Indices, other: "_State") -> None:
        """Take over the state of some nodes."""
        self.Z[some] = other.Z
        self.price[some] = other.price
        self.y[some] = other.y
        self.tau[some] = other.tau
        self.centred[some] = other.centred
        self.lost[some] = other.lost


@dataclass(frozen=True, eq=False)
class _Game:
    """The problems of nodes (b,).

    Attributes:
        F: Features (b, c, q + k) of candidates, zeros where there is none.
        known: Where there is one (b, c).
        own: Their groups (b, c, g), as ones and zeros.
        counts: Experiments (b, g) in each; zero of groups that a node has not.
        K: What every plan has (q + k,).
        floor: F (q + k,), entries off the diagonal twice.
        twice: How often each entry (q,) stands in a matrix.
        dearest: The largest price (b,) of a budget.
        least: The merit below which a node is closed.
    """

    F: Array
    known: Mask
    own: Array
    counts: Array
    K: Array
    floor: Array
    twice: Array
    dearest: Array
    least: float

    @classmethod
    def of(
        cls,
        merits: Merits,
        nodes: Nodes,
        chosen: Indices,
        known: Mask,
        merit: Array,
        least: float,
    ) -> "_Game":
        """Those of nodes with chosen candidates (b, c), of merits (b,) that are known."""
        merit = np.where(np.isfinite(merit) & (merit > 0), merit, 1.0)
        counts, own = nodes.grouped(chosen, known)
        assert merits.floor is not None
        return cls(
            F=merits.F[nodes.candidates[chosen]] * known[..., None],
            known=known,
            own=own,
            counts=counts,
            K=merits.K,
            floor=np.append(sensitivity_rows(merits.floor), np.zeros(merits.budgets)),
            twice=merits.twice[: merits.q],
            dearest=DEAREST * merit,
            least=least,
        )

    def __getitem__(self, some: Indices) -> "_Game":
        """Those of some nodes."""
        return _Game(
            self.F[some], self.known[some], self.own[some], self.counts[some],
            self.K, self.floor, self.twice, self.dearest[some], self.least,
        )  # fmt: skip

    @property
    def p(self) -> int:
        """Number of parameters."""
        return order(len(self.twice))

    @property
    def terms(self) -> Array:
        """Number (b,) of logarithms of the barriers."""
        return self.p + 2 * (len(self.K) - len(self.twice)) + self.known.sum(axis=1)

    def packed(self, state: _State) -> Array:
        """Multipliers (b, q + k), each entry of a matrix once."""
        rows, columns = triangle(self.p)
        return np.concatenate([state.Z[:, rows, columns], state.price], axis=1)

    def begun(self, Z: Array, merit: Array) -> _State:
        """A start inside, near multipliers (b, q + k)."""
        rows, columns = triangle(self.p)
        b = len(self.F)
        M = np.empty((b, self.p, self.p))
        unit = np.append(np.eye(self.p)[rows, columns], np.zeros(len(self.K) - len(rows)))
        # A multiplier that proves nothing is no beginning.
        proves = np.isfinite(Z).all(axis=1) & (Z @ self.floor > 0)
        Z = np.where(proves[:, None], Z, unit)
        Z = Z / (Z @ self.floor)[:, None]
        M[:, rows, columns] = M[:, columns, rows] = Z[:, : len(rows)]
        regular = np.eye(self.p) / (self.floor @ unit)
        M = (1.0 - INSIDE) * M + INSIDE * regular
        merit = np.where(np.isfinite(merit) & (merit > 0), merit, 1.0)
        room = BEGIN * merit / np.maximum(self.counts.sum(axis=1), 1.0)
        funds = np.maximum(np.abs(self.K[len(rows) :]), SMALL)
        price = Z[:, len(rows) :] + BEGIN * merit[:, None] / funds
        price = np.minimum(price, 0.5 * self.dearest[:, None])
        z = self._sensitivities(M, price)
        tops = np.where(self.own > 0, z[..., None], -np.inf).max(axis=1)
        y = np.where(self.counts > 0, tops + room[:, None], 0.0)
        return _State(
            M, price, y, self.terms / (BEGIN * merit), np.zeros(b, dtype=bool),
            np.zeros(b, dtype=bool),
        )  # fmt: skip

    def open(self, state: _State) -> Mask:
        """The nodes (b,) whose multipliers are to be improved."""
        value = self.packed(state) @ self.K + (self.counts * state.y).sum(axis=1)
        merit = np.where(state.centred, value - self.terms / state.tau, 0.0)
        done = is_near(value, merit, self.least, NEAR_AT_KINKS)
        return np.asarray(~done & ~state.lost & np.isfinite(value))

    def weights(self, state: _State) -> Array:
        """Weights (b, k) of the candidates."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / (state.tau[:, None] * self._slack(state)))

    def stepped(self, state: _State) -> _State:
        """One step of Newton's method, after which tau may grow."""
        rows, columns = triangle(self.p)
        tau = np.where(state.centred, FASTER * state.tau, state.tau)
        z, V = np.linalg.eigh(state.Z)
        R = V / np.sqrt(np.maximum(z, SMALL * z[:, -1:]))[:, None]
        u = np.where(self.known, 1.0 / self._slack(state), 0.0)
        # Derivatives of each slack by the multiplier and by the bounds of the groups.
        J = np.concatenate([-self.F, self.own], axis=2)
        rise = 1.0 / state.price
        fall = 1.0 / (self.dearest[:, None] - state.price)
        g, H = self._derivatives(tau, R @ np.swapaxes(R, 1, 2), rise, fall, u, J)
        right = np.append(-g, np.zeros((len(tau), 1)), axis=1)
        step = solved(H, right[..., None])[:, :-1, 0]
        lost = ~np.isfinite(step).all(axis=1)
        step[lost] = 0.0
        length = np.sqrt(np.maximum(-(g * step).sum(axis=1), 0.0))
        q = len(rows)
        end = len(self.K)
        dZ = np.empty_like(state.Z)
        dZ[:, rows, columns] = dZ[:, columns, rows] = step[:, :q]
        change = np.einsum("bkj,bj->bk", J, step)
        shrinks = np.where(self.known, -change * u, 0.0).max(axis=1)
        e = np.linalg.eigvalsh(np.swapaxes(R, 1, 2) @ dZ @ R)[:, 0]
        shrinks = np.maximum(shrinks, -e)
        of_prices = np.maximum(-step[:, q:end] * rise, step[:, q:end] * fall)
        shrinks = np.maximum(shrinks, of_prices.max(axis=1, initial=0.0))
        reach = REACH / np.maximum(shrinks, REACH)
        return _State(
            state.Z + reach[:, None, None] * dZ,
            state.price + reach[:, None] * step[:, q:end],
            state.y + reach[:, None] * step[:, end:],
            tau,
            np.asarray((length < CENTRED) & (reach >= 1.0)),
            np.asarray(lost),
        )

    def _derivatives(
        self, tau: Array, inverse: Array, rise: Array, fall: Array, u: Array, J: Array
    ) -> tuple[Array, Array]:
        """Gradient (b, k) of the barrier, and its second derivatives bordered by ``<Z, F> = 1``.

        Args:
            tau: Factors (b,) of the objective.
            inverse: Inverses (b, p, p) of the multipliers.
            rise: Inverses (b, k) of the prices.
            fall: Inverses (b, k) of what is left to the largest price.
            u: Inverses (b, c) of the slacks; zero where there is no candidate.
            J: Derivatives (b, c, k) of the slacks.
        """
        rows, columns = triangle(self.p)
        q = len(rows)
        end = len(self.K)
        size = J.shape[2]
        g = tau[:, None] * np.concatenate(
            [np.broadcast_to(self.K, (len(tau), end)), self.counts], axis=1
        )
        g = g - np.einsum("bk,bkj->bj", u, J)
        g[:, :q] -= self.twice * inverse[:, rows, columns]
        g[:, q:end] += fall - rise
        Ju = J * u[..., None]
        H = np.zeros((len(tau), size + 1, size + 1))
        H[:, :size, :size] = np.swapaxes(Ju, 1, 2) @ Ju
        H[:, :q, :q] += self._curvature(inverse)
        budgets = np.arange(q, end)
        H[:, budgets, budgets] += np.square(rise) + np.square(fall)
        each = np.arange(end, size)
        H[:, each, each] += self.counts == 0
        H[:, size, :end] = H[:, :end, size] = self.floor
        return g, H

    def _sensitivities(self, Z: Array, price: Array) -> Array:
        """``<Z, M_i> - <price, c_i>`` (b, c)."""
        rows, columns = triangle(self.p)
        features = np.concatenate([Z[:, rows, columns], price], axis=1)
        return np.asarray((self.F @ features[..., None])[..., 0])

    def _slack(self, state: _State) -> Array:
        """``y_g`` minus the sensitivities (b, c); one where there is no candidate."""
        own = self._sensitivities(state.Z, state.price)
        slack = (self.own @ state.y[..., None])[..., 0] - own
        return np.where(self.known, slack, 1.0)

    def _curvature(self, W: Array) -> Array:
        """Second derivatives (b, q, q) of ``-log det Z`` by a triangle, with W the inverse of Z."""
        i, j = triangle(self.p)
        products = W[:, i[:, None], i] * W[:, j[:, None], j]
        products += W[:, i[:, None], j] * W[:, j[:, None], i]
        return np.asarray(0.5 * np.outer(self.twice, self.twice) * products)
