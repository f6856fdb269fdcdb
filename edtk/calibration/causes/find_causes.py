"""Which fault explains the residuals best, if any does."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.causes.cause import Cause
from edtk.calibration.causes.families import families
from edtk.calibration.causes.family import fit_family
from edtk.calibration.causes.mistyped_joint import mistyped_joint
from edtk.inference.distributions import chi_square_tail
from edtk.inference.lack_of_fit import lack_of_fit
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements, row_numbers
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array, Indices

LEVEL = 0.01  # probability that any fault is named in good data
MOST = 2  # causes that are named
COMMON = "common_noise"
NEAR = 6.0  # score within which a second cause is as likely as the best, to a person


@dataclass(frozen=True)
class _Tried:
    """A fault that was tried: its deviance, and what is to be said of it."""

    cause: Cause
    deviance: float
    dims: int
    tries: int

    def score(self, coordinates: int) -> float:
        """Bayes' information criterion, with the number of alternatives of the same kind."""
        return self.deviance + self.dims * math.log(coordinates) + 2 * math.log(self.tries)


def find_causes(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    k: Array,
    typed: tuple[int, ...] = (),
) -> tuple[Cause, ...]:
    """Refit the measurements with each fault that is known, and name those that explain them.

    A fault of any size c adds parameters to the model; the sum of squares falls by a chi-square
    with as many degrees of freedom where the data are good. The fault with the least Bayesian
    information criterion is named if so large a fall has a probability below 1 %, times the number
    of faults tried (Bonferroni). That the noise is larger than stated is one of the alternatives.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) as the linear model about k sees them [m, rad].
        k: Fitted compliances (p,) [rad/(N m)].
        typed: Revolute joints whose values were written by hand, in which a pose may be wrong.

    Returns:
        The best cause, and a second one that is about as likely; none if noise explains all.
    """
    sigma = data.sigma
    try:
        whitened = Whitened.of(data.regressor(model), sigma, model.parameters)
    except SingularPlanError:
        return ()  # of very many measurements some do not identify all parameters
    k = whitened.solve(measured)
    z = (measured - data.regressor(model) @ k) / sigma
    chi2 = float((z**2).sum())
    coordinates = measured.size
    dof = coordinates - len(k)
    if dof < 1:
        return ()
    tried = [
        *_smooth(model, data, measured, k, chi2),
        *_poses(data, whitened, measured, chi2),
        *_noise(chi2, dof),
        *_common_noise(z, row_numbers(data.q, data.wrench, data.marker), len(k)),
    ]
    looks = sum({one.cause.cause: one.tries for one in tried}.values())
    likely = []
    for one in tried:
        # The sum of squares is tested whatever is looked at beside it.
        p = min(1.0, one.cause.p * (1 if one.cause.cause == "sigma" else looks))
        if p < LEVEL:
            misfit = max(chi2 - dof, 1e-9)
            explained = min(1.0, max(0.0, chi2 - one.deviance) / misfit)
            cause = replace(one.cause, p=p, explained=explained)
            likely.append((one.score(coordinates), cause))
    likely.sort(key=lambda entry: entry[0])
    best = [cause for score, cause in likely if score <= likely[0][0] + NEAR]
    if best and best[0].cause == COMMON:
        return ()  # noise, and no fault: the test of lack of fit tells of it
    named = (_with_joint(model, data, measured, cause, typed) for cause in best[:MOST])
    return tuple(cause for cause in named if cause is not None and cause.cause != COMMON)


def _smooth(
    model: ElastostaticModel, data: Measurements, measured: Array, k: Array, chi2: float
) -> Iterator[_Tried]:
    """Faults of any size."""
    for family in families(model, data, k):
        fit = fit_family(family, measured, data.sigma, k)
        if fit is None:
            continue
        size = float(np.linalg.norm(fit.c)) if family.dims > 1 else float(fit.c[0])
        along = fit.c / max(float(np.linalg.norm(fit.c)), 1e-300)
        std = math.sqrt(float(along @ fit.covariance @ along))
        p = float(chi_square_tail(max(chi2 - fit.chi2, 0.0), family.dims))
        cause = Cause(
            family.cause,
            size * family.per_unit,
            family.unit,
            std * family.per_unit,
            p,
            joint=family.joint,
            rows=family.rows,
        )
        yield _Tried(cause, fit.chi2, family.dims, family.tries)


def _poses(
    data: Measurements, whitened: Whitened, measured: Array, chi2: float
) -> Iterator[_Tried]:
    """One pose, with all its repetitions, is off by a common shift."""
    z = measured * whitened.weight
    residual = z - whitened.Q @ np.einsum("mrp,mr->p", whitened.Q, z)
    numbers = np.unique(data.pose)
    rows = z.shape[1]
    for number in numbers:
        at = np.flatnonzero(data.pose == number)
        # Columns of the shift, whitened: one a coordinate.
        weight = whitened.weight[at]
        shift = weight[:, :, None] * np.eye(rows)  # (repeats, rows, rows)
        onto = np.einsum("mrp,mrs->ps", whitened.Q[at], shift)
        gram = np.einsum("mrs,mrt->st", shift, shift) - onto.T @ onto
        along = np.einsum("mrs,mr->s", shift, residual[at])
        values, vectors = np.linalg.eigh(gram)
        seen = values > 1e-9 * np.trace(gram)
        parts = vectors.T @ along
        drop = float((parts[seen] ** 2 / values[seen]).sum())
        p = float(chi_square_tail(drop, max(int(seen.sum()), 1)))
        c = vectors[:, seen] @ (parts[seen] / values[seen])
        size = 1e3 * float(np.linalg.norm(c[:3]))
        cause = Cause("pose", size, "mm", None, p, rows=tuple(at.tolist()))
        yield _Tried(cause, chi2 - drop, int(seen.sum()), len(numbers))


def _common_noise(z: Array, group: Indices, parameters: int) -> Iterator[_Tried]:
    """All repetitions of a pose share a part of the noise; see `lack_of_fit`."""
    found = lack_of_fit(z, group, parameters)
    if found is None or found.common == 0:
        return
    means_dof, pure_dof = found.dof
    pure = found.pure_error**2
    deviance = pure_dof * (1 + math.log(pure)) + means_dof * (1 + math.log(pure * found.F))
    yield _Tried(Cause(COMMON, found.common, "times stated", None, found.p), deviance, 2, 1)


def _noise(chi2: float, dof: int) -> Iterator[_Tried]:
    """The noise is not as stated."""
    scale = chi2 / dof
    p = float(chi_square_tail(chi2, dof))
    p = 2 * min(p, 1 - p)
    deviance = dof * (math.log(max(scale, 1e-300)) + 1)
    std = math.sqrt(scale / (2 * dof))
    yield _Tried(Cause("sigma", math.sqrt(scale), "times stated", std, p), deviance, 1, 1)


def _with_joint(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    cause: Cause,
    typed: tuple[int, ...],
) -> Cause | None:
    """A wrong pose with the joint that explains it, if one does.

    A single measurement that no joint explains is an outlier, and no cause.
    """
    if cause.cause != "pose":
        return cause
    rows = np.array(cause.rows)
    others = np.setdiff1d(np.arange(len(data)), rows)
    try:
        A = data[others].regressor(model)
        rest = Whitened.of(A, data.sigma[others], model.parameters)
    except SingularPlanError:
        return cause
    k = rest.solve(measured[others])
    found = mistyped_joint(model, data, measured, k, rows, typed)
    if found is not None:
        name = model.robot.joint_names[found.joint]
        return replace(cause, size=float(np.rad2deg(found.change)), unit="deg", joint=name)
    return cause if len(rows) > 1 else None
