"""Whether a weight that the study does not know bends the robot, by the residuals of a fit."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.geometry.fit_rows import FitRows
from edtk.inference.geometry.geometric_fit import GeometricFit
from edtk.system.typing import Array

UNLIKELY = 1e-4
EXPLAINS = 0.5  # of the squares, at least: gears that are not round explain less
COORDINATES = 3.0  # of a pose that err together
SURE = 2.0  # standard deviations by which a joint gives way
SAME = 1e-6  # [m] a load that changes less from pose to pose tells nothing


@dataclass(frozen=True)
class UntoldLoad:
    """A weight that explains a good part of the residuals.

    Attributes:
        joints: Names of the joints that give way.
        explained: Share of the squared residuals that this explains.
    """

    joints: tuple[str, ...]
    explained: float


def untold_load(fit: GeometricFit) -> UntoldLoad | None:
    """Try springs of all joints under a weight at the tool, and test those that give way.

    A weight W turns joint j by ``k_j W t_j(q)``, with t_j the torque of a unit force down at the
    tool: the columns are the motions by the joints times t_j, and ``k_j W`` is not negative. The
    noise is fitted anew beside them (see `moved_frame`), and the fall of the squares has to be
    improbable, and half of them with equal weights. The weight of the links bends joints much the
    same way, so that both are meant.

    Args:
        fit: Of positions without springs among its parameters.
    """
    rows = FitRows.of(fit)
    robot = fit.fitted.model.robot
    frames = robot.frames(fit.data.means.q, ())
    torque = -frames.folded(frames.linear_of_each)[:, 2].T
    loaded = np.flatnonzero(np.ptp(torque, axis=0) > SAME)
    if not len(loaded) or rows.dof(len(loaded)) < len(loaded):
        return None
    bent = rows.motion * torque[:, None]
    noise = rows.noise_beside(bent[..., loaded])
    every = _explained(*rows.whitened(noise, *_parts(rows, bent[..., loaded])))
    giving = loaded[every.values > SURE * every.std]
    if not len(giving):
        return None
    parts = _parts(rows, bent[..., giving])
    found = _explained(*rows.whitened(noise, *parts)).share
    explained = _explained(*rows.whitened(None, *parts)).share
    independent = max(rows.dof(len(giving)) / COORDINATES, 1.0)
    if explained < EXPLAINS or _probability(found, len(giving), independent) > UNLIKELY:
        return None
    return UntoldLoad(tuple(robot.joint_names[j] for j in giving), explained)


@dataclass(frozen=True, eq=False)
class _Explained:
    """What columns explain beside the fit's own: values and deviations (c,), share of squares."""

    values: Array
    std: Array
    share: float


def _parts(rows: FitRows, columns: Array) -> tuple[Array, Array, Array]:
    """Residuals, the fit's columns and others, all (m, 3k, c)."""
    return rows.residual[..., None], rows.design, columns


def _explained(residual: Array, design: Array, columns: Array) -> _Explained:
    """What columns explain of residuals; all (m, 3k, c) in units of the noise."""
    z, X, C = (one.reshape(-1, one.shape[-1]) for one in (residual, design, columns))
    Q = np.linalg.qr(X)[0]
    z, C = z - Q @ (Q.T @ z), C - Q @ (Q.T @ C)
    inverse = np.linalg.pinv(C.T @ C, hermitian=True)
    values = inverse @ (C.T @ z)
    left = float(((z - C @ values) ** 2).sum())
    share = 1 - left / max(float((z**2).sum()), 1e-300)
    return _Explained(values[:, 0], np.sqrt(np.diag(inverse)), share)


def _probability(share: float, count: int, dof: float) -> float:
    """How likely chance lowers the squares by this share."""
    from scipy.stats import f

    return float(f.sf(share / max(1 - share, 1e-12) * dof / count, count, dof))
