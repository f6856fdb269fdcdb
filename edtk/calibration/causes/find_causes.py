"""Which fault explains the residuals best, if any does."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.cause import NOISE, OUTLIER, Cause
from edtk.calibration.causes.families import families
from edtk.calibration.causes.family import fit_family
from edtk.calibration.causes.shifted import SEEN, shifted
from edtk.calibration.causes.tried import Tried
from edtk.calibration.causes.wrong_pose import wrong_pose
from edtk.inference.distributions import chi_square_tail
from edtk.inference.lack_of_fit import LackOfFit, lack_of_fit
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements, row_numbers
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

LEVEL = 0.01  # probability that any fault is named in good data
MOST = 2  # causes that are named
COMMON = "common_noise"
POSE = "pose"
NO_FAULTS = (COMMON, OUTLIER)  # of the day; they keep others from being blamed
# Tested whatever is looked at beside them, at a share of the level: any cause is then named in less
# than 2 % of good data.
ALWAYS = {NOISE: 1.5, COMMON: 1.0}
NEAR = 6.0  # score within which a second cause is as likely as the best, to a person
UNASKED = 10.0  # a noise that is smaller than stated harms nobody: it has to be so much clearer
CLEARLY_OFF = 6.0  # size of an outlier, in sigma, that larger noise does not make
LOUDEST = 4.0  # noise over the stated one, beyond which rather something unknown is wrong
WITHIN_REACH = 20.0  # score that a pose gains at most where a joint value explains it


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
    test = lack_of_fit(z, row_numbers(data.q, data.wrench, data.marker), len(k))
    tried = [
        *_smooth(model, data, measured, k, chi2),
        *shifted(whitened, measured, chi2, data.pose, POSE),
        *_outliers(data, whitened, measured, chi2),
        *_noise(chi2, dof, repeated=test is not None),
        *_common_noise(test),
    ]
    looks = sum({one.cause.cause: one.tries for one in tried}.values())
    likely = []
    for one in tried:
        p = min(1.0, one.cause.p * ALWAYS.get(one.cause.cause, looks))
        if p < LEVEL:
            likely.append(replace(one, cause=replace(one.cause, p=p)))

    def score(one: Tried) -> float:
        """The less, the likelier is the fault."""
        return one.score(coordinates)

    likely.sort(key=score)
    poses = [one for one in likely if one.cause.cause == POSE]
    # A joint value has fewer parameters than a shift, so that such a pose comes further ahead.
    for one in [one for one in poses if score(one) < score(likely[0]) + WITHIN_REACH][:MOST]:
        likely[likely.index(one)] = wrong_pose(model, data, measured, one, typed)
    likely.sort(key=score)
    if likely and likely[0].cause.cause in NO_FAULTS and _settles(likely[0], chi2, dof):
        return ()  # the tests of lack of fit and of outliers tell of it
    likely = [one for one in likely if one.cause.cause not in NO_FAULTS]
    best = [one for one in likely if score(one) <= score(likely[0]) + NEAR][:MOST]
    return tuple(replace(one.cause, explained=_explained(one, chi2, dof)) for one in best)


def _settles(one: Tried, chi2: float, dof: int) -> bool:
    """Whether noise explains the rest; noise that repetitions share explains all by itself.

    A reading that is little off may as well be one of noise that is larger than stated.
    """
    if one.cause.cause == COMMON:
        return True
    rest = float(chi_square_tail(one.deviance, max(dof - one.dims, 1)))
    return chi2 - one.deviance > CLEARLY_OFF**2 and rest > LEVEL


def _explained(one: Tried, chi2: float, dof: int) -> float:
    """Share of the misfit that a fault explains."""
    return min(1.0, max(0.0, chi2 - one.deviance) / max(chi2 - dof, 1e-9))


def _smooth(
    model: ElastostaticModel, data: Measurements, measured: Array, k: Array, chi2: float
) -> Iterator[Tried]:
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
        rarity = fit.rarity(family.usual)
        yield Tried(cause, fit.chi2, family.dims, family.tries, rarity)


def _outliers(
    data: Measurements, whitened: Whitened, measured: Array, chi2: float
) -> Iterator[Tried]:
    """One reading is off, or one coordinate of it; where no pose is repeated it is that pose."""
    if len(np.unique(data.pose)) < len(data):
        yield from shifted(whitened, measured, chi2, np.arange(len(data)), OUTLIER)
    z = measured * whitened.weight
    residual = z - whitened.Q @ np.einsum("mrp,mr->p", whitened.Q, z)
    left = 1 - (whitened.Q**2).sum(axis=-1)
    drop = np.divide(residual**2, left, out=np.zeros_like(left), where=left > SEEN)
    most = float(drop.max())
    cause = Cause(OUTLIER, math.sqrt(most), "sigma", None, float(chi_square_tail(most, 1)))
    yield Tried(cause, chi2 - most, 1, drop.size)


def _common_noise(found: LackOfFit | None) -> Iterator[Tried]:
    """All repetitions of a pose share a part of the noise; see `lack_of_fit`."""
    if found is None or found.common == 0:
        return
    means_dof, pure_dof = found.dof
    pure = found.pure_error**2
    deviance = pure_dof * (1 + math.log(pure)) + means_dof * (1 + math.log(pure * found.F))
    yield Tried(Cause(COMMON, found.common, "times stated", None, found.p), deviance, 2, 1)


def _noise(chi2: float, dof: int, repeated: bool) -> Iterator[Tried]:
    """The noise is not as stated; by how much is only believed where repetitions confirm it."""
    scale = chi2 / dof
    if scale > LOUDEST**2 and not repeated:
        return
    p = float(chi_square_tail(chi2, dof))
    p = min(p, UNASKED * (1 - p))
    deviance = dof * (math.log(max(scale, 1e-300)) + 1)
    std = math.sqrt(scale / (2 * dof))
    yield Tried(Cause(NOISE, math.sqrt(scale), "times stated", std, p), deviance, 1, 1)
