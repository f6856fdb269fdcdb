"""Feasible candidate poses with their information, chunk by chunk on every core."""

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from edtk.design.design_space import DesignSpace
from edtk.design.problem import Problem

Array = NDArray[np.float64]
Sampling = Literal["random", "sobol"]
CHUNK = 16384


class EmptyFeasibleSetError(ValueError):
    """No pose satisfies all constraints, as far as sampling can tell."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate poses and the information of one measurement in each.

    Attributes:
        x: Design variables (n, v).
        problem: Their information, in the same order.
    """

    x: Array
    problem: Problem

    def __getitem__(self, chosen: NDArray[np.int_]) -> "Candidates":
        """Some of them."""
        packed = self.problem.packed[:, chosen]
        return Candidates(self.x[chosen], Problem.of_information(packed, self.problem.parameters))

    def __add__(self, others: "Candidates") -> "Candidates":
        """These and others."""
        packed = np.concatenate([self.problem.packed, others.problem.packed], axis=1)
        problem = Problem.of_information(packed, self.problem.parameters)
        return Candidates(np.concatenate([self.x, others.x]), problem)


@dataclass(frozen=True, eq=False)
class CandidateSource:
    """An endless, repeatable sequence of feasible poses: the first n of it are the candidates.

    Points of the unit cube, random or of Sobol's sequence (scrambled), are stretched to the limits of the free
    joints; what the workspace excludes is dropped. Chunks are evaluated side by side in threads and come in the
    order of their points, so that the sequence depends on the seed and not on the machine.

    Args:
        space: Model, feasible set, free joints, noise and wrench.
        seed: Seed, one number or several.
        sampling: "random" or "sobol".
        workers: Number of threads; None for one a core.
        patience: Chunks of 16384 samples to wait for the first feasible pose.

    Raises:
        ValueError: No such sampling.
    """

    space: DesignSpace
    seed: int | tuple[int, ...] = 0
    sampling: Sampling = "random"
    workers: int | None = None
    patience: int = 12

    def __post_init__(self) -> None:
        if self.sampling not in get_args(Sampling):
            raise ValueError(
                f"sampling must be one of {', '.join(get_args(Sampling))}, not {self.sampling!r}"
            )

    def take(self, n: int) -> Candidates:
        """The first n candidates.

        Raises:
            EmptyFeasibleSetError: No feasible pose turns up; names the constraint that excludes most.
            ValueError: n < 1.
        """
        require_some(n)
        x = np.empty((n, self.space.size))
        p = self.space.model.p
        packed = np.empty((p * (p + 1) // 2, n))
        start = 0
        for some, information in self.chunks(n):
            part = slice(start, start + len(some))
            x[part], packed[:, part] = some, information
            start += len(some)
        return Candidates(x, Problem.of_information(packed, self.space.model.parameters))

    def chunks(self, n: int) -> Iterator[tuple[Array, Array]]:
        """The first n candidates in chunks: design variables (m, v), and their information packed (p(p+1)/2, m).

        Raises:
            EmptyFeasibleSetError: No feasible pose turns up; names the constraint that excludes most.
            ValueError: n < 1.
        """
        require_some(n)
        left, drawn = n, 0
        size = min(CHUNK, 1 << (2 * n).bit_length())  # a few candidates need not wait for many
        violated = np.zeros(len(self.space.labels))
        parts = self._parallel(size) if size == CHUNK else map(self._evaluate, self._cubes(size))
        for some, information, outside in parts:
            drawn, violated = drawn + size, violated + outside
            if left == n and not len(some) and drawn >= self.patience * CHUNK:
                worst = int(violated.argmax())
                raise EmptyFeasibleSetError(
                    f"no feasible pose among {drawn} samples; the constraint "
                    f"'{self.space.labels[worst]}' excludes {100 * violated[worst] / drawn:.0f} % of them"
                )
            if len(some):
                yield some[:left], information[:, :left]
                left -= len(some)
            if left <= 0:
                return

    def _cubes(self, size: int) -> Iterator[Array]:
        """Points of the unit cube (size, drawn), for ever; the sequence does not depend on the size."""
        rng, d = np.random.default_rng(self.seed), len(self.space.drawn)
        sobol = qmc.Sobol(d, rng=rng) if self.sampling == "sobol" else None
        while True:
            yield rng.random((size, d)) if sobol is None else sobol.random(size)

    def _parallel(self, size: int) -> Iterator[tuple[Array, Array, Array]]:
        """`_evaluate` of every chunk in order, a few chunks ahead of the consumer."""
        workers = self.workers or os.cpu_count() or 1
        waiting: deque[Future[tuple[Array, Array, Array]]] = deque()
        with ThreadPoolExecutor(workers) as pool:
            try:
                for cube in self._cubes(size):
                    waiting.append(pool.submit(self._evaluate, cube))
                    if len(waiting) > 2 * workers:
                        yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def _evaluate(self, cube: Array) -> tuple[Array, Array, Array]:
        """Feasible experiments of a chunk, their packed information, and how many each constraint excludes."""
        drawn = self.space.at(self.space.draw(cube))
        inside = drawn.slack >= 0
        feasible = drawn[np.flatnonzero(inside.all(axis=-1))]
        return feasible.x, feasible.packed, (~inside).sum(axis=0)


def require_some(n: int) -> None:
    """Refuse fewer than one candidate."""
    if n < 1:
        raise ValueError("at least one candidate is needed")


def sample_feasible(space: DesignSpace, n: int, seed: int | tuple[int, ...]) -> Array:
    """N feasible experiments (n, v), uniform within the bounds.

    Raises:
        EmptyFeasibleSetError: No feasible pose turns up; names the constraint that excludes most.
        ValueError: n < 1.
    """
    return np.concatenate([x for x, _ in CandidateSource(space, seed).chunks(n)])
