"""Which fault explains the residuals best, if any does."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.cause import NOISE, OUTLIER, Cause
from edtk.calibration.causes.families_with_known import families_with_known
from edtk.calibration.causes.family import fit_family
from edtk.calibration.causes.noise_rarity import noise_rarity
from edtk.calibration.causes.plain_fit import PlainFit
from edtk.calibration.causes.rank_faults import COMMON, LEVEL, likely_faults, rank_faults
from edtk.calibration.causes.rarity import likely_size, rarity
from edtk.calibration.causes.shifted import SEEN, shifted
from edtk.calibration.causes.times_to_tell import times_to_tell
from edtk.calibration.causes.tried import Tried
from edtk.calibration.causes.wrong_pose import wrong_pose
from edtk.calibration.whole_rows import whole_rows
from edtk.inference.distributions import chi_square_tail, fisher_tail
from edtk.inference.error_strata import ErrorStrata, Stratum
from edtk.inference.estimate_noise import yardstick
from edtk.inference.lack_of_fit import LackOfFit, lack_of_fit
from edtk.inference.least_squares import SingularPlanError
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.inference.translations import translations
from edtk.inference.visit_residuals import visit_residuals
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

MOST = 2  # causes that are named
POSE = "pose"
PRIOR = "prior"
NO_FAULTS = (COMMON, OUTLIER, PRIOR)  # of the day; they keep others from being blamed
NEAR = 6.0  # score within which a second cause is as likely as the best, to a person
UNASKED = 10.0  # a noise that is smaller than stated harms nobody: it has to be so much clearer
CLEARLY_OFF = 6.0  # size of an outlier, in sigma, that larger noise does not make
LOUDEST = 4.0  # noise over the stated one, beyond which rather something unknown is wrong
WITHIN_REACH = 20.0  # score that a pose gains at most where a joint value explains it


def find_causes(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    typed: tuple[int, ...] = (),
    known: Mapping[int, float] | None = None,
    prior: PriorRows | None = None,
) -> tuple[Cause, ...]:
    """Refit the measurements with each fault that is known, and name those that explain them.

    A fault of any size c adds parameters to the model; the sum of squares falls by a chi-square
    with as many degrees of freedom where the data are good. Where so large a fall has a probability
    below 1 %, after looking at all faults, the one of the largest marginal likelihood is named. A
    noise that is larger than stated is one of the alternatives.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) as the linear model about the fitted compliances sees them,
            less those that joints of known compliance make [m, rad].
        typed: Revolute joints whose values were written by hand, in which a pose may be wrong.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What is known of the compliances besides, linearised about the fitted ones.

    Returns:
        The best cause, and a second one that is about as likely; none if noise explains all.
    """
    told = prior if prior is not None and len(prior) else None
    try:
        plain = PlainFit.of(model, data, measured, known or {}, told)
    except SingularPlanError:
        return ()  # of very many measurements some do not identify all parameters
    if plain.dof < 1:
        return ()
    likely = likely_faults(_tried(plain))
    likely.sort(key=plain.score)
    ranked = rank_faults(_with_joints(plain, likely, typed), plain.coordinates)
    if ranked and ranked[0][1].cause.cause in NO_FAULTS and _settles(ranked[0][1], plain):
        return ()  # the tests of lack of fit and of outliers tell of it
    ranked = [(score, one) for score, one in ranked if one.cause.cause not in NO_FAULTS]
    best = [one for score, one in ranked if score <= ranked[0][0] + NEAR][:MOST]
    return tuple(
        replace(
            one.cause, explained=_explained(one, plain), times=times_to_tell(best[0], one, plain)
        )
        for one in best
    )


def _tried(plain: PlainFit) -> list[Tried]:
    """All faults, each fitted."""
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
        *_noise(plain, repeated=test is not None),
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


def _with_joints(plain: PlainFit, likely: list[Tried], typed: tuple[int, ...]) -> list[Tried]:
    """The same faults; wrong poses near the likeliest fault with the joint that explains them.

    A joint value has fewer parameters than a shift, so that such a pose comes further ahead.
    """
    found = list(likely)
    poses = [one for one in likely if one.cause.cause == POSE]
    near = [one for one in poses if plain.score(one) < plain.score(likely[0]) + WITHIN_REACH]
    for one in near[:MOST]:
        measured = plain.measured_rows(plain.measured)
        found[found.index(one)] = wrong_pose(
            plain.model, plain.data, measured, one, typed, plain.by_prior
        )
    return found


def _settles(one: Tried, plain: PlainFit) -> bool:
    """Whether noise explains the rest; noise that repetitions share explains all by itself.

    A reading that is little off may as well be one of noise that is larger than stated.
    """
    if one.cause.cause == COMMON:
        return True
    if one.cause.cause == PRIOR:
        return float(chi_square_tail(one.deviance, max(plain.alone_dof, 1))) > LEVEL
    rest = float(chi_square_tail(one.deviance, max(plain.dof - one.dims, 1)))
    return plain.chi2 - one.deviance > CLEARLY_OFF**2 and rest > LEVEL


def _explained(one: Tried, plain: PlainFit) -> float:
    """Share of the misfit that a fault explains."""
    return min(1.0, max(0.0, plain.chi2 - one.deviance) / max(plain.chi2 - plain.dof, 1e-9))


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
    cause = Cause(OUTLIER, math.sqrt(most), "sigma", None, float(chi_square_tail(most, 1)))
    free = left[row, column]
    usual_size = plain.usual_shift(drop.shape[1])[column] * whitened.weight[row, column]
    cost = rarity(residual[row, [column]] / free, np.array([[1 / free]]), float(usual_size))
    yield Tried(cause, plain.chi2 - most, 1, drop.size, cost)


def _common_noise(found: LackOfFit | None) -> Iterator[Tried]:
    """All repetitions of a pose share a part of the noise; see `lack_of_fit`."""
    if found is None or found.common == 0:
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


def _noise(plain: PlainFit, repeated: bool) -> Iterator[Tried]:
    """The noise is not as stated; by how much is only believed where repetitions confirm it."""
    chi2 = plain.chi2 - plain.by_prior
    dof = plain.alone_dof
    if dof < 1:
        return
    scale = chi2 / dof
    if scale > LOUDEST**2 and not repeated:
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
