"""Residuals and columns of the positions of a fit, to try what else would explain them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.position_noise import (
    PositionNoise,
    fit_model_error,
    only_seen,
)
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.system.typing import Array

DEPENDENT = 1e-8  # singular value of columns of unit length, beside the largest, that is rounding


@dataclass(frozen=True, eq=False)
class FitRows:
    """What the positions of the poses leave, in millimetres; orientations are left aside.

    Rows of what was not seen are zero.

    Attributes:
        fit: The fit.
        residual: Residuals (m, 3k).
        design: Columns (m, 3k, p) of its parameters.
        motion: Motions (m, 3k, n) by the joints [mm/mrad].
        noise: The noise of positions that was fitted.
    """

    fit: GeometricFit
    residual: Array
    design: Array
    motion: Array
    noise: PositionNoise

    @classmethod
    def of(cls, fit: GeometricFit) -> "FitRows":
        """Of a fit."""
        model = fit.fitted.model
        means = fit.data.means
        seen = model.see(fit.fitted.theta, means.q)
        assert seen.jacobian is not None
        assert seen.by_joints is not None
        return cls(
            fit,
            MM * np.nan_to_num(fit.residual).reshape(len(means), -1),
            MM * of_positions(seen.jacobian * model.scales, means),
            of_positions(seen.by_joints, means),
            replace(fit.fitted.noise, turn=None, model_turn=0.0),
        )

    def beside(self, others: Sequence[GeometricParameter]) -> "FitRows":
        """The same, as if other parameters were fitted too: noise and columns are beside theirs.

        Columns are orthonormal then, and as many as the parameters that the poses tell apart.

        Args:
            others: Parameters that are none of the fit; without any, nothing changes.
        """
        if not others:
            return self
        fitted = self.fit.fitted
        means = self.fit.data.means
        every = fitted.model.with_parameters((*fitted.model.parameters, *others))
        theta = np.concatenate([fitted.theta, np.zeros(len(others))])
        jacobian = every.see(theta, means.q).jacobian
        assert jacobian is not None
        columns = MM * of_positions(jacobian * every.scales, means)[..., fitted.model.p :]
        whole = np.concatenate([self.design, columns], axis=-1).reshape(-1, every.p)
        length = np.linalg.norm(whole, axis=0)
        unit = whole / np.where(length > 0, length, 1.0)
        U, sizes, _ = np.linalg.svd(unit, full_matrices=False)
        basis = U[:, sizes > DEPENDENT * sizes[0]]
        design = basis.reshape(*self.design.shape[:2], -1)
        without = replace(self, design=design[..., :0])
        return replace(self, design=design, noise=without.noise_beside(design))

    def dof(self, others: int) -> int:
        """Coordinates that neither the fit nor so many other columns take."""
        return 3 * int(self.fit.data.means.seen.sum()) - self.design.shape[-1] - others

    def noise_beside(self, columns: Array) -> PositionNoise:
        """The noise, fitted beside other columns (m, 3k, c) too, that it may have hidden."""
        joints = self.fit.fitted.model.robot.joints
        slides = np.array([joint.kind == "prismatic" for joint in joints])
        both = np.concatenate([self.design, columns], axis=-1)
        counts = self.fit.data.counts
        return fit_model_error(self.noise, self.motion, counts, self.residual, both, slides)

    def whitened(self, noise: PositionNoise | None, *columns: Array) -> list[Array]:
        """Columns (m, 3k, c) in units of a noise; all coordinates alike where there is none."""
        V = (noise or self.noise).of_pose(self.motion, self.fit.data.counts)
        if noise is None:
            size = np.einsum("mrr->", V) / V[..., 0].size
            alike = np.broadcast_to(size * np.eye(V.shape[1]), V.shape)
            V = only_seen(alike, self.fit.data.means.seen)
        L = np.linalg.cholesky(V)
        return [np.asarray(np.linalg.solve(L, one)) for one in columns]


def of_positions(columns: Array, means: MarkerPositions) -> Array:
    """Columns (m, 3k, c) of the positions, from those (m, k, r, c) of all that is measured.

    Rows of what was not seen are zero.
    """
    there = means.seen[..., None, None]
    found = np.where(there, columns[:, :, :3], 0.0)
    return np.asarray(found.reshape(len(columns), -1, columns.shape[-1]))
