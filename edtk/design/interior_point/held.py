"""Descents where instruments are read in some poses only: each holds what its start reads.

What an experiment tells jumps where a marker is lost. With the information ``f_S`` of a set S of
markers, which grows with S, and those ``R(x)`` that are read in x,

    f(x) = f_{R(x)}(x) = max {f_S(x) : S within R(x)},

so that the best experiment is the best of those of all sets: ``max f_S(x)`` over the poses that
read all of S, whose conditions are smooth constraints. A descent keeps the set of its start;
exchanges and other starts have other sets. The set is a variable that does not move.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.cell.sight import Sight
from edtk.design.design_space import Points, Space
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class HeldSpace:
    """A space whose last variable says which instruments count: the sum of ``2^i`` over them.

    Attributes:
        base: The space.
        instruments: Number of instruments.
    """

    base: Space
    instruments: int

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v + 1)."""
        return np.concatenate([self.base.limits, [[0.0], [2.0**self.instruments]]], axis=1)

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change."""
        return self.base.movable

    @property
    def prior(self) -> Array | None:
        """Prior information M0 (p, p) of the base."""
        return self.base.prior

    @property
    def sight(self) -> Sight | None:
        """Nothing switches."""
        return None

    def at(self, x: Array, held: Mask | None = None) -> Points:
        """The experiments (..., v + 1) that read what their last variable says."""
        sets = np.rint(x[..., -1]).astype(np.int64)
        every = np.arange(self.instruments).reshape(-1, *[1] * sets.ndim)
        return self.base.at(x[..., :-1], (sets >> every & 1).astype(bool))


def with_fewer(space: Space, x: Array) -> tuple[HeldSpace, Array, Indices] | None:
    """Experiments x (b, v) that need not read one of the instruments that they read.

    Without a marker a pose may go farther than its condition lets it.

    Returns:
        A space in which they hold the others, these experiments (c, v + 1), and of which of x each
        is (c,); None where all is read everywhere, or no experiment reads two.
    """
    if space.sight is None:
        return None
    seen = space.sight.seen(x[..., : space.sight.robot.n])
    seeable = np.array([one is not None for one in space.sight.reflectors])
    of, dropped = np.nonzero(seen & seeable & (seen.sum(axis=1) > 1)[:, None])
    if not len(of):
        return None
    sets = seen[of] @ 2.0 ** np.arange(seen.shape[1]) - 2.0**dropped
    held = np.concatenate([x[of], sets[:, None]], axis=1)
    return HeldSpace(space, seen.shape[1]), held, of


def holding(space: Space, x: Array) -> tuple[Space, Array]:
    """A space in which experiments x (..., v) keep reading what they read, and these in it.

    Both themselves where all is read everywhere.
    """
    if space.sight is None:
        return space, x
    seen = space.sight.seen(x[..., : space.sight.robot.n])
    sets = seen @ 2.0 ** np.arange(seen.shape[-1])
    return HeldSpace(space, seen.shape[-1]), np.concatenate([x, sets[..., None]], axis=-1)
