"""What positions in a pose tell of geometry and springs: the rows of the regressor."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.calibration.geometry.study_geometry import StudyLoads
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.geometry.nominal_columns import NominalColumns, PlacedColumns
from edtk.system.typing import Array

MM = 1e3
BLOCK = 1024  # poses at once: their arrays fit into a core's cache
STEP = 1e-5  # of a joint [rad or m]: central differences are then good to ten digits


@dataclass(frozen=True, eq=False)
class PositionRows:
    """How positions of all markers move with the parameters, at the geometry of the drawing.

    With the noise of a pose they are whitened: ``L^-1 J`` of its covariance ``L L'``.

    Args:
        model: Markers and parameters.
        loads: What loads the joints; None without springs.
        noise: The errors of a pose; None for rows in millimetres.
    """

    model: GeometricModel
    loads: StudyLoads | None
    noise: PositionNoise | None = None

    @cached_property
    def columns(self) -> NominalColumns:
        """Where columns and slopes come from."""
        return NominalColumns(self.model)

    @cached_property
    def scales(self) -> Array:
        """Millimetres that a metre by one unit of each parameter is (p,)."""
        return MM * self.model.scales

    @property
    def is_white(self) -> bool:
        """Whether the errors of all coordinates are independent and alike."""
        noise = self.noise
        return noise is None or not (np.any(noise.joints) or np.any(noise.model_joints))

    @property
    def _sigma(self) -> float:
        """Their standard deviation [mm]; one without noise."""
        return (
            1.0
            if self.noise is None
            else float(np.hypot(self.noise.reading, self.noise.model_white))
        )

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Rows (m, 3k, p), in millimetres (or in units of the noise) for a unit of each parameter.

        Args:
            q: Poses (m, n) [rad or m].
            wrench: Their forces and torques (m, 6) [N, N m].
        """
        found = np.empty((len(q), 3 * len(self.model.markers), self.model.p))
        for first in range(0, len(q), BLOCK):
            part = slice(first, first + BLOCK)
            found[part] = self._block(q[part], wrench[part])
        return found

    def slopes(self, q: Array, wrench: Array, B: Array) -> Array:
        """Derivatives (m, n) of ``<B, rows>`` by the joints, weights B (m, 3k, p) held fixed."""
        found = np.empty(q.shape)
        for first in range(0, len(q), BLOCK):
            part = slice(first, first + BLOCK)
            own = self._slope if self.is_white else self._difference
            found[part] = own(q[part], wrench[part], B[part])
        return found

    def _block(self, q: Array, wrench: Array) -> Array:
        """The rows of a block of poses."""
        placed = self.columns.at(q)
        J = placed.jacobian(self._torque(q, wrench)).reshape(self.model.p, -1, len(q))
        rows = np.moveaxis(J, (0, 1), (2, 1)) * self.scales
        if self.is_white:
            return np.asarray(rows / self._sigma)
        return self._whitened(rows, placed)

    def _whitened(self, rows: Array, placed: PlacedColumns) -> Array:
        """Rows (m, r, p) in units of correlated noise."""
        assert self.noise is not None
        n = len(placed.by_joints)
        motion = np.moveaxis(placed.by_joints.reshape(n, rows.shape[1], -1), (0, 1), (2, 1))
        V = self.noise.of_reading(motion) + self.noise.of_model(motion)
        return np.asarray(np.linalg.solve(np.linalg.cholesky(V), rows))

    def _torque(self, q: Array, wrench: Array) -> Array | None:
        """Loads (n, m) of the free joints, whose springs have not given way."""
        return None if self.loads is None else self.loads(q, wrench).T

    def _slope(self, q: Array, wrench: Array, B: Array) -> Array:
        """The derivatives of a block of poses, where noise is white."""
        k = len(self.model.markers)
        weights = np.moveaxis(B * (self.scales / self._sigma), (2, 1), (0, 1))
        weights = weights.reshape(self.model.p, k, 3, len(q))
        by_motion, by_torque = self.columns.at(q).slope(weights, self._torque(q, wrench))
        if self.loads is None:
            return by_motion.T
        return np.asarray(by_motion.T + self.loads.slope(q, wrench, by_torque.T))

    def _difference(self, q: Array, wrench: Array, B: Array) -> Array:
        """The same where noise changes with the pose."""
        found = np.empty(q.shape)
        for j in range(q.shape[1]):
            step = np.zeros(q.shape[1])
            step[j] = STEP
            change = self._block(q + step, wrench) - self._block(q - step, wrench)
            found[:, j] = np.einsum("mrp,mrp->m", B, change) / (2 * STEP)
        return found
