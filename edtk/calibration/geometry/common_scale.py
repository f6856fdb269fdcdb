"""Whether all lengths of a robot come out longer than drawn, together."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.geometry.fit_rows import FitRows, of_positions
from edtk.inference.geometry.fit_variances_of_blocks import fit_variances_of_blocks
from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.model.geometry.all_parameters import all_parameters
from edtk.system.typing import Array

UNLIKELY = 1e-4
LEAST = 1e-4  # [m/m] below it a scale is that of the air's temperature
FEWEST = 6  # parameters of the geometry that show how far from the drawing this robot is


@dataclass(frozen=True)
class CommonScale:
    """A scale by which lengths that were measured are longer than drawn.

    Attributes:
        size: The scale less one [m/m].
        std: Its standard deviation.
    """

    size: float
    std: float


def common_scale(fit: GeometricFit) -> CommonScale | None:
    """Estimate a scale of all lengths, beside errors of the drawing of unknown size, and test it.

    Where all geometry is fitted, lengths take up a scale s of the instrument: they come out as
    ``theta = T d + s t + e``, with the errors d of the drawing, how all of them (T) and a scale (t)
    move the minimal set, and the errors e of the fit, of covariance C. Robots are built with errors
    of either sign: d has two variances, of lengths and of angles, fitted by restricted likelihood,
    and s is that of generalised least squares with ``C + T D T'``. Base and markers are free.

    Args:
        fit: Of a study that asks for all geometry.
    """
    model = fit.fitted.model
    own = np.array([one.place == "joint" for one in model.parameters])
    if own.sum() < FEWEST:
        return None
    means = fit.data.means
    errors = all_parameters(model.robot, model.markers, base=False, tool=False)
    every = model.with_parameters(errors)
    seen = model.see(fit.fitted.theta, means.q)
    jacobian = every.see(np.zeros(every.p), means.q).jacobian
    assert jacobian is not None
    scaled = of_positions(seen.points[..., None], means)  # mm by 1 mm/m
    moved = MM * of_positions(jacobian * every.scales, means)
    columns = np.concatenate([moved, scaled], axis=-1)
    taken = _coefficients(FitRows.of(fit).design, columns)[own]
    turns = np.array([one.turns for one in errors])
    kinds = [K @ K.T for K in (taken[:, :-1][:, ~turns], taken[:, :-1][:, turns])]
    C = fit.fitted.covariance[np.ix_(own, own)]
    y = fit.fitted.values[own]
    t = taken[:, -1]
    found = fit_variances_of_blocks(C[None], [K[None] for K in kinds], y[None], t[None, :, None])
    V = C + sum(v * K for v, K in zip(found.variances, kinds, strict=True))
    weighted = np.linalg.solve(V, t)
    variance = 1 / float(t @ weighted)
    scale = CommonScale(1e-3 * variance * float(weighted @ y), 1e-3 * float(np.sqrt(variance)))
    return scale if _is_told(scale, len(y) - 1 - len(kinds)) else None


def _coefficients(design: Array, columns: Array) -> Array:
    """How a design (m, r, p) combines to columns (m, r, c): (p, c)."""
    X = design.reshape(-1, design.shape[-1])
    return np.asarray(np.linalg.lstsq(X, columns.reshape(len(X), -1), rcond=None)[0])


def _is_told(scale: CommonScale, dof: int) -> bool:
    """Whether a scale is large, and no matter of chance."""
    from scipy.stats import t

    if abs(scale.size) < LEAST:
        return False
    return bool(2 * t.sf(abs(scale.size) / scale.std, dof) < UNLIKELY)
