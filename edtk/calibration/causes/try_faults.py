"""Every fault that may explain residuals, each fitted to them."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.cause import NOISE, OUTLIER, POSE, PRIOR, Cause
from edtk.calibration.causes.families_with_known import families_with_known
from edtk.calibration.causes.family import fit_family
from edtk.calibration.causes.noise_rarity import noise_rarity
from edtk.calibration.causes.plain_fit import PlainFit
from edtk.calibration.causes.rank_faults import COMMON
from edtk.calibration.causes.rarity import likely_size, rarity, reading_rarity
from edtk.calibration.causes.shifted import SEEN, shifted
from edtk.calibration.causes.tried import Tried
from edtk.calibration.whole_rows import whole_rows
from edtk.inference.distributions import chi_square_tail, fisher_tail
from edtk.inference.error_strata import ErrorStrata, Stratum
from edtk.inference.estimate_noise import yardstick
from edtk.inference.lack_of_fit import LackOfFit, lack_of_fit
from edtk.inference.measurements import Measurements
from edtk.inference.translations import translations
from edtk.inference.visit_residuals import visit_residuals
from edtk.system.typing import Array

UNASKED = 10.0  # a noise that is smaller than stated harms nobody: it has to be so much clearer
LOUDEST = 4.0  # noise over the stated one, beyond which rather something unknown is wrong
# Noise that repetitions share, over their own or the stated one: beyond it is a fault of the model.
NO_NOISE = 6.0
AS_MUCH = 0.5  # scatter of repetitions over that of all residuals, from which it confirms this one


def try_faults(plain: PlainFit) -> list[Tried]:
    """Fit every fault that is known.

    Args:
        plain: The measurements without any fault.
    """
    data = plain.data
    test = None
    if plain.alone is not None:
        test = lack_of_fit(plain.z, data.places, len(plain.k))
    strata = _strata(plain)
    shared = _common_noise(test) if strata is None else _shared(strata, data)
    return [
        *_smooth(plain),
        *_poses(plain),
        *_outliers(plain),
        *_noise(plain, 0.0 if test is None else test.pure_error),
        *(replace(one, deviance=one.deviance + plain.by_prior) for one in shared),
        *_prior(plain),
    ]


def _poses(plain: PlainFit) -> Iterator[Tried]:
    """A pose is another one than that written down."""
    moved = _moved(plain)
    parts = plain.data.deflection.shape[1] if moved is None else moved.shape[-1]
    usual = plain.usual_shift(parts)
    group = plain.data.pose
    yield from shifted(plain.whitened, plain.measured, plain.chi2, group, POSE, usual, moved)


def _moved(plain: PlainFit) -> Array | None:
    """What shifts and turns of the robot add to single coordinates; None where rows are whole.

    A pose of whole rows may be shifted, and turned, in each coordinate by itself.
    """
    data = plain.data
    if data.deflection.shape[1] > 1:
        return None
    moved = translations(plain.model, data)
    if data.turn is not None:
        _, axis = whole_rows(plain.model, data, plain.A)
        assert axis is not None
        turned = (axis[:, None] == np.arange(3)) & data.turn[:, None]
        moved = np.concatenate([moved, turned[:, None].astype(float)], axis=-1)
    if plain.prior is None:
        return moved
    return np.moveaxis(plain.prior.zeros_below(np.moveaxis(moved, -1, 0)), 0, -1)


def _smooth(plain: PlainFit) -> Iterator[Tried]:
    """Faults of any size."""
    told = plain.prior is not None
    found = families_with_known(plain.model, plain.data, plain.A, plain.k, plain.known, told)
    for family in found:
        whole = plain.below(family)
        fit = fit_family(whole, plain.measured, plain.noise, plain.k)
        if fit is None:
            continue
        c, covariance = likely_size(fit.c, fit.covariance, family.usual)
        size = float(np.linalg.norm(c)) if family.dims > 1 else float(c[0])
        along = c / max(float(np.linalg.norm(c)), 1e-300)
        std = math.sqrt(float(along @ covariance @ along))
        p = float(chi_square_tail(max(plain.chi2 - fit.chi2, 0.0), family.dims))
        if family.only_positive:
            p = p / 2 if size > 0 else 1.0
        cause = Cause(
            family.cause,
            size * family.per_unit,
            family.unit,
            std * family.per_unit,
            p,
            joint=family.joint,
            rows=family.rows,
            grows=family.grows,
        )
        cost = rarity(fit.c, fit.covariance, family.usual, family.only_positive)
        yield Tried(cause, fit.chi2, family.dims, family.tries, cost, whole, c)


def _outliers(plain: PlainFit) -> Iterator[Tried]:
    """One reading is off, or one coordinate of it; where no pose is repeated it is that pose."""
    whitened = plain.whitened
    rows = np.arange(len(plain.data))
    if len(np.unique(plain.data.pose)) < len(rows):
        usual = plain.usual_shift(plain.data.deflection.shape[1])
        yield from shifted(whitened, plain.measured, plain.chi2, rows, OUTLIER, usual)
    residual = plain.measured_rows(whitened.residual(plain.measured))
    left = 1 - (plain.measured_rows(whitened.Q) ** 2).sum(axis=-1)
    drop = np.divide(residual**2, left, out=np.zeros_like(left), where=left > SEEN)
    row, column = np.unravel_index(int(drop.argmax()), drop.shape)
    most = float(drop[row, column])
    p = float(chi_square_tail(most, 1))
    cause = Cause(OUTLIER, math.sqrt(most), "sigma", None, p, rows=(int(row),))
    free = left[row, column]
    usual_size = plain.usual_shift(drop.shape[1])[column] * whitened.weight[row, column]
    off = residual[row, [column]] / free
    cost = reading_rarity(off, np.array([[1 / free]]), float(usual_size))
    yield Tried(cause, plain.chi2 - most, 1, drop.size, cost)


def _common_noise(found: LackOfFit | None) -> Iterator[Tried]:
    """All repetitions of a pose share a part of the noise; see `lack_of_fit`."""
    if found is None or not 0 < found.common <= NO_NOISE * max(1.0, found.pure_error):
        return
    means_dof, pure_dof = found.dof
    pure = found.pure_error**2
    deviance = pure_dof * (1 + math.log(pure)) + means_dof * (1 + math.log(pure * found.F))
    own = Stratum(pure * pure_dof, pure_dof)
    means = Stratum(pure * found.F * means_dof, means_dof)
    cost = noise_rarity(own, [(means, found.repetitions)])
    cause = Cause(COMMON, found.common, "times stated", None, found.p)
    yield Tried(cause, deviance, 2, 1, cost)


def _strata(plain: PlainFit) -> ErrorStrata | None:
    """Residuals split by what moves together, where that is not stated and can be seen."""
    data = plain.data
    if data.tracker is not None:
        return None
    joints = np.ones(plain.model.robot.n)
    seen = visit_residuals(plain.model, data, plain.A, plain.measured_rows(plain.measured), joints)
    if seen is None or len(seen.residual) < len(data):
        return None
    strata = ErrorStrata.of(seen)
    return strata if yardstick(strata) is not None and strata.poses.dof > 0 else None


def _shared(strata: ErrorStrata, data: Measurements) -> Iterator[Tried]:
    """Markers of a visit share a part of the noise, and visits of a pose do."""
    apart = yardstick(strata)
    if apart is None:
        return
    tests = [part for part in (strata.visits, strata.poses) if part.dof > 0]
    ratios = [part.mean_square / max(apart.mean_square, 1e-300) for part in tests]
    p = min(
        float(fisher_tail(F, part.dof, apart.dof)) for F, part in zip(ratios, tests, strict=True)
    )
    deviance = sum(part.dof * (1 + math.log(max(part.mean_square, 1e-300))) for part in strata.all)
    size = math.sqrt(max(ratios))
    cause = Cause(COMMON, size, "times stated", None, min(1.0, len(tests) * p))
    groups = (data.pose, data.visits, data.places)
    parts = (strata.poses, strata.visits, strata.shape)
    shared = [
        (part, len(data) / len(np.unique(group)))
        for part, group in zip(parts, groups, strict=True)
        if part.dof > 0
    ]
    own = strata.tracker if strata.tracker.dof > 0 else shared.pop()[0]
    cost = noise_rarity(own, shared)
    yield Tried(cause, deviance, len(strata.all), 1, cost)


def _noise(plain: PlainFit, pure_error: float) -> Iterator[Tried]:
    """The noise is not as stated; a loud one is only believed where repetitions scatter as much."""
    chi2 = plain.chi2 - plain.by_prior
    dof = plain.alone_dof
    if dof < 1:
        return
    scale = chi2 / dof
    if scale > LOUDEST**2 and pure_error < AS_MUCH * math.sqrt(scale):
        return
    p = float(chi_square_tail(chi2, dof))
    p = min(p, UNASKED * (1 - p))
    deviance = dof * (math.log(max(scale, 1e-300)) + 1) + plain.by_prior
    std = math.sqrt(scale / (2 * dof))
    cost = noise_rarity(Stratum(chi2, dof))
    yield Tried(Cause(NOISE, math.sqrt(scale), "times stated", std, p), deviance, 1, 1, cost)


def _prior(plain: PlainFit) -> Iterator[Tried]:
    """What was known of the compliances is wrong, whatever of it, and the measurements are not."""
    if plain.prior is None or plain.alone is None:
        return
    dims = len(plain.prior)
    p = float(chi_square_tail(plain.by_prior, dims))
    yield Tried(Cause(PRIOR, 1.0, "", None, p), plain.alone, dims, 1)
