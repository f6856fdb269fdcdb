"""Bounds on plans whose errors have a structure, from mixtures of arrangements.

Less noise tells more: where ``V >= V'`` the information obeys ``M <= M'``, and so does a monotone
criterion. What makes a bound hard may therefore be left out. Three structures are left that have
one, and the sharpest of their bounds is taken:

- Groups of one stratum, with the settings that they keep: M is a sum over groups, and for a
  multiplier Z every plan obeys ``<Z, M> <= sum_g max_G <Z, M_G>`` over all settings of a group G.
- Series whose precision links neighbours alone, such as AR(1), beside trends as parameters of
  nuisance: the sequence of the largest ``<Z, M>`` is found by dynamic programming (Viterbi).
- Independent runs: ``W <= max eigenvalue of W``, and the weights of one run are relaxed.

The first two mix whole arrangements by column generation (`Decomposition`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from criteria import CriterionError, Relaxable
from criteria.linalg.inverse import root
from edtk.design.errors import RunErrors
from edtk.design.exact.arranged.settings import Settings
from edtk.design.exact.counts.blocks_bound import (
    BLOCK_STARTS,
    SAME_BLOCK,
    BlockQuadratic,
    JoinedBlocks,
)
from edtk.design.exact.counts.counts_bound import (
    Decomposition,
    RelaxedCounts,
    of_interest,
    relaxed_counts,
)
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.system.typing import Array, Indices

MIXTURE_GAP = 1e-5  # relative gap between the best mixture and the bound at which to end
NEAR_BOUND = 1e-9  # relative distance of a bound to a plan's cost at which no sharper one is sought
MOST_STEPS = 3e8  # of a dynamic program: steps times pairs of candidates
MOST_NUISANCE = 40  # parameters of trends and effects beside those of the model
BAND = 1e-9  # part of the diagonal of a precision up to which an entry is zero


class Part(Protocol):
    """Like parts of a plan that are independent of each other.

    Attributes:
        number: How many there are.
        size: Runs of each.
    """

    number: int
    size: int

    def information(self, block: Indices) -> Array:
        """Information (p, p) of a part with the candidates (k,)."""
        ...

    def best(self, Z: Array, known: Indices) -> tuple[float, Indices]:
        """What ``<Z, M>`` of a part is at most, and parts (c, k) that come near it, best first."""
        ...


@dataclass(frozen=True, eq=False)
class Group(Part):
    """A group of k runs with one effect: ``X'X - a (1'X)'(1'X)``, see `Scatter`.

    Attributes:
        number: How many groups of this size there are.
        size: k.
        rows: Rows (n, r, p) of the candidates.
        share: a.
        slices: Candidates of each setting that a group keeps.
    """

    number: int
    size: int
    rows: Array
    share: float
    slices: Sequence[Indices]

    def information(self, block: Indices) -> Array:
        """The scatter of its rows."""
        U = self.rows[block]
        total = U.sum(axis=0)
        return np.asarray(np.einsum("kri,krj->ij", U, U) - self.share * total.T @ total)

    def best(self, Z: Array, known: Indices) -> tuple[float, Indices]:
        """The best group of the best setting: exchanges in each, then branch and bound."""
        rng = np.random.default_rng(len(self.rows))
        quadratics = []
        found = []
        values = []
        for own in self.slices:
            quadratic = BlockQuadratic.of(self.rows[own], Z, self.size, self.share, None)
            starts = rng.integers(len(own), size=(BLOCK_STARTS, self.size))
            inside = known[np.isin(known, own).all(axis=1)]
            starts = np.concatenate([np.searchsorted(own, inside), starts])
            blocks = np.unique(quadratic.improved(starts), axis=0)
            quadratics.append(quadratic)
            found.append(own[blocks])
            values.append(quadratic.values(blocks))
        value = max(float(own.max()) for own in values)
        upper = value
        better: list[Indices] = []
        for i in np.argsort([-own.max() for own in values], kind="stable"):
            top, block = quadratics[i].proved(value)
            upper = max(upper, top)
            if block is not None:
                better.append(self.slices[i][block][None])
                value = max(value, float(quadratics[i].values(block[None])[0]))
        order = np.argsort(-np.concatenate(values), kind="stable")
        blocks = np.concatenate([*better[::-1], np.concatenate(found)[order]])
        return max(upper, value), blocks[: 4 + len(better)]


@dataclass(frozen=True, eq=False)
class Series(Part):
    """A series of k runs whose precision is tridiagonal, beside columns of nuisance.

    Attributes:
        number: How many like series there are.
        size: k.
        rows: Rows (n, r, p) of the candidates.
        beside: Columns (k, e) of nuisance.
        diagonal: Diagonal (k,) of the precision.
        links: Its entries (k - 1,) beside the diagonal.
    """

    number: int
    size: int
    rows: Array
    beside: Array
    diagonal: Array
    links: Array

    def information(self, block: Indices) -> Array:
        """``U'WU`` of the rows with their nuisance."""
        U = np.stack([self._rows(t)[block[t]] for t in range(self.size)])
        M = np.einsum("t,tri,trj->ij", self.diagonal, U, U)
        across = np.einsum("t,tri,trj->ij", self.links, U[:-1], U[1:])
        return np.asarray(M + across + across.T)

    def best(self, Z: Array, known: Indices) -> tuple[float, Indices]:
        """The best sequence, by dynamic programming over its last candidate."""
        L = root(Z).T
        n = len(self.rows)
        came = np.zeros((self.size, n), dtype=int)
        before = (self._rows(0) @ L).reshape(n, -1)
        score = self.diagonal[0] * (before**2).sum(axis=1)
        for t in range(1, self.size):
            v = (self._rows(t) @ L).reshape(n, -1) if self.beside.shape[1] else before
            if self.links[t - 1]:
                through = score[:, None] + 2 * self.links[t - 1] * (before @ v.T)
                came[t] = through.argmax(axis=0)
                arrived = through[came[t], np.arange(n)]
            else:
                came[t] = score.argmax()
                arrived = np.full(n, score.max())
            score = arrived + self.diagonal[t] * (v**2).sum(axis=1)
            before = v
        path = np.empty(self.size, dtype=int)
        path[-1] = score.argmax()
        for t in range(self.size - 1, 0, -1):
            path[t - 1] = came[t, path[t]]
        top = float(score.max())
        return top + SAME_BLOCK * abs(top), path[None]

    def _rows(self, t: int) -> Array:
        """Rows (n, r, p + r e) of all candidates at a place of the series."""
        if not self.beside.shape[1]:
            return self.rows
        n, r, _ = self.rows.shape
        own = np.kron(np.eye(r), self.beside[t][None])
        return np.concatenate([self.rows, np.broadcast_to(own, (n, *own.shape))], axis=2)


class Arrangements(JoinedBlocks):
    """Plans that have one block of each part, repeated as often as there are such parts.

    Args:
        parts: The parts.
        base: Information (p, p) that every plan has.
    """

    def __init__(self, parts: Sequence[Part], base: Array) -> None:
        self.parts = parts
        self.base = base
        self._known = [np.zeros((0, part.size), dtype=int) for part in parts]
        self._ends = np.cumsum([part.size for part in parts])[:-1]

    def enter(self, blocks: Sequence[Indices]) -> list[Indices]:
        """Start from blocks (c, k) of each part, and give the plans that they make."""
        return self._joined(blocks)

    def information(self, plan: Indices) -> Array:
        """Information (p, p) of a plan, with what every plan has."""
        M = self.base.copy()
        for part, block in zip(self.parts, np.split(plan, self._ends), strict=True):
            M += part.number * part.information(block)
        return M

    def largest(self, Z: Array) -> tuple[float, Sequence[Indices]]:
        """What ``<Z, M>`` is at most, and the plans that come near it, the best first."""
        upper = float(np.sum(Z * self.base))
        best = []
        for part, known in zip(self.parts, self._known, strict=True):
            top, blocks = part.best(Z, known)
            upper += part.number * top
            best.append(blocks)
        return upper, self._joined(best)


@dataclass(frozen=True, eq=False)
class ArrangedBound:
    """What bounds need to know.

    Attributes:
        rows: Rows (n, r, p) of the candidates, in parameters of order one.
        runs: The structure of the errors.
        base: Information (p, p) that every plan has.
        criterion: What is minimised.
        settings: Settings of the candidates, and the groups that keep them.
        places: A regular plan (m,).
        cost: Its cost, which no bound can exceed.
    """

    rows: Array
    runs: RunErrors
    base: Array
    criterion: Relaxable
    settings: Settings
    places: Indices
    cost: float

    def sharpest(self) -> RelaxedCounts | None:
        """The sharpest bound of all kinds; None where there is none."""
        best: RelaxedCounts | None = None
        for bound in (*self._of_strata(), self._of_series, self._of_independent):
            if best is not None and best.cost >= self.cost * (1 - NEAR_BOUND):
                break
            found = bound()
            if found is not None and (best is None or found.cost > best.cost):
                best = found
        return best if best is not None and best.cost > 0 else None

    def _of_strata(self) -> list[Callable[[], RelaxedCounts | None]]:
        """A bound for each stratum, the others set aside."""
        if self.runs.errors.correlation is not None:
            return []
        return [partial(self._of_stratum, i) for i in range(len(self.runs.labels))]

    def _of_stratum(self, i: int) -> RelaxedCounts | None:
        """The bound of groups of one stratum, with all that these groups keep."""
        labels = self.runs.labels[i]
        stratum = self.runs.errors.levels[i]
        keeps = [
            columns
            for other, columns in zip(self.runs.labels, self.settings.hard, strict=True)
            if _is_within(labels, other)
        ]
        slices = self.settings.slices(np.concatenate(keeps))
        groups = [np.flatnonzero(labels == group) for group in range(labels.max() + 1)]
        sizes = np.array([len(group) for group in groups])
        parts: list[Part] = []
        blocks = []
        for size in np.unique(sizes):
            v = stratum.variance
            share = 1.0 / size if np.isinf(v) else v / (1.0 + size * v)
            parts.append(
                Group(int((sizes == size).sum()), int(size), self.rows, float(share), slices)
            )
            blocks.append(np.array([np.sort(self.places[g]) for g in groups if len(g) == size]))
        words = f"mixtures of {stratum.plural}"
        aside = [own.plural for own in self.runs.errors.levels if own is not stratum]
        aside += ["trends"] * bool(self.runs.trends)
        return self._mixed(parts, self.base, self.criterion, blocks, words, aside)

    def _of_series(self) -> RelaxedCounts | None:
        """The bound of series of neighbours, beside trends; strata are set aside."""
        errors = self.runs.errors
        if errors.correlation is None and not errors.trends:
            return None
        W = np.linalg.inv(self.runs.noise)
        far = np.abs(np.triu(W, 2)).max(initial=0.0)
        n = len(self.rows)
        if far > BAND * np.abs(W).max() or n * n * len(W) > MOST_STEPS:
            return None
        F, precision = self._nuisance()
        criterion: Relaxable = self.criterion
        r, p = self.rows.shape[1:]
        if F.shape[1]:
            try:
                criterion = of_interest(self.criterion, p, r * F.shape[1])
            except CriterionError:
                F = F[:, :0]
        e = r * F.shape[1]
        base = np.zeros((p + e, p + e))
        base[:p, :p] = self.base
        if e:
            base[p:, p:] = np.kron(np.eye(r), np.diag(precision))
        links = np.where(np.abs(np.diag(W, 1)) > BAND * np.abs(W).max(), np.diag(W, 1), 0.0)
        parts: list[Part] = []
        blocks: list[Indices] = []
        is_one = errors.correlation is None
        cuts = np.flatnonzero(np.ones(0) if is_one else links == 0) + 1
        series = np.split(np.arange(len(W)), cuts)
        for own, number in _like(series, np.asarray(W), F):
            part = Series(
                number, len(own[0]), self.rows, F[own[0]], np.diag(W)[own[0]], links[own[0][:-1]]
            )
            parts.append(part)
            blocks.append(np.array([self.places[runs] for runs in own]))
        aside = [stratum.plural for stratum in errors.levels]
        if errors.trends and not e:
            aside.append("trends")
        return self._mixed(parts, base, criterion, blocks, "mixtures of sequences", aside)

    def _nuisance(self) -> tuple[Array, Array]:
        """Columns (m, e) of trends, and what is known beforehand of each (e,)."""
        parts = [
            (columns, 1.0 / trend.variance)
            for columns, trend in zip(self.runs.trends, self.runs.errors.trends, strict=True)
        ]
        F = np.concatenate([np.zeros((self.runs.m, 0)), *(own for own, _ in parts)], axis=1)
        precision = np.concatenate(
            [np.zeros(0), *(np.full(own.shape[1], known) for own, known in parts)]
        )
        if F.shape[1] * self.rows.shape[1] > MOST_NUISANCE:
            return F[:, :0], precision[:0]
        return F, precision

    def _of_independent(self) -> RelaxedCounts | None:
        """The bound of independent runs with the largest eigenvalue of the precision."""
        if not self.criterion.monotone:
            return None
        W = self.runs.precision
        most = float(np.linalg.eigvalsh(W)[-1]) * (1 + BAND)
        try:
            problem = Problem(self.rows * np.sqrt(most))
            found = relaxed_counts(problem, self.criterion, Limits(len(W), self.base))
        except RelaxationError:
            return None
        return RelaxedCounts(
            found.counts,
            found.cost,
            found.gap,
            found.multipliers,
            "weights of independent runs, the structure of the errors set aside",
            found.kind,
        )

    def _mixed(
        self,
        parts: Sequence[Part],
        base: Array,
        criterion: Relaxable,
        blocks: Sequence[Indices],
        words: str,
        aside: Sequence[str],
    ) -> RelaxedCounts | None:
        """The bound of mixtures of parts."""
        if aside and not self.criterion.monotone:
            return None
        plans = Arrangements(parts, base)
        M = base + sum(
            part.information(block)
            for part, own in zip(parts, blocks, strict=True)
            for block in own
        )
        search = Decomposition(plans, criterion, plans.enter(blocks), M)
        if criterion.smooth:
            search.prove(-criterion.gradient(M)[None], M)
        search.run(MIXTURE_GAP)
        names = list(dict.fromkeys(aside))
        basis = f"{words}, {' and '.join(names)} set aside" if names else words
        return RelaxedCounts(
            np.zeros(len(self.rows)),
            float(search.bound),
            search.gap,
            np.zeros((0, *base.shape)),
            basis,
        )


def _is_within(inner: Indices, outer: Indices) -> bool:
    """Whether every group of a stratum lies within one of another."""
    pairs = {(i, o) for i, o in zip(inner.tolist(), outer.tolist(), strict=True)}
    return len(pairs) == len({i for i, _ in pairs})


def _like(series: Sequence[Indices], W: Array, F: Array) -> list[tuple[list[Indices], int]]:
    """Series of the same precision and nuisance, together."""
    found: dict[bytes, list[Indices]] = {}
    for own in series:
        key = np.round(W[np.ix_(own, own)], 12).tobytes() + np.round(F[own], 12).tobytes()
        found.setdefault(key, []).append(own)
    return [(runs, len(runs)) for runs in found.values()]
