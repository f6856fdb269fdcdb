"""Whether the frame of the instrument moved between two poses, by the residuals of a fit."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.model.geometry.all_parameters import all_parameters
from edtk.system.typing import Array

FEWEST = 4  # poses before and after
UNLIKELY = 1e-6
EXPLAINS = 0.2  # of the squares, at least: a drift of the floor explains less


@dataclass(frozen=True, eq=False)
class MovedFrame:
    """A motion of the frame that explains a good part of the residuals.

    Attributes:
        pose: The first pose (of the means, in order of the file) after it.
        shift: How far positions are off after it, root mean square [m].
        explained: Share of the squared residuals that it explains.
    """

    pose: int
    shift: float
    explained: float


def moved_frame(fit: GeometricFit) -> MovedFrame | None:
    """Try a rigid motion of the frame before each pose, and test the best.

    The motion has six parameters, whose columns B count from pose s on. With residuals z of the fit
    and its columns X, both weighted, the squares fall by ``g' (B'B - B'X (X'X)^-1 X'B)^-1 g`` with
    ``g = B'z``; sums from the end of the day give this for all s at once. The ratio to what is left
    has Fisher's distribution for one s; the smallest probability counts as often as poses are.

    Args:
        fit: Of a sheet whose poses are in the order in which they were measured.
    """
    z, X, B = _weighted(fit)
    m = len(z)
    p = X.shape[-1]
    coordinates = int(np.isfinite(fit.residual).sum())
    dof = coordinates - p - 6
    if m < 2 * FEWEST or dof < FEWEST:
        return None
    H = np.linalg.pinv(np.einsum("mrp,mrq->pq", X, X), hermitian=True)
    # The fit has other weights, so that something is left along its own columns.
    z = z - X @ (H @ np.einsum("mrp,mr->p", X, z))
    gradient = _from_end(np.einsum("mri,mr->mi", B, z))
    square = _from_end(np.einsum("mri,mrj->mij", B, B))
    cross = _from_end(np.einsum("mrp,mri->mpi", X, B))
    inner = square - np.einsum("mpi,pq,mqj->mij", cross, H, cross, optimize=True)
    total = float((z**2).sum())
    best: tuple[float, int, Array] | None = None
    for s in range(FEWEST, m - FEWEST + 1):
        motion = np.linalg.pinv(inner[s], rcond=1e-8, hermitian=True) @ gradient[s]
        fall = float(gradient[s] @ motion)
        if best is None or fall > best[0]:
            best = (fall, s, motion)
    if best is None:
        return None
    return _judged(fit, best, total, dof, m)


def _judged(
    fit: GeometricFit, best: tuple[float, int, Array], total: float, dof: int, m: int
) -> MovedFrame | None:
    """The motion, where chance does not explain it."""
    from scipy.stats import f

    fall, s, motion = best
    left = max(total - fall, 1e-300)
    # Coordinates of a pose err together: as many poses as coordinates over three are independent.
    probability = float(f.sf((fall / 6) / (left / dof), 6, max(dof / 3, 1.0)))
    if probability * m > UNLIKELY or fall < EXPLAINS * total:
        return None
    model = fit.fitted.model
    means = fit.data.means
    base = model.with_parameters(all_parameters(model.robot, model.markers, [], tool=False))
    J = base.see(np.zeros(6), means.q[s:]).jacobian
    assert J is not None
    off = (J * base.scales) @ motion
    size = float(np.sqrt((off**2).sum(axis=-1).mean()))
    return MovedFrame(s, size, fall / total)


def _weighted(fit: GeometricFit) -> tuple[Array, Array, Array]:
    """Residuals (m, r), columns (m, r, p) and those of the base (m, r, 6), in the fit's noise."""
    fitted = fit.fitted
    model = fitted.model
    means = fit.data.means
    seen = model.see(fitted.theta, means.q)
    base = model.with_parameters(all_parameters(model.robot, model.markers, [], tool=False))
    of_base = base.see(np.zeros(6), means.q)
    assert seen.jacobian is not None
    assert seen.by_joints is not None
    assert of_base.jacobian is not None
    m, k = means.seen.shape
    there = means.seen[..., None, None]
    motion = seen.by_joints.reshape(m, 3 * k, -1)
    V = fitted.noise.of_pose(motion, fit.data.counts)
    L = np.linalg.cholesky(V)
    X = MM * np.where(there, seen.jacobian * model.scales, 0.0).reshape(m, 3 * k, -1)
    B = MM * np.where(there, of_base.jacobian * base.scales, 0.0).reshape(m, 3 * k, -1)
    z = MM * np.nan_to_num(fit.residual).reshape(m, 3 * k, 1)
    return (
        np.linalg.solve(L, z)[..., 0],
        np.linalg.solve(L, X),
        np.linalg.solve(L, B),
    )


def _from_end(terms: Array) -> Array:
    """Sums (m, ...) of all terms from each one to the last."""
    return np.asarray(np.cumsum(terms[::-1], axis=0)[::-1])
