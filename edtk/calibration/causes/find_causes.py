"""Which fault explains the residuals best, if any does."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.cause import OUTLIER, POSE, PRIOR, Cause
from edtk.calibration.causes.found_causes import FoundCauses, most_outliers
from edtk.calibration.causes.plain_fit import PlainFit
from edtk.calibration.causes.rank_faults import COMMON, LEVEL, likely_faults, rank_faults
from edtk.calibration.causes.times_to_tell import times_to_tell
from edtk.calibration.causes.tried import Tried
from edtk.calibration.causes.try_faults import try_faults
from edtk.calibration.causes.wrong_pose import wrong_pose
from edtk.inference.distributions import chi_square_tail
from edtk.inference.least_squares import SingularPlanError
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

MOST = 2  # causes that are named
NO_FAULTS = (COMMON, OUTLIER, PRIOR)  # of the day; they keep others from being blamed
NEAR = 6.0  # score within which a second cause is as likely as the best, to a person
CLEARLY_OFF = 6.0  # size of an outlier, in sigma, that larger noise does not make
WITHIN_REACH = 20.0  # score that a pose gains at most where a joint value explains it


def find_causes(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    typed: tuple[int, ...] = (),
    known: Mapping[int, float] | None = None,
    prior: PriorRows | None = None,
) -> FoundCauses:
    """Refit the measurements with each fault that is known, and name those that explain them.

    A fault of any size c adds parameters to the model; the sum of squares falls by a chi-square
    with as many degrees of freedom where the data are good. Where so large a fall has a probability
    below 1 %, after looking at all faults, the one of the largest marginal likelihood is named. A
    noise that is larger than stated is one of the alternatives.

    A reading that is off by itself is another one. Where it is the likeliest, the row is set aside,
    and the others are looked at as if it had not been measured. Where so many would have to be set
    aside that they are no outliers any more, none is.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) as the linear model about the fitted compliances sees them,
            less those that joints of known compliance make [m, rad].
        typed: Revolute joints whose values were written by hand, in which a pose may be wrong.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What is known of the compliances besides, linearised about the fitted ones.
    """
    told = prior if prior is not None and len(prior) else None
    rows = np.arange(len(data))
    first = FoundCauses()
    for turn in range(1 + most_outliers(len(data))):
        try:
            plain = PlainFit.of(model, data[rows], measured[rows], known or {}, told)
        except SingularPlanError:
            break  # some of very many measurements, or all others, do not tell all parameters
        if plain.dof < 1:
            break
        found, off = _look(plain, typed)
        if turn == 0:
            first = found
        if off is None:
            aside = np.setdiff1d(np.arange(len(data)), rows).tolist()
            found = found.in_rows(rows)
            return replace(found, outliers=tuple(sorted([*aside, *found.outliers])))
        rows = np.delete(rows, off)
    return first


def _look(plain: PlainFit, typed: tuple[int, ...]) -> tuple[FoundCauses, int | None]:
    """What explains some measurements, and a row without which one has to look again."""
    likely = likely_faults(try_faults(plain))
    likely.sort(key=plain.score)
    ranked = rank_faults(_with_joints(plain, likely, typed), plain.coordinates)
    if not ranked:
        return FoundCauses(), None
    best = ranked[0][1]
    if best.cause.cause == OUTLIER and _is_clearly_off(best, plain):
        if _fits(best.deviance, plain.dof - best.dims):
            return FoundCauses(outliers=best.cause.rows), None
        return FoundCauses(_named(ranked, plain)), best.cause.rows[0]
    if best.cause.cause == COMMON:
        return FoundCauses(), None  # the test of lack of fit tells of it
    if best.cause.cause == PRIOR and _fits(best.deviance, plain.alone_dof):
        return FoundCauses(), None
    return FoundCauses(_named(ranked, plain)), None


def _named(ranked: list[tuple[float, Tried]], plain: PlainFit) -> tuple[Cause, ...]:
    """The best cause, and a second one that is about as likely."""
    faults = [(score, one) for score, one in ranked if one.cause.cause not in NO_FAULTS]
    best = [one for score, one in faults if score <= faults[0][0] + NEAR][:MOST]
    return tuple(
        replace(
            one.cause, explained=_explained(one, plain), times=times_to_tell(best[0], one, plain)
        )
        for one in best
    )


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


def _is_clearly_off(one: Tried, plain: PlainFit) -> bool:
    """Whether a reading is off by more than the others scatter, if that is more than stated.

    A reading that is little off may as well be one of noise that is larger than stated.
    """
    dof = max(plain.dof - one.dims, 1)
    scatter = 1.0 if _fits(one.deviance, dof) else max(1.0, one.deviance / dof)
    return plain.chi2 - one.deviance > CLEARLY_OFF**2 * scatter


def _fits(deviance: float, dof: int) -> bool:
    """Whether the stated noise explains what is left."""
    return float(chi_square_tail(deviance, max(dof, 1))) > LEVEL


def _explained(one: Tried, plain: PlainFit) -> float:
    """Share of the misfit that a fault explains."""
    return min(1.0, max(0.0, plain.chi2 - one.deviance) / max(plain.chi2 - plain.dof, 1e-9))
