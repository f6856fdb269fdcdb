"""Feasible candidate poses with their information, drawn chunk by chunk on every core."""

import os
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.problem import Problem
from edtk.system.time_limit import out_of_time, time_left
from edtk.system.typing import Array, Indices

# Poses that hold all but the cell's constraint, of which none is free, when nobody looks for more:
# with fewer free ones, thousands of candidates would take hours.
NONE_FREE = 4096
POSES_IN_THE_WAY = 200  # poses that tell which bodies are in the way
IN_ANY_TIME = 10_000  # candidates that are drawn whatever the time: they take a moment
# Samples that a thread evaluates at once: their arrays fit into a core's cache.
SAMPLES_AT_ONCE = 16384


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate experiments and the information of one measurement in each.

    Attributes:
        x: Design variables (n, v).
        problem: Their information, in the same order.
    """

    x: Array
    problem: Problem

    def __getitem__(self, chosen: Indices) -> "Candidates":
        """The chosen candidates."""
        return Candidates(self.x[chosen], self.problem[chosen])

    def __add__(self, others: "Candidates") -> "Candidates":
        """These candidates, then others."""
        return Candidates(np.concatenate([self.x, others.x]), self.problem + others.problem)


Sampling = Literal["random", "sobol"]


class EmptyFeasibleSetError(ValueError):
    """No pose satisfies all constraints, as far as sampling can tell.

    Attributes:
        samples: Number of samples that were drawn.
        constraint: Name of the constraint that excludes most of them.
        share: The part of the samples that this constraint excludes.
    """

    key = "workspace"  # of a study, which says what excludes them

    def __init__(self, samples: int, constraint: str, share: float) -> None:
        super().__init__(samples, constraint, share)
        self.samples = samples
        self.constraint = constraint
        self.share = share

    def __str__(self) -> str:
        return (
            f"no feasible pose among {self.samples} samples; the constraint '{self.constraint}' "
            f"excludes {100 * self.share:.0f} % of them"
        )


class NothingFreeError(EmptyFeasibleSetError):
    """Poses hold all other constraints, and each of them touches something in the cell.

    Args:
        poses: Number of poses.
        first: Name of a body of the pair that is nearest most often.
        second: Name of the other one.
        often: The part of the poses in which it is.
    """

    key = "scene"

    def __init__(self, poses: int, first: str, second: str, often: float) -> None:
        super().__init__(poses, f"clearance of {first} and {second}", often)
        self.first = first
        self.second = second

    def __str__(self) -> str:
        return (
            f"no pose is free: each of {self.samples} that hold all other constraints touches "
            f"something; {self.first} and {self.second} are nearest in {100 * self.share:.0f} % of "
            "them"
        )


@dataclass(frozen=True, eq=False)
class CandidateSource:
    """An endless, repeatable sequence of feasible poses, of which the first n are the candidates.

    Points of the unit cube, random or of Sobol's sequence (scrambled), are stretched to the limits
    of the free joints; those outside the workspace are dropped. Threads evaluate chunks side by
    side and deliver them in the order of their points, so that the sequence depends on the seed
    and not on the machine.

    Args:
        space: Model, feasible set, free joints, noise and loads.
        seed: Seed, one number or several.
        sampling: "random" or "sobol".
        workers: Number of threads; defaults to one a core.
        patience: Chunks of 16384 samples to draw at most before the first feasible pose.

    Raises:
        ValueError: The sampling is unknown.
    """

    space: DesignSpace
    seed: int | tuple[int, ...] = 0
    sampling: Sampling = "random"
    workers: int | None = None
    patience: int = 12

    def __post_init__(self) -> None:
        known = get_args(Sampling)
        if self.sampling not in known:
            raise ValueError(f"sampling must be one of {', '.join(known)}, not {self.sampling!r}")

    def take(self, n: int, in_time: bool = False) -> Candidates:
        """Draw the first n candidates.

        Args:
            n: Number of candidates.
            in_time: Whether those that are drawn when the time is over (`time_limit`) are enough,
                if they are `IN_ANY_TIME` at least.

        Raises:
            EmptyFeasibleSetError: No feasible pose turns up; names the constraint.
            ValueError: n < 1.
        """
        require_some(n)
        x = np.empty((n, self.space.size))
        told = np.empty(0)
        start = 0
        with closing(self._told_chunks(n)) as chunks:
            for chunk in chunks:
                if not start:
                    # In the order of memory that the space has: a transposition of a million rows
                    # would take longer than to compute them.
                    told = np.empty_like(chunk.told, shape=(*chunk.told.shape[:-1], n))
                end = start + len(chunk.x)
                x[start:end] = chunk.x
                told[..., start:end] = chunk.told
                start = end
                if in_time and start >= IN_ANY_TIME and out_of_time():
                    break
        return Candidates(x[:start], self.space.problem_of(told[..., :start]))

    def chunks(self, n: int) -> Generator[Candidates, None, None]:
        """Draw the first n candidates in chunks, none of which is empty.

        Raises:
            EmptyFeasibleSetError: No feasible pose turns up; names the constraint.
            ValueError: n < 1.
        """
        with closing(self._told_chunks(n)) as chunks:
            for chunk in chunks:
                yield Candidates(chunk.x, self.space.problem_of(chunk.told))

    def stretch(self, first: int, number: int) -> Iterator[Candidates]:
        """The feasible poses of some full chunks of samples, one after another in this thread.

        Those of all stretches together are the sequence of `chunks`; empty ones are left out.

        Args:
            first: Index of the first chunk.
            number: Number of chunks.
        """
        cubes = self._cubes(SAMPLES_AT_ONCE, first)
        for _ in range(number):
            chunk = self._evaluate(next(cubes))
            if len(chunk.x):
                yield Candidates(chunk.x, self.space.problem_of(chunk.told))

    def _told_chunks(self, n: int) -> Generator["_Chunk", None, None]:
        """What the first n candidates tell, in chunks."""
        require_some(n)
        # A few candidates do not wait for a full chunk; 2 n samples often hold n feasible ones.
        size = min(SAMPLES_AT_ONCE, 1 << (2 * n).bit_length())
        evaluate = self._parallel if size == SAMPLES_AT_ONCE else self._in_turn
        # Closed here, not when it is dropped: Python swallows a Ctrl-C that comes in a generator's
        # last wait for its threads, where nobody has called that generator.
        with closing(evaluate(size)) as results:
            yield from self._first(n, size, results)

    def _first(self, n: int, size: int, results: Iterable["_Chunk"]) -> Iterator["_Chunk"]:
        """The first n candidates of evaluated chunks of `size` samples."""
        left = n
        samples = 0
        excluded = np.zeros(len(self.space.labels))
        for chunk in results:
            samples += size
            excluded = excluded + chunk.excluded
            found = len(chunk.x)
            # Patience is counted in samples, so that it does not depend on the size of a chunk.
            touching = int(excluded[-1]) if self.space.clear is not None else 0
            if left == n and not found and touching >= NONE_FREE:
                raise self._nothing_free(touching)
            if left == n and not found and samples >= self.patience * SAMPLES_AT_ONCE:
                if touching:
                    raise self._nothing_free(touching)
                worst = int(excluded.argmax())
                share = excluded[worst] / samples
                raise EmptyFeasibleSetError(samples, self.space.labels[worst], share)
            if found:
                yield _Chunk(chunk.x[:left], chunk.told[..., :left], chunk.excluded)
                left -= found
            if left <= 0:
                return

    def _nothing_free(self, poses: int) -> "NothingFreeError":
        """The error where all of some poses that hold the other constraints touch something."""
        assert self.space.clear is not None
        x = self.without_cell.take(min(poses, POSES_IN_THE_WAY)).x
        found = self.space.clear.cell.clearance(x[:, : len(self.space.fixed)])
        often = np.bincount(found.pair, minlength=len(found.pairs))
        first, second = found.pairs[int(often.argmax())]
        return NothingFreeError(poses, first, second, float(often.max() / len(x)))

    @property
    def without_cell(self) -> "CandidateSource":
        """The same sequence with the poses that touch something in the cell."""
        return replace(self, space=self.space.without_cell)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The numbers of the seed, of any size."""
        seed = self.seed
        return (int(seed),) if isinstance(seed, int | np.integer) else tuple(map(int, seed))

    def _cubes(self, size: int, first: int = 0) -> Iterator[Array]:
        """Points of the unit cube (size, drawn), without end, from a chunk on.

        The sequence of points does not depend on the size of the chunks.
        """
        bits = np.random.PCG64(self.seed)
        rng = np.random.Generator(bits)
        dimension = len(self.space.drawn)
        if self.sampling == "random":
            bits.advance(first * size * dimension)  # a point takes a number for each variable
            while True:
                yield rng.random((size, dimension))
        from scipy.stats import qmc  # takes half a second, which random points need not pay

        sobol = qmc.Sobol(dimension, rng=rng)
        if first:
            sobol.fast_forward(first * size)
        while True:
            yield sobol.random(size)

    def _in_turn(self, size: int) -> Generator["_Chunk", None, None]:
        """Evaluate all chunks in order, none ahead of the consumer."""
        yield from map(self._evaluate, self._cubes(size))

    def _parallel(self, size: int) -> Generator["_Chunk", None, None]:
        """Evaluate all chunks in order, a few chunks ahead of the consumer."""
        workers = self.workers or os.cpu_count() or 1
        # Two chunks a thread keep all threads busy; more would only take memory. Where time is
        # short, those that are ahead when it ends are lost.
        ahead = (2 if np.isinf(time_left()) else 1) * workers
        waiting: deque[Future[_Chunk]] = deque()
        with ThreadPoolExecutor(workers) as pool:
            try:
                for cube in self._cubes(size):
                    waiting.append(pool.submit(self._evaluate, cube))
                    if len(waiting) > ahead:
                        yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def _evaluate(self, cube: Array) -> "_Chunk":
        """Evaluate the points of one chunk."""
        # Whether a pose is free takes longest: it is asked of those alone that hold the rest.
        drawn = self.space.without_cell.at(self.space.draw(cube))
        inside = drawn.slack >= 0
        excluded = (~inside).sum(axis=0)
        feasible = drawn[np.flatnonzero(inside.all(axis=-1))]
        if self.space.clear is not None:
            free = self.space.clear.slack(feasible.frames)[0] >= 0
            excluded = np.append(excluded, (~free).sum())
            feasible = feasible[np.flatnonzero(free)]
        return _Chunk(feasible.x, self.space.told(feasible), excluded)


@dataclass(frozen=True, eq=False)
class _Chunk:
    """The feasible experiments of a chunk.

    Attributes:
        x: Design variables (n, v).
        told: What they tell, as `DesignSpace.told` has it (..., n).
        excluded: Number of samples that each constraint (c,) excludes.
    """

    x: Array
    told: Array
    excluded: Indices


def require_some(n: int) -> None:
    """Check that a number of candidates is at least one.

    Raises:
        ValueError: n < 1.
    """
    if n < 1:
        raise ValueError("at least one candidate is needed")


def sample_feasible(space: DesignSpace, n: int, seed: int | tuple[int, ...]) -> Array:
    """Draw n feasible experiments (n, v), uniform within the bounds.

    Raises:
        EmptyFeasibleSetError: No feasible pose turns up; names the constraint.
        ValueError: n < 1.
    """
    return np.concatenate([chunk.x for chunk in CandidateSource(space, seed).chunks(n)])
