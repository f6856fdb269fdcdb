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

    def gains(self, causes: Sequence[Array]) -> list[float]:
        """How much better the fit is with the columns (m, 3k, c) of each cause, to compare them.

        It is what the weighted squares fall by, less ``c log n`` for c columns (Schwarz 1978), with
        the noise that is fitted beside the columns of all causes.
        """
        if not causes:
            return []
        noise = self.noise_beside(np.concatenate(list(causes), axis=-1))
        z, X, *columns = self.whitened(noise, self.residual[..., None], self.design, *causes)
        cost = np.log(max(self.dof(0), 2))
        return [explained_by(z, X, one).fall - one.shape[-1] * cost for one in columns]

    def whitened(self, noise: PositionNoise | None, *columns: Array) -> list[Array]:
        """Columns (m, 3k, c) in units of a noise; all coordinates alike where there is none."""
        V = (noise or self.noise).of_pose(self.motion, self.fit.data.counts)
        if noise is None:
            size = np.einsum("mrr->", V) / V[..., 0].size
            alike = np.broadcast_to(size * np.eye(V.shape[1]), V.shape)
            V = only_seen(alike, self.fit.data.means.seen)
        L = np.linalg.cholesky(V)
        return [np.asarray(np.linalg.solve(L, one)) for one in columns]


@dataclass(frozen=True, eq=False)
class Explained:
    """What columns explain beside those of a fit.

    Attributes:
        values: Their coefficients (c,).
        std: Standard deviations (c,) of these, where the errors have the size one.
        fall: What the squares fall by.
        share: Share of the squares that this is.
    """

    values: Array
    std: Array
    fall: float
    share: float


def explained_by(residual: Array, design: Array, columns: Array) -> Explained:
    """What columns explain of residuals; all (m, 3k, c) in units of the noise."""
    z, X, C = (one.reshape(-1, one.shape[-1]) for one in (residual, design, columns))
    Q = np.linalg.qr(X)[0]
    z, C = z - Q @ (Q.T @ z), C - Q @ (Q.T @ C)
    inverse = np.linalg.pinv(C.T @ C, hermitian=True)
    values = inverse @ (C.T @ z)
    total = float((z**2).sum())
    fall = total - float(((z - C @ values) ** 2).sum())
    return Explained(values[:, 0], np.sqrt(np.diag(inverse)), fall, fall / max(total, 1e-300))


def log_chance(share: float, count: int, dof: float) -> float:
    """Logarithm of the probability that so many columns explain such a share by chance."""
    from scipy.stats import f

    return float(f.logsf(share / max(1 - share, 1e-12) * dof / count, count, dof))


def of_positions(columns: Array, means: MarkerPositions) -> Array:
    """Columns (m, 3k, c) of the positions, from those (m, k, r, c) of all that is measured.

    Rows of what was not seen are zero.
    """
    there = means.seen[..., None, None]
    found = np.where(there, columns[:, :, :3], 0.0)
    return np.asarray(found.reshape(len(columns), -1, columns.shape[-1]))
