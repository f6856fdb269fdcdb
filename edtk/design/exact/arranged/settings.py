"""The settings of factors that candidates have, and which of them the groups of runs keep."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.design.errors import RunErrors, Stratum, hard_names
from edtk.design.problem import Problem
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices, Mask

# Settings that are tried for a group at once; of more, one factor after the other is exchanged.
SETTINGS_TOGETHER = 600
NO_RUNS = np.zeros(0, dtype=int)


@dataclass(frozen=True, eq=False)
class Move:
    """An exchange of some factors of some runs, the same setting for all of them.

    Attributes:
        runs: The runs (k,).
        columns: The factors (f,) that change, as columns of `Settings.levels`.
        options: Their settings (S, f) to try.
    """

    runs: Indices
    columns: Indices
    options: Indices


@dataclass(frozen=True, eq=False)
class Settings:
    """Candidates as settings of factors, and the groups of runs that keep some of them.

    Attributes:
        levels: The level (n, f) of each factor in each candidate; a number each from 0.
        hard: Of each stratum, the columns of the factors that its groups keep.
        labels: The group (m,) of each run, of each stratum.
    """

    levels: Indices
    hard: tuple[Indices, ...]
    labels: tuple[Indices, ...]

    @classmethod
    def of(cls, problem: Problem, runs: RunErrors) -> "Settings":
        """The settings of the candidates of a problem, its frame's where it has one.

        Raises:
            ArgumentError: There is no such factor, or several strata keep it.
        """
        named: dict[str, Indices] = {}
        if problem.frame is not None:
            for name in problem.frame.columns:
                named[str(name)] = _numbered(problem.frame[name].to_numpy())
        hard: list[tuple[str, ...]] = []
        for stratum in runs.errors.levels:
            hard.append(_kept(stratum, problem, named))
        every = [name for own in hard for name in own]
        twice = [name for name in every if every.count(name) > 1]
        if twice:
            message = f"two strata keep {twice[0]!r}; groups inside one that keeps it do so anyway"
            raise ArgumentError(message, argument="hard")
        if problem.frame is None:
            named["candidate"] = _ranks(list(named.values()), problem.n)
        names = list(named)
        columns = tuple(np.array([names.index(name) for name in own], dtype=int) for own in hard)
        return cls(np.stack(list(named.values()), axis=1), columns, runs.labels)

    @property
    def m(self) -> int:
        """Number of runs."""
        return len(self.labels[0]) if self.labels else 0

    @cached_property
    def kept(self) -> Indices:
        """All factors that some stratum keeps."""
        return np.concatenate([np.zeros(0, dtype=int), *self.hard])

    @cached_property
    def easy(self) -> Indices:
        """All other factors."""
        return np.setdiff1d(np.arange(self.levels.shape[1]), self.kept)

    @cached_property
    def _radix(self) -> Indices:
        """Weights (f,) with which the levels of a candidate make one number."""
        sizes = [int(s) for s in self.levels.max(axis=0) + 1]
        weights = [1]
        for size in sizes[:-1]:
            weights.append(weights[-1] * size)
        if weights[-1] * sizes[-1] >= 2**62:
            raise ArgumentError("the factors have too many levels", argument="errors")
        return np.array(weights, dtype=np.int64)

    @cached_property
    def _sorted(self) -> tuple[Indices, Indices]:
        """The numbers of all candidates in rising order, and the candidates in that order."""
        numbers = self.levels @ self._radix
        order = np.argsort(numbers, kind="stable")
        return numbers[order], order

    def find(self, levels: Indices) -> Indices:
        """The candidates (...) of settings (..., f); -1 where there is none."""
        numbers, order = self._sorted
        asked = levels @ self._radix
        at = np.minimum(np.searchsorted(numbers, asked), len(numbers) - 1)
        return np.where(numbers[at] == asked, order[at], -1)

    @cached_property
    def _first(self) -> tuple[Indices, Indices]:
        """Of each setting of the kept factors its number, rising, and its first candidate."""
        numbers = self.levels[:, self.kept] @ self._radix[self.kept]
        found, firsts = np.unique(numbers, return_index=True)
        return found, firsts

    def first_with(self, levels: Indices) -> Indices:
        """A candidate (...) with the kept factors of settings (..., f); -1 where there is none."""
        numbers, firsts = self._first
        asked = levels[..., self.kept] @ self._radix[self.kept]
        at = np.minimum(np.searchsorted(numbers, asked), len(numbers) - 1)
        return np.where(numbers[at] == asked, firsts[at], -1)

    def slices(self, columns: Indices) -> list[Indices]:
        """The candidates of each setting of some factors."""
        if not len(columns):
            return [np.arange(len(self.levels))]
        numbers = self.levels[:, columns] @ self._radix[columns]
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order])) + 1
        return np.split(order, starts)

    def alternatives(self, move: Move, places: Indices) -> Indices:
        """The candidates (b, S, k) that a move puts at its runs of plans (b, m).

        Other factors keep their settings. Where no such candidate is there, and several runs move
        together, another one with the new setting takes the place; -1 where there is none.
        """
        old = self.levels[places[:, move.runs]]
        new = np.repeat(old[:, None], len(move.options), axis=1)
        new[..., move.columns] = move.options[None, :, None, :]
        found = self.find(new)
        if len(move.runs) > 1:
            found = np.where(found < 0, self.first_with(new), found)
        return found

    def moves(self, m: int) -> list[Move]:
        """All moves of m runs: of groups of each stratum, then of single runs."""
        found = []
        for labels, columns in zip(self.labels, self.hard, strict=True):
            if len(columns):
                for group in range(labels.max() + 1):
                    found += self._moves(np.flatnonzero(labels == group), columns)
        if len(self.easy):
            for run in range(m):
                found += self._moves(np.array([run]), self.easy)
        return found

    def _moves(self, runs: Indices, columns: Indices) -> list[Move]:
        """Moves of some factors together, or one after the other where settings are many."""
        options = np.unique(self.levels[:, columns], axis=0)
        if len(options) <= SETTINGS_TOGETHER or len(columns) == 1:
            return [Move(runs, columns, options)]
        return [
            Move(runs, columns[i : i + 1], np.unique(self.levels[:, columns[i]])[:, None])
            for i in range(len(columns))
        ]

    def may_swap(self, places: Indices, run: int) -> Mask:
        """Which runs (b, m) have the kept settings of one, so that both may change places."""
        kept = self.levels[places][..., self.kept]
        return np.asarray((kept == kept[:, [run]]).all(axis=-1))

    def drawn(
        self,
        rng: np.random.Generator,
        m: int,
        first: Indices = NO_RUNS,
        most: Indices | None = None,
    ) -> Indices | None:
        """Draw the candidates (m,) of a plan; None where a drawn setting of a run does not exist.

        A run is drawn from what its groups have; the first one of a group sets what the group has.

        Args:
            rng: Random numbers.
            m: Number of runs.
            first: The candidates (k,) of the first runs, which are given.
            most: How often each candidate may be used (n,); None for no limit.
        """
        places = np.full(m, -1)
        places[: len(first)] = first
        free = np.ones(len(self.levels), dtype=bool)
        fits = np.ones((m, len(self.levels)), dtype=bool) if len(self.kept) else None
        order = rng.permutation(m)
        for run in np.concatenate([np.arange(len(first)), order[order >= len(first)]]):
            if most is not None:
                free = np.bincount(places[places >= 0], minlength=len(most)) < most
            if places[run] < 0:
                allowed = np.flatnonzero(free if fits is None else free & fits[run])
                if not len(allowed):
                    return None
                if fits is None:
                    places[run] = allowed[rng.integers(len(allowed))]
                else:
                    places[run] = self._one_of(rng, allowed)
            if fits is None:
                continue
            for labels, columns in zip(self.labels, self.hard, strict=True):
                if not len(columns):
                    continue
                same = (self.levels[:, columns] == self.levels[places[run], columns]).all(axis=1)
                fits[labels == labels[run]] &= same
        return places

    def at_odds(self, first: Indices) -> tuple[int, int] | None:
        """Two of the first runs that are of one group and do not have its settings in common."""
        for labels, columns in zip(self.labels, self.hard, strict=True):
            own = self.levels[first][:, columns]
            for run in range(len(first)):
                leader = int(np.flatnonzero(labels == labels[run])[0])
                if (own[run] != own[leader]).any():
                    return leader, run
        return None

    def _one_of(self, rng: np.random.Generator, allowed: Indices) -> int:
        """One of some candidates: each setting of the kept factors is as likely."""
        numbers = self.levels[allowed][:, self.kept] @ self._radix[self.kept]
        chosen = rng.choice(np.unique(numbers))
        return int(rng.choice(allowed[numbers == chosen]))


def _kept(stratum: Stratum, problem: Problem, named: dict[str, Indices]) -> tuple[str, ...]:
    """Names of the factors that the groups of a stratum keep; labels become a factor.

    Raises:
        ArgumentError: There is no such factor.
    """
    if stratum.hard is None:
        return ()
    names = hard_names(stratum.hard)
    labels = np.asarray(stratum.hard)
    if names == ("setting",) and labels.dtype.kind not in "US":
        if len(labels) != problem.n:
            message = f"expected names of columns, or a label for each of {problem.n} candidates"
            raise ArgumentError(message, argument="hard")
        named[f"setting of a {stratum.name}"] = _numbered(labels)
        return (f"setting of a {stratum.name}",)
    unknown = [name for name in names if name not in named]
    if unknown:
        there = ", ".join(named) if named else "none, and takes labels (n,) of its candidates"
        message = f"there is no factor {unknown[0]!r}; the problem has {there}"
        raise ArgumentError(message, argument="hard")
    return names


def _numbered(values: Array) -> Indices:
    """Equal values, or rows of values, by one number each."""
    axis = 0 if values.ndim > 1 else None
    if values.dtype == object:
        values = np.array([str(value) for value in values])
    return np.unique(values, axis=axis, return_inverse=True)[1].reshape(-1)


def _ranks(hard: list[Indices], n: int) -> Indices:
    """The number of a candidate among those of the same kept settings."""
    if not hard:
        return np.arange(n)
    numbers = _numbered(np.stack(hard, axis=1))
    order = np.argsort(numbers, kind="stable")
    starts = np.concatenate([[0], np.flatnonzero(np.diff(numbers[order])) + 1])
    ranks = np.arange(n) - np.repeat(starts, np.diff(np.append(starts, n)))
    found = np.empty(n, dtype=int)
    found[order] = ranks
    return found
