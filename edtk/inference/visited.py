"""Residuals of visits in units of the tracker's noise, with what joints and model add to them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """The coordinates of one pose, N of them, whatever visits and markers they are of.

    Attributes:
        residual: Whitened residuals (N,).
        Q: Orthonormal columns (N, p) of the regressors of all poses.
        motion: Motions (N, n) by errors of the joints that all visits share.
        apart: The same by errors of each visit (N, n visits).
        shared: Displacements (N, lengths places) of each marker that all visits share.
    """

    residual: Array
    Q: Array
    motion: Array
    apart: Array
    shared: Array


@dataclass(frozen=True, eq=False)
class Visited:
    """Measurements, each in a visit of a pose, in units of the tracker's noise.

    Attributes:
        residual: Whitened residuals (m, rows) of the least-squares fit.
        Q: Orthonormal columns (m, rows, p) of its regressors.
        motion: Whitened derivatives (m, rows, n) by the joints, times the standard deviations that
            the joints have for a variance of one.
        pose: Number (m,) of each row's pose and load, from 0.
        visit: Number (m,) of its visit, from 0.
        place: Number (m,) of its pose, load and marker, from 0.
        unit: What a unit of each length of a measurement is, whitened (m, rows, lengths) [1/m].
    """

    residual: Array
    Q: Array
    motion: Array
    pose: Indices
    visit: Indices
    place: Indices
    unit: Array

    def poses(self) -> Iterator[PoseErrors]:
        """The poses, one after another."""
        order = np.argsort(self.pose, kind="stable")
        for rows in np.split(order, np.cumsum(np.bincount(self.pose))[:-1]):
            motion = self.motion[rows]
            N = motion.shape[0] * motion.shape[1]
            yield PoseErrors(
                self.residual[rows].reshape(N),
                self.Q[rows].reshape(N, -1),
                motion.reshape(N, -1),
                _apart(motion, self.visit[rows]).reshape(N, -1),
                _apart(self.unit[rows], self.place[rows]).reshape(N, -1),
            )


def _apart(columns: Array, number: Indices) -> Array:
    """Columns (m, rows, c groups): those of each group of rows, zero in the others."""
    of_group = number == np.unique(number)[:, None]
    return np.concatenate([columns * chosen[:, None, None] for chosen in of_group], axis=-1)
