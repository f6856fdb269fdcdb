"""The search for the best arrangement of runs: exchanges of the settings of runs and of groups.

A plan of the rows X tells ``M = X'W X`` with the precision W of its runs. Let g be some of them,
and ``C = W_go X_o`` what the others o bring to them. With ``W_gg = L L'`` the plan whose runs g
have other rows Y tells

    M = R + F'F ,   F = L'Y + L^+ C ,   R = what the others alone tell.

So an exchange of one run has rank one, and of a whole plot of k runs rank k: `exchange_costs`
prices all alternatives without an inverse for each.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import eigenpairs
from edtk.design.exact.arranged.settings import NO_RUNS, Move, Settings
from edtk.design.exact.counts.counts_search import RIDGE, FoundPlaces, Record
from edtk.design.exact.counts.prices import GAIN, least_gain
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.system.errors import UserError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

MOVE_SWEEPS = 60  # over all moves, at most: some ten are usual
ENTRIES_PRICED = 1_000_000  # entries of the matrices that are priced together
WAVE = 24  # plans that are improved in step with each other
KICKED_MOVES = 0.15  # part of the moves of a plan that a kick draws anew; two at least
WAVES = 4  # without an improvement after which a search ends; and as many as it took besides
MOST_ARRANGED_WAVES = 512
ARRANGED_EFFORT = 6e9  # products that waves without an improvement may take
DRAWS = 200  # of a start, before candidates count as too few
SAME_ENTRY = 1e-12  # part of the largest entry of a precision up to which two entries are the same
MOST_SWAPPED = 80  # runs up to which pairs of them are swapped


@dataclass(frozen=True, eq=False)
class _Block:
    """A move with what the precision says about its runs.

    Attributes:
        move: The move.
        own: W_gg (k, k).
        beside: Rows of W (k, m) of its runs.
        root: L (k, q), ``L L' = W_gg``.
        inverse: L^+ (q, k).
    """

    move: Move
    own: Array
    beside: Array
    root: Array
    inverse: Array

    @classmethod
    def of(cls, move: Move, W: Array) -> "_Block":
        """The part of a precision W (m, m) that a move is about."""
        own = W[np.ix_(move.runs, move.runs)]
        r, V = eigenpairs(own)
        # Fixed effects leave directions of which the runs tell nothing.
        told = r > 1e-12 * max(float(r[-1]), np.finfo(float).tiny)
        root = V[:, told] * np.sqrt(r[told])
        inverse = (V[:, told] / np.sqrt(r[told])).T
        return cls(move, own, W[move.runs], root, inverse)


@dataclass(frozen=True, eq=False)
class ArrangedSearch:
    """A search over arrangements, ready to run.

    Attributes:
        rows: Rows (n, r, p) of the candidates, in parameters of order one.
        W: Precision (m, m) of the runs.
        base: Information (p, p) that every plan has.
        criterion: The criterion to minimise.
        settings: Settings of the candidates, and the groups that keep them.
        first: The candidates (k,) of the first runs, which are made already.
        most: How often each candidate may be used (n,); None for no limit.
    """

    rows: Array
    W: Array
    base: Array
    criterion: Criterion
    settings: Settings
    first: Indices = field(default_factory=lambda: NO_RUNS)
    most: Indices | None = None

    @property
    def m(self) -> int:
        """Number of runs."""
        return len(self.W)

    @cached_property
    def blocks(self) -> list[_Block]:
        """All moves of runs that are not made yet."""
        moves = self.settings.moves(self.m)
        return [_Block.of(move, self.W) for move in moves if move.runs.min() >= len(self.first)]

    @cached_property
    def differ(self) -> Mask:
        """Which two runs (m, m) may not change places without a change of the precision.

        Runs of one group that are linked to all others alike tell the same in either order.
        """
        W = self.W
        found = np.zeros(W.shape, dtype=bool)
        least = SAME_ENTRY * np.abs(W).max()
        for s in range(self.m):
            across = np.abs(W - W[s])
            across[:, s] = 0.0
            np.fill_diagonal(across, np.abs(np.diag(W) - W[s, s]))
            found[s] = across.max(axis=1) > least
        return found

    def information(self, places: Indices) -> Array:
        """Information (b, p, p) of plans (b, m)."""
        X = self.rows[places]
        return (
            np.asarray(np.einsum("bsri,bsrj->bij", X, self._turned(X), optimize=True)) + self.base
        )

    def costs(self, M: Array) -> Array:
        """Costs (...) of information (..., p, p); inf where it is singular."""
        costs = np.asarray(self.criterion.plan_criterion.cost(M))
        return np.where(np.isnan(costs), np.inf, costs)

    def run(
        self, seed: int, starts: int | None, progress: Callable[[int, float], object]
    ) -> FoundPlaces:
        """Search from so many starts, or until as many again as it took bring nothing better."""
        record = Record()

        def enter(size: int) -> str:
            rng = np.random.default_rng((seed, record.waves))
            kick = record.waves % 2 == 1
            begin = self._kicked(rng, record, size) if kick else self.drawn(rng, size)
            record.enter(self.improved(begin), not kick)
            progress(record.starts, record.cost)
            is_over = starts is None and record.is_idle(self._patience())
            return "stagnation" if is_over else ""

        return record.filled(enter, WAVE, MOST_ARRANGED_WAVES * WAVE if starts is None else starts)

    def improved(self, places: Indices) -> tuple[Array, Indices]:
        """Costs (b,) and places (b, m) of plans that no move improves."""
        places = self._descended(places, RIDGE, swaps=False)
        places = self._descended(places, 0.0, swaps=self.m <= MOST_SWAPPED)
        return self.costs(self.information(places)), places

    def _patience(self) -> int:
        """Starts without an improvement after which the search ends."""
        p = self.base.shape[0]
        priced = sum(block.root.shape[1] * len(block.move.options) for block in self.blocks)
        effort = 10.0 * WAVE * priced * self.rows.shape[1] * p * p
        return WAVE * int(np.clip(ARRANGED_EFFORT / effort, 2, WAVES))

    def drawn(self, rng: np.random.Generator, number: int) -> Indices:
        """Plans (b, m) that are drawn at random.

        Raises:
            UserError: The candidates have no plan of this structure, as far as draws have seen.
        """
        found: list[Indices] = []
        for _ in range(number * DRAWS):
            drawn = self.settings.drawn(rng, self.m, self.first, self.most)
            if drawn is not None:
                found.append(drawn)
            if len(found) == number:
                return np.array(found)
        raise UserError(
            "no plan was found in which groups keep their hard-to-change settings: the candidates "
            "do not have every setting of one stratum with those of the others"
            + ("" if self.most is None else ", or too few within most")
        )

    def _kicked(self, rng: np.random.Generator, record: Record, number: int) -> Indices:
        """The best plan so far (b, m), with some of its moves drawn at random."""
        assert record.places is not None
        places = np.tile(record.places, (number, 1))
        each = np.arange(number)
        several = max(2, round(KICKED_MOVES * len(self.blocks)))
        for _ in range(rng.integers(2, several + 1)):
            move = self.blocks[rng.integers(len(self.blocks))].move
            alternatives = self.settings.alternatives(move, places)
            new = alternatives[each, rng.integers(len(move.options), size=number)]
            fits = self._allowed(move, places, new[:, None])[:, 0]
            places[np.ix_(each[fits], move.runs)] = new[fits]
        return places

    def _turned(self, X: Array) -> Array:
        """W X (b, m, r, p)."""
        b, m, r, p = X.shape
        return np.asarray((self.W @ X.reshape(b, m, r * p)).reshape(b, m, r, p))

    def _descended(self, places: Indices, ridge: float, swaps: bool) -> Indices:
        """Plans (b, m) after exchanges, and swaps, as long as these improve them.

        A ridge is the part of the candidates' mean information, for each run, that every plan has
        besides.
        """
        places = places.copy()
        left = np.arange(len(places))
        beside = ridge * self.m * np.eye(self.base.shape[0])
        least = least_gain(ridge)
        for _ in range(MOVE_SWEEPS):
            own = places[left]
            M = self.information(own) + beside
            costs = self.costs(M)
            moved = np.zeros(len(left), dtype=bool)
            for block in self.blocks:
                moved |= self._exchange(block, own, M, costs, least)
            if swaps and not moved.all():
                still = np.flatnonzero(~moved)
                part, part_M, part_costs = own[still], M[still], costs[still]
                moved[still] = self._swap_all(part, part_M, part_costs)
                own[still] = part
            places[left] = own
            left = left[moved]
            if not len(left) or out_of_time():
                break
        return places

    def _exchange(
        self, block: _Block, places: Indices, M: Array, costs: Array, gain: float
    ) -> Array:
        """Make the best exchange of a move in each plan; which plans (b,) are better."""
        move = block.move
        alternatives = self.settings.alternatives(move, places)
        X = self.rows[places]
        b, _, r, p = X.shape
        k = len(move.runs)
        old = X[:, move.runs].reshape(b, k, r * p)
        turned = block.beside @ X.reshape(b, -1, r * p)
        others = turned - block.own @ old
        rest = M - _joined(block.root.T @ old + block.inverse @ others, r, p)
        reached = self._reached(block, alternatives, others, rest)
        reached = np.where(self._allowed(move, places, alternatives), reached, np.inf)
        best = reached.argmin(axis=1)
        each = np.arange(b)
        least = reached[each, best]
        better = least < costs * (1 - gain)
        if better.any():
            new = alternatives[each[better], best[better]]
            places[np.ix_(each[better], move.runs)] = new
            Y = self.rows[new].reshape(len(new), k, r * p)
            F = block.root.T @ Y + block.inverse @ others[better]
            M[better] = rest[better] + _joined(F, r, p)
            costs[better] = least[better]
        return better

    def _reached(self, block: _Block, alternatives: Indices, others: Array, rest: Array) -> Array:
        """Costs (b, S) of the alternatives of a move."""
        b, S, k = alternatives.shape
        r, p = self.rows.shape[1:]
        q = block.root.shape[1]
        center = block.inverse @ others
        found = np.empty((b, S))
        pieces = max(1, -(-b * S * max(p * p, q * r * p) // ENTRIES_PRICED))
        for part in np.array_split(np.arange(S), min(pieces, S)):
            Y = self.rows[alternatives[:, part]].reshape(b, len(part), k, r * p)
            F = (block.root.T @ Y + center[:, None]).reshape(b, len(part), q * r, p)
            found[:, part] = exchange_costs(self.criterion.plan_criterion, rest, F, np.ones(b))
        return np.where(np.isnan(found), np.inf, found)

    def _allowed(self, move: Move, places: Indices, alternatives: Indices) -> Mask:
        """Which alternatives (b, S, k) of a move are there, and use no candidate too often."""
        found: Mask = np.asarray((alternatives >= 0).all(axis=-1))
        if self.most is None:
            return found
        others = np.delete(places, move.runs, axis=1)
        n = len(self.most)
        offsets = n * np.arange(len(places))[:, None]
        counts = np.bincount((others + offsets).ravel(), minlength=n * len(places))
        used = counts[(alternatives + offsets[:, :, None]).clip(min=0)]
        for run in range(alternatives.shape[-1]):
            used = used + (alternatives == alternatives[..., [run]])
        return found & (used <= self.most[alternatives]).all(axis=-1)

    def _swap_all(self, places: Indices, M: Array, costs: Array) -> Array:
        """Swap each run with the best other one, in each plan; which plans (b,) it has improved.

        With ``d = x_t - x_s`` and ``g = (W X)_s - (W X)_t`` a swap of s and t adds
        ``g'd + d'g + (W_ss - 2 W_st + W_tt) d'd``.
        """
        b = len(places)
        each = np.arange(b)
        moved = np.zeros(b, dtype=bool)
        diagonal = np.diag(self.W)
        for s in range(len(self.first), self.m):
            X = self.rows[places]
            turned = self._turned(X)
            d = X - X[:, [s]]
            g = turned[:, [s]] - turned
            w = diagonal[s] - 2 * self.W[s] + diagonal
            allowed = self.settings.may_swap(places, s) & self.differ[s] & (np.arange(self.m) > s)
            plans, others = np.nonzero(allowed & (places != places[:, [s]]))
            if not len(plans):
                continue
            half = g + 0.5 * w[None, :, None, None] * d
            step = np.swapaxes(half[plans, others], -1, -2) @ d[plans, others]
            step = step + np.swapaxes(step, -1, -2)
            reached = np.full(places.shape, np.inf)
            reached[plans, others] = self.costs(M[plans] + step)
            best = reached.argmin(axis=1)
            least = reached[each, best]
            better = np.flatnonzero(least < costs * (1 - GAIN))
            if len(better):
                t = best[better]
                first = places[better, s].copy()
                places[better, s] = places[better, t]
                places[better, t] = first
                joined = np.swapaxes(half[better, t], -1, -2) @ d[better, t]
                M[better] += joined + np.swapaxes(joined, -1, -2)
                costs[better] = least[better]
                moved[better] = True
        return moved


def _joined(F: Array, r: int, p: int) -> Array:
    """F'F (b, p, p) of factors (b, q, r p)."""
    rows = F.reshape(len(F), -1, p)
    return np.asarray(np.swapaxes(rows, -1, -2) @ rows)
