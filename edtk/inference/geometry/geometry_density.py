"""The posterior density of geometry and springs, in coordinates that suit a sampler."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.geometry.fit_geometry import NU
from edtk.inference.geometry.fitted_geometry import Loads, resting_torque
from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.inference.geometry.least_squares_fit import least_squares_fit
from edtk.inference.geometry.many_seen import many_seen
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.pose_rows import PoseRows, measured_less_seen
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.system.typing import Array

BLOCK = 3_000_000  # coordinates that are computed at once


@dataclass(frozen=True, eq=False)
class GeometryDensity:
    """Flat on all parameters, times the likelihood of the sheet by the nonlinear model.

    Errors of a pose have the covariance that was fitted, with normal errors or, where the fit was
    robust, with multivariate t ones. Coordinates are those of the normal approximation about the
    largest density: ``theta = mode + root x``, so that x is near a standard normal.

    Attributes:
        model: The identified parameters.
        mode: Where the density is largest (p,), in the parameters' units.
        root: Factor (p, p) of the covariance of the normal approximation, in these units.
        means: The measured poses.
        torque: Loads of the joints (m, n).
        whitening: Matrices (m, k r, k r) that make errors of a pose independent, of size one
            [1/mm, 1/mrad], with the r = 3 coordinates of a marker, or 6 with its orientation.
        nu: Degrees of freedom of t errors; None for normal ones.
    """

    model: GeometricModel
    mode: Array
    root: Array
    means: MarkerPositions
    torque: Array | None
    whitening: Array
    nu: float | None

    @classmethod
    def of(cls, fit: GeometricFit, loads: Loads | None, robust: bool) -> "GeometryDensity":
        """The density of a fit's positions, about its own largest value.

        The fit itself has weights between those of the noise and equal ones; the density has those
        of the noise.
        """
        fitted = fit.fitted
        model = fitted.model
        means = fit.data.means
        torque = resting_torque(fitted.compliances, means.q, means.wrench, loads)
        V = fitted.noise.of_pose(
            PoseRows.of(model, fitted.theta, means, torque).motion, fit.data.counts
        )
        there = np.repeat(means.seen, means.rows, axis=1)[:, :, None]
        whitening = np.linalg.inv(np.linalg.cholesky(V)) * there
        weights = np.sqrt(fit.weights)[:, None, None]
        theta = least_squares_fit(model, fitted.theta, means, torque, whitening * weights).theta
        rows = PoseRows.of(model, theta, means, torque)
        X = (whitening * weights @ rows.design).reshape(-1, model.p)
        R = np.linalg.qr(X, mode="r")
        root = np.linalg.inv(R)
        nu = NU if robust else None
        return cls(model, theta / model.scales, root, means, torque, whitening, nu)

    def parameters(self, x: Array) -> Array:
        """Parameters (..., p) in their units."""
        return np.asarray(self.mode + x @ self.root.T)

    def log_density(self, x: Array) -> Array:
        """Logarithm (n,) of the density of coordinates (n, p), up to a constant."""
        m, k = self.means.seen.shape
        step = max(1, BLOCK // (self.means.rows * m * k))
        parts = [self._squares(x[first : first + step]) for first in range(0, len(x), step)]
        squares = np.concatenate(parts)
        if self.nu is None:
            return np.asarray(-0.5 * squares.sum(axis=1))
        d = self.means.rows * self.means.seen.sum(axis=1)
        return np.asarray(-0.5 * ((self.nu + d) * np.log1p(squares / self.nu)).sum(axis=1))

    def _squares(self, x: Array) -> Array:
        """Squared sizes (n, m) of the errors of the poses."""
        theta = self.parameters(x) * self.model.scales
        seen = many_seen(self.model, theta, self.means.q, self.torque)
        apart = MM * measured_less_seen(self.means, seen)
        z = np.einsum("mrs,nms->nmr", self.whitening, apart.reshape(len(x), len(self.means), -1))
        return np.asarray((z**2).sum(axis=-1))
