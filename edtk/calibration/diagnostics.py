"""What looks wrong in measurements that can be used all the same: units, signs, noise, outliers, poses."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from edtk.calibration.input_errors import twins
from edtk.calibration.match_plan import OTHER_LOAD, match_plan, resolution_of
from edtk.design.plan import Plan
from edtk.inference.identification import Identification
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.model.loads.fixed_load import FixedLoad
from edtk.study.study import Study
from edtk.tables.pose_table import pose_columns, pose_factors

Array = NDArray[np.float64]
NOTE, WARNING, ALARM = 0, 1, 2

UNLIKELY = 0.01  # p-value of the residuals that is worth a warning
IMPOSSIBLE = 0.001  # and an alarm
TINY = 0.2  # estimated noise over the stated one that looks like another unit
FAR_BELOW_ZERO = -3.0  # standard deviations
WEAK = 0.5  # standard deviation over the compliance
ALIKE = 0.99  # correlation above which two parameters are hardly told apart
ALONE, UNSEEN = 0.05, 0.005  # share of an error in one pose that the residuals show
SHOWN = 10  # rows that are named


@dataclass(frozen=True)
class Diagnostic:
    """One thing that looks wrong.

    Attributes:
        severity: NOTE, WARNING, or ALARM: do not use the result.
        text: What, where, and what was expected.
    """

    severity: int
    text: str


def diagnostics(
    study: Study,
    data: Measurements,
    A: Array,
    fit: Identification,
    plan: Plan | None = None,
    rho0_bias: float | None = None,
) -> tuple[Diagnostic, ...]:
    """What looks wrong, the worst first; nothing where nothing does.

    Args:
        study: The question; its load and its assumed true compliances, if it has any, say how large things are.
        data: The measurements.
        A: Their regressors (m, rows, p).
        fit: What they gave.
        plan: The plan that was to be carried out.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    found = list(_units(study, data, A, fit, plan))
    if all(
        diagnostic.severity < ALARM for diagnostic in found
    ):  # else all that follows is a consequence
        found += [
            *_signs(study, fit),
            *_weak(study, fit),
            *_noise(fit),
            *_outliers(fit),
            *_alike(study, fit),
        ]
        found += [*_twins(data), *_alone(study, data, A, fit), *_linear(study, fit, rho0_bias)]
    found += [*_limits(study, data), *([] if plan is None else _not_measured(study, data, plan))]
    return tuple(sorted(found, key=lambda diagnostic: -diagnostic.severity))


def _units(
    study: Study, data: Measurements, A: Array, fit: Identification, plan: Plan | None
) -> Iterator[Diagnostic]:
    """Numbers that look like those of another unit."""
    forces = list(_forces(study, data, plan))
    yield from forces
    if all(diagnostic.severity < ALARM for diagnostic in forces):  # else these are its consequence
        yield from _lengths(study, data, A, fit)
    yield from _rotations(study, data, A)
    yield from _angles(study, data)


def _forces(study: Study, data: Measurements, plan: Plan | None) -> Iterator[Diagnostic]:
    """Forces of another size or direction than those of the plan, or of another size than the study's load."""
    load = study.space.load
    if plan is not None:
        expected, whose = plan.wrench[match_plan(study, data, plan).experiment], "the plan"
    elif isinstance(load, FixedLoad):
        expected, whose = np.broadcast_to(load.always, data.wrench.shape), "the study's [load]"
    else:
        return
    size, applied = (np.linalg.norm(W[:, :3], axis=1) for W in (expected, data.wrench))
    both = (size > 0) & (applied > 0)
    ratio = float(np.median(applied[both] / size[both])) if both.any() else 1.0
    if not 1 / 1.5 < ratio < 1.5:
        factors = {1e-3: "kilonewtons", 1e3: "millinewtons", 1 / 9.81: "kilograms"}
        units = [unit for factor, unit in factors.items() if 1 / 1.2 < ratio / factor < 1.2]
        why = (
            f": are they in {units[0]}? expected newtons"
            if units
            else "; expected those that were applied, in newtons"
        )
        text = f"columns Fx_N to Fz_N: the forces are {ratio:.3g} times those of {whose}{why}"
        yield Diagnostic(ALARM if units else WARNING, text)
    elif plan is not None:
        off = np.abs(data.wrench - expected).max(axis=1) > OTHER_LOAD * np.abs(expected).max(axis=1)
        if off.any():
            text = f"{named('row', np.flatnonzero(off).tolist())}: the load is not the one planned in this pose"
            yield Diagnostic(WARNING, f"{text}; expected it within {100 * OTHER_LOAD:g} %")


def _ratio(study: Study, data: Measurements, A: Array, columns: slice) -> float | None:
    """Size of what was measured over that of what the assumed compliances predict; None without a prediction."""
    given = (
        {}
        if study.specification.simulation is None
        else study.specification.simulation.compliance_rad_per_Nm
    )
    if any(name not in given for name in study.specification.joints.unknown):
        return None
    predicted = np.linalg.norm((A @ study.compliances)[:, columns])
    return float(np.linalg.norm(data.deflection[:, columns]) / predicted) if predicted > 0 else None


def _lengths(
    study: Study, data: Measurements, A: Array, fit: Identification
) -> Iterator[Diagnostic]:
    """Displacements a thousand times too small or too large, within a factor of ten.

    Beside the prediction where there is one; else the residuals beside sigma, where there are enough of them.
    """
    ratio = _ratio(study, data, A, slice(3))
    what = "the displacements are {:.2g} times those that the study's [simulation] predicts"
    if ratio is None and fit.dof >= 5:
        ratio, what = fit.scale, "the residuals are {:.2g} times sigma"
    if ratio is not None and 1e-4 < ratio < 1e-2:
        yield Diagnostic(ALARM, f"{what.format(ratio)}: are they in metres? expected millimetres")
    if ratio is not None and 1e2 < ratio < 1e4:
        yield Diagnostic(
            ALARM, f"{what.format(ratio)}: are they in micrometres? expected millimetres"
        )


def _rotations(study: Study, data: Measurements, A: Array) -> Iterator[Diagnostic]:
    """Rotations 57 times too small, within a factor of three."""
    ratio = _ratio(study, data, A, slice(3, 6)) if data.deflection.shape[1] == 6 else None
    if ratio is not None and 1 / 3 < ratio * 180 / np.pi < 3:
        yield Diagnostic(
            ALARM,
            f"the rotations are {ratio:.2g} times those predicted: are they in radians? expected degrees",
        )


def _angles(study: Study, data: Measurements) -> Iterator[Diagnostic]:
    """Several poses, all of them within 2 pi degrees of zero."""
    turning = [
        j
        for j, joint in enumerate(study.robot.joints)
        if joint.kind == "revolute" and j not in study.fixed
    ]
    degrees = np.rad2deg(data.q[:, turning])
    if turning and np.abs(degrees).max() <= 2 * np.pi and np.ptp(degrees, axis=0).any():
        text = (
            "all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"
        )
        yield Diagnostic(ALARM, text)


def _signs(study: Study, fit: Identification) -> Iterator[Diagnostic]:
    """Compliances that come out negative, by far or not."""
    if fit.negative.all():
        yield Diagnostic(
            ALARM,
            "every compliance comes out negative, and was set to zero: are the loaded and the unloaded positions "
            "swapped, or has the load the wrong sign?",
        )
        return
    for name, k, std in zip(study.model.parameters, fit.unbounded, fit.std, strict=True):
        if k < min(FAR_BELOW_ZERO * std, 0):
            text = f"{name} comes out as {k:.2g} +- {std:.2g}, far below zero: model, tool, units or poses are wrong"
            yield Diagnostic(ALARM, text)


def _weak(study: Study, fit: Identification) -> Iterator[Diagnostic]:
    """Compliances that cannot be told from zero."""
    for name, k, std in zip(study.model.parameters, fit.unbounded, fit.std, strict=True):
        if FAR_BELOW_ZERO * std <= k < std / WEAK and not fit.negative.all():
            what = ", and was set to zero" if k < 0 else ""
            yield Diagnostic(
                WARNING, f"{name} can hardly be told from zero ({k:.2g} +- {std:.2g}){what}"
            )


def _noise(fit: Identification) -> Iterator[Diagnostic]:
    """Residuals that the stated noise makes improbable.

    The sum of squares has the chi-square distribution with dof degrees of freedom; with Huber's loss the scale, from
    a median absolute deviation, has about 0.37 dof.
    """
    if not fit.dof:
        text = "there are as many measured coordinates as parameters: no residual tells whether anything is wrong"
        yield Diagnostic(WARNING, text)
        return
    n = fit.scale_dof
    p = float(chi2.sf(fit.scale**2 * n, n))
    if p < UNLIKELY and fit.known:
        likely = f"p = {p:.1g}" if p > 0 else "p < 1e-300"
        more = "--sigma-unknown" if fit.robust else "--sigma-unknown and --robust"
        text = (
            f"the residuals are {fit.scale:.3g} times what the stated noise allows ({likely}): sigma is too small, "
            f"there are outliers, or the model does not fit; see {more}"
        )
        yield Diagnostic(ALARM if p < IMPOSSIBLE else WARNING, text)
    elif p < IMPOSSIBLE:
        text = (
            f"the noise is estimated as {fit.scale:.3g} times the stated one: if that was right, the model, the tool "
            "or the poses are wrong"
        )
        yield Diagnostic(WARNING, text)
    elif p > 1 - IMPOSSIBLE and fit.known:
        yield Diagnostic(
            WARNING,
            f"the residuals are only {fit.scale:.3g} times what sigma says: sigma is too large",
        )
    elif p > 1 - IMPOSSIBLE and fit.scale < TINY:
        text = f"the noise is estimated as only {fit.scale:.2g} times the stated one: displacements in another unit?"
        yield Diagnostic(ALARM, f"{text} expected millimetres")


def _outliers(fit: Identification) -> Iterator[Diagnostic]:
    """Rows that do not belong to the others, and whether there are too many."""
    if len(fit.outliers):
        hidden = "" if fit.robust else "; several can hide each other, --robust shows them all"
        text = (
            f"{named('row', fit.outliers.tolist())}: outlier{'s' * (len(fit.outliers) > 1)}{hidden}"
        )
        yield Diagnostic(ALARM if 3 * len(fit.outliers) > len(fit.residual) else WARNING, text)


def _twins(data: Measurements) -> Iterator[Diagnostic]:
    """Equal rows that chance may have made."""
    text, chance = twins(data)
    if text:
        yield Diagnostic(
            NOTE,
            f"{text}: as readings so coarse may be by chance ({chance:.2g}), or was it copied?",
        )


def _alike(study: Study, fit: Identification) -> Iterator[Diagnostic]:
    """The two parameters that are hardest to tell apart."""
    off = np.abs(fit.correlation - np.eye(len(fit.k)))
    if off.max() > ALIKE:
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        pair = f"{study.model.parameters[j]} and {study.model.parameters[i]}"
        yield Diagnostic(
            WARNING, f"{pair} are hardly told apart (correlation {fit.correlation[i, j]:+.3f})"
        )


def _alone(study: Study, data: Measurements, A: Array, fit: Identification) -> Iterator[Diagnostic]:
    """Parameters that rest on one pose.

    With G = Q'Q of a pose's rows, the least eigenvalue of I - G is the share of an error there that residuals show;
    without the pose the covariance becomes ``T (I - G)^-1 T'`` where it is ``T T'`` with it.
    """
    share = np.bincount(data.pose, fit.leverage.sum(axis=1))
    suspects = np.flatnonzero(share > 1 - ALONE)
    if not len(suspects):
        return
    whitened = Whitened.of(A, data.sigma, study.model.parameters)
    T = np.linalg.inv(whitened.R)
    for pose in suspects:
        rows = np.flatnonzero(data.pose == pose)
        Q = whitened.Q[rows].reshape(-1, T.shape[1])
        left, V = np.linalg.eigh(np.eye(T.shape[1]) - Q.T @ Q)
        if left[0] < ALONE:
            without = ((T @ V) ** 2 / np.maximum(left, 1e-12)).sum(axis=1)
            growth = without / (T**2).sum(axis=1)
            names = np.array(study.model.parameters)[growth >= min(4.0, growth.max())]
            who = f"{', '.join(names)} rest{'s' if len(names) == 1 else ''}"
            text = f"{who} on one pose alone, {named('row', rows.tolist())}: the residuals hardly show an error there"
            yield Diagnostic(WARNING if left[0] < UNSEEN else NOTE, text)


def _linear(study: Study, fit: Identification, rho0_bias: float | None) -> Iterator[Diagnostic]:
    """A linear model that costs more than the noise."""
    if (
        study.target is not None
        and rho0_bias is not None
        and rho0_bias > fit.accuracy(study.target)[0]
    ):
        text = f"the linear model leaves {1e3 * rho0_bias:.2g} mm in the test pose, more than noise: use lighter loads"
        yield Diagnostic(WARNING, text)


def _limits(study: Study, data: Measurements) -> Iterator[Diagnostic]:
    """The first pose beyond a joint's limits."""
    slack = resolution_of(study) * pose_factors(study.robot)
    lower, upper = study.robot.limits
    beyond = np.argwhere((data.q < lower - slack) | (data.q > upper + slack))
    if len(beyond):
        i, j = beyond[0].tolist()
        column, factor = pose_columns(study.robot)[j], pose_factors(study.robot)[j]
        ends = f"{lower[j] / factor:g} to {upper[j] / factor:g}"
        text = f"row {i + 1}, column {column}: {data.q[i, j] / factor:g} is beyond the joint's limits, {ends}"
        yield Diagnostic(WARNING, text)


def _not_measured(study: Study, data: Measurements, plan: Plan) -> Iterator[Diagnostic]:
    """Planned experiments that were not made."""
    missing = match_plan(study, data, plan).missing
    if len(missing):
        yield Diagnostic(WARNING, f"{named('row', missing.tolist())} of the plan: not measured")


def named(what: str, rows: list[int]) -> str:
    """Some rows, counted from 1."""
    shown = ", ".join(str(i + 1) for i in rows[:SHOWN])
    return f"{what}{'s' * (len(rows) > 1)} {shown}{f' and {len(rows) - SHOWN} more' if len(rows) > SHOWN else ''}"
