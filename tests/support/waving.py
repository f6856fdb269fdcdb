"""A made-up measurement of points that swing with the joints: derivatives in closed form."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Waving:
    """Rows ``y_r(q) = sum_k size_rk sin(q_k + phase_rk)``; markers are the rows by threes.

    Attributes:
        size: Amplitudes (rows, n) [m].
        phase: Phases (rows, n) [rad].
    """

    size: Array
    phase: Array

    def at(self, q: Array) -> Any:
        """Frames of poses q (..., n)."""
        return SimpleNamespace(q=np.moveaxis(np.asarray(q, dtype=float), -1, 0))

    def _angle(self, frames: Any) -> Array:
        """Arguments (n, rows, ...) of the sines."""
        lift = (...,) + (None,) * (frames.q.ndim - 1)
        return np.asarray(frames.q[:, None] + self.phase.T[lift])

    def _sizes(self, frames: Any) -> Array:
        return self.size.T[(...,) + (None,) * (frames.q.ndim - 1)]

    def points_of(self, frames: Any) -> Array:
        """Positions (markers, 3, ...)."""
        rows = (self._sizes(frames) * np.sin(self._angle(frames))).sum(axis=0)
        whole = 3 * (len(rows) // 3)
        return np.asarray(rows[:whole].reshape(-1, 3, *rows.shape[1:]))

    def motion_of(self, frames: Any) -> Array:
        """dy/dq (n, rows, ...)."""
        return np.asarray(self._sizes(frames) * np.cos(self._angle(frames)))

    def motion_slope_of(self, frames: Any, B: Array) -> Array:
        """Derivatives (n, ...) of <B, dy/dq>."""
        return -np.asarray((B * self._sizes(frames) * np.sin(self._angle(frames))).sum(axis=1))


def waving(rows: int, n: int, seed: int) -> Waving:
    """A random one."""
    rng = np.random.default_rng(seed)
    return Waving(rng.uniform(0.2, 1.0, (rows, n)), rng.uniform(-3, 3, (rows, n)))
