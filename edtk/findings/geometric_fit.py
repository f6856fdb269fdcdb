"""What looks wrong in a fit of geometry, and whether its poses are enough to judge it."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from edtk.findings.causes.family import POSE, Cause
from edtk.findings.causes.faults import cause_of_rows, cause_wording
from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.findings.fit_rows import (
    CommonScale,
    DayTrend,
    FitRows,
    NamedCause,
    SizedColumns,
    common_scale,
    day_trends,
    own_columns,
)
from edtk.findings.like_poses import LikePoses
from edtk.findings.match_plan import COARSE_DEG, like_rounding, steps_of
from edtk.findings.moved_frame import (
    MOST_OF_MISFIT,
    MovedFrame,
    SlippedJoint,
    UntoldLoad,
    lost_load,
    moved_frame,
    other_causes,
    slipped_joint,
    untold_load,
)
from edtk.findings.noise import left_out_findings
from edtk.findings.prior import (
    chance_of_square,
    contradictions,
    known_findings,
    rescue_findings,
)
from edtk.findings.sound_rows import marker_findings
from edtk.findings.springs import still_joints, untold_finding
from edtk.fit.distributions import chi_square_tail
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import GeometricFit, root_mean_square
from edtk.fit.least_squares import ALONE
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.prior import PriorRows
from edtk.measure.equilibrium import why_no_rest
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.few_columns import FewColumns
from edtk.measure.parameters import Parameter
from edtk.robots.frames import MM
from edtk.study.study_geometry import StudyGeometry
from edtk.study.study_model import KNOWN
from edtk.system.typing import Array, Indices

WORSE = 10.0  # times as far off as by the drawing: nothing shows that so few poses tell anything
FEW_COORDINATES = 2.5  # coordinates a parameter, below which poses are few
UNLIKELY_POSE = 1e-6  # probability, over all poses, below which a pose is named
HARDLY = 1e-2  # the same, below which it is looked at beside a fit that trusts it less
ASIDE = 0.1  # of the poses, or two: so many wrong ones are set aside before a cause is looked for
LARGE_ERROR = 60.0  # mm or mrad: no robot is built as wrongly
ROUGH = 0.02  # of the spread of positions that the fit leaves: the drawing is of another robot
ROUGH_DEG = 1.0  # orientations that the fit leaves
EXPLAINED_POSE = 0.3  # of the distances of a pose, at most, that the right joint leaves
NO_MOTION = 1e-12  # [m^2] of a joint that moves no marker
CLEARLY_WORSE = 3.0  # times as much another joint leaves
MOST_TYPED_NAMED = 2  # poses whose wrong joint is named in full
HALF = 0.5  # of them: a cause that explains less leaves most of the misfit to the model
NOISY = 5.0  # times the stated noise
BY_PERCENT = 1e-3  # [m/m] a scale that is known no better is said in percent
# Times as likely with a cause as without any: of sound days at most one in so many shows as much
# (Markov's inequality), if they err as is assumed.
LIKELIER = 300.0
# These leave many outside by themselves.
EXPLAINED = ("outliers", "frame_moved", "joint_slipped", "unloaded_rows", "rough")
# And these explain what a fit leaves.
LEAVES = ("frame_moved", "joint_slipped", "unloaded_rows", "rough", "rounded")
IS_IT_THIS_ROBOT = (
    "is it this robot, are angles in degrees, and does the controller count joints as the study "
    "says? See edtk controller"
)


def _say(severity: Severity, kind: str, **data: Any) -> Finding:
    """A finding in the words below."""
    return Finding.of(severity, WORDING, kind, **data)


def _few(fit: GeometricFit) -> list[Finding]:
    """Hardly more coordinates than parameters."""
    coordinates = int(fit.data.means.rows_seen.sum())
    count = fit.structural
    if fit.told_before is not None:
        count = max(int(np.ceil(count - fit.told_before.count)), 1)
    if coordinates >= FEW_COORDINATES * count:
        return []
    each = int(fit.data.present.sum())
    data = {
        "coordinates": coordinates,
        "count": count,
        "missing": int(np.ceil((FEW_COORDINATES * count - coordinates) / each)),
    }
    placed = fit.placed_left_out
    if not fit.loo_rms > WORSE * placed:  # nothing is placed by differences alone
        return [_say(Severity.WARNING, "few_poses", **data)]
    # Neither residuals nor poses left out speak for such a fit, and an error of one pose is all in.
    return [_say(Severity.ALARM, "few_poses", **data, loo_rms=fit.loo_rms, placed=placed)]


def _alone(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Poses that alone tell something: how far off they are without themselves is not known."""
    if fit.turns is not None:
        return []
    design = own_columns(fit, setting.loads)
    if fit.told_before is not None:
        before = PriorRows.near(fit.told_before.prior, fit.fitted.theta)
        known = before.scaled(fit.fitted.model.scales, fit.fitted.noise.reading)
        design = FewColumns.among(known.below(design.dense), len(fit.data.markers))
    basis = design.independent()
    every = (visits for one in fit.data.means.same_poses.every for visits in one.members)
    alone = [pose for visits in every if _tells_alone(basis[visits]) for pose in visits]
    if not len(alone):
        return []
    rows = tuple(sorted({row for pose in alone for row in fit.data.rows_of_pose(int(pose))}))
    return [_say(Severity.WARNING, "alone", rows=rows)]


def _tells_alone(basis: FewColumns) -> bool:
    """Whether the visits of a pose hold a direction of an orthonormal basis of all as a whole."""
    Q = basis.dense.reshape(-1, basis.p)
    left = (1 - ALONE) * np.eye(len(Q)) - Q @ Q.T
    try:
        np.linalg.cholesky(left)
    except np.linalg.LinAlgError:
        return True
    return False


Refit = Callable[[MarkerPositions, bool], GeometricFit]


def geometric_findings(
    fit: GeometricFit, setting: StudyGeometry, refit: Refit | None = None
) -> list[Finding]:
    """Everything that looks wrong, in any order.

    What is said of positions, or of the course of a day, is said of absolute readings.

    Args:
        fit: The fit.
        setting: The study and its markers.
        refit: How other positions are fitted, and whether poses that fit badly count less. So a few
            wrong poses neither hide each other nor look like a cause; None for no other fit.
    """
    absolute = fit.of_positions
    judged, wrong = fit, _unlikely(fit)
    causes = []
    placed = []
    if absolute.data.seen.any():
        causes = _causes(absolute, setting)
        rough = _rough(absolute)
        if refit is not None and not rough:
            judged, wrong, causes = _apart(fit, causes, setting, refit)
        placed = [
            *rough,
            *_turned(absolute),
            *_alone(absolute, setting),
            *_rounded(absolute),
        ]
        placed += _scaled(absolute, setting)
    found = [
        *placed,
        *_open(fit),
        *_few(fit),
        *_worse(fit),
        *_outliers(judged, wrong),
        *causes,
        *_loaded(fit, setting),
        *_springs(fit, setting),
        *_large(fit),
        *marker_findings(fit, setting),
        *_negative(fit),
        *_snapping(fit, setting),
        *_prior(fit, setting),
    ]
    caused = bool(causes) or any(
        one.kind in LEAVES or (one.kind == "outliers" and one.data["share"] > HALF) for one in found
    )
    found += _noise(fit, setting, caused)
    named = any(one.kind in EXPLAINED for one in found)
    trusted_less = bool((fit.weights < 1).any())
    said = left_out_findings(fit.share_inside, lambda: fit.independent, named, trusted_less)
    return [*found, *said]


def _worse(fit: GeometricFit) -> list[Finding]:
    """Poses that are left out are predicted worse than with base and tool alone."""
    if not fit.worse_than_placed:
        return []
    data = {"loo_rms": fit.loo_rms, "placed": fit.placed_left_out, "poses": fit.data.poses}
    return [_say(Severity.ALARM, "worse_than_placed", count=fit.rank, **data)]


def _rounded(fit: GeometricFit) -> list[Finding]:
    """Joint angles that were rounded, by as much as the fit leaves.

    Rounding to steps h leaves errors that are uniform, of standard deviation ``h / sqrt(12)``, in
    each joint and pose. Commands may be whole degrees: they are a finding only where the residuals
    are those of joints that err by as much.
    """
    slides = fit.fitted.model.robot.slides
    errors = fit.fitted.noise.model_joints
    if slides.all() or not len(errors):
        return []
    angles = np.rad2deg(fit.fitted.model.robot.shown(fit.data.q)[:, ~slides])
    left = float(np.sqrt(np.mean(errors[~slides] ** 2)))
    for step in steps_of(angles):
        rounding = 1e3 * float(np.deg2rad(step)) / np.sqrt(12)
        if like_rounding(left, rounding):
            severity = Severity.ALARM if step >= COARSE_DEG else Severity.WARNING
            return [_say(severity, "rounded", step_deg=step, left=left, rounding=rounding)]
    return []


def _rough(fit: GeometricFit) -> list[Finding]:
    """A fit that leaves centimetres is of another robot, or of other angles."""
    x = fit.data.means.measured
    spread = float(np.sqrt(np.nanmean(((x - np.nanmean(x, axis=(0, 1))) ** 2).sum(axis=-1))))
    if fit.rms < ROUGH * spread:
        return []
    return [_say(Severity.ALARM, "rough", rms=fit.rms)]


def _turned(fit: GeometricFit) -> list[Finding]:
    """Orientations that leave degrees are given in another way."""
    if fit.turns is None:
        return []
    off = float(np.rad2deg(root_mean_square(fit.turns.residual)))
    if off < ROUGH_DEG:
        return []
    return [_say(Severity.ALARM, "rough_turns", rms_deg=off)]


def _open(fit: GeometricFit) -> list[Finding]:
    """Directions that the poses leave open."""
    if not fit.open:
        return []
    still = still_joints(fit.fitted.model.robot, fit.data.q)
    return [untold_finding((fit.rank, fit.structural), fit.open, still)]


def _apart(
    fit: GeometricFit, causes: list[Finding], setting: StudyGeometry, refit: Refit
) -> tuple[GeometricFit, Indices, list[Finding]]:
    """Wrong poses (k,), the fit that shows them, and the cause of what all others leave.

    What a few wrong poses are off by is fitted as noise, beside which none of them stands out, and
    looks like something that happened between them. A fit that trusts such poses less has the noise
    of the others (Lange et al. 1989). A cause that these show alike is of all poses.

    Args:
        fit: Of all poses.
        causes: The cause of what it leaves; none for none.
        setting: The study and its markers.
        refit: How other positions are fitted.
    """
    plain = fit, _unlikely(fit), causes
    if not (_chances(fit) < HARDLY).any():
        return plain
    wary = refit(fit.data, True)
    wrong = _unlikely(wary)
    others = fit.data[~np.isin(fit.data.pose, wrong)]
    few = 0 < len(wrong) <= max(2, ASIDE * len(fit.surprise))
    if not few or others.means.rows_seen.sum() < FEW_COORDINATES * fit.structural:
        return plain
    of_others = _causes(refit(others, False).of_positions, setting)
    alike = causes and [one.kind for one in causes] == [one.kind for one in of_others]
    return plain if alike else (wary, wrong, of_others)


def _chances(fit: GeometricFit) -> Array:
    """How likely (m,) chance makes one of the poses as far off as each is."""
    coordinates = fit.data.means.rows_seen.sum(axis=(1, 2))
    chances = chi_square_tail(fit.surprise, np.maximum(coordinates, 1))
    return chances * len(chances)


def _unlikely(fit: GeometricFit) -> Indices:
    """Poses (k,) that the others do not predict."""
    return np.flatnonzero(_chances(fit) < UNLIKELY_POSE)


def _outliers(fit: GeometricFit, wrong: Indices) -> list[Finding]:
    """Poses that the others do not predict, with the joints that explain it."""
    if not len(wrong):
        return []
    rows = sorted(row for pose in wrong for row in fit.data.rows_of_pose(int(pose)))
    off = float(np.sqrt(np.nanmax((fit.left_out[wrong] ** 2).sum(axis=-1))))
    typed = [(int(pose), _typed(fit, int(pose))) for pose in wrong]
    causes = tuple(
        Cause(POSE, size, unit, None, 0.0, joint=joint, rows=tuple(fit.data.rows_of_pose(pose)))
        for pose, found in typed
        if found is not None
        for joint, size, unit in [found]
    )
    squares = np.nansum(fit.residual**2, axis=(1, 2))
    share = float(squares[wrong].sum() / squares.sum())
    data = {"rows": tuple(rows), "off": off, "causes": causes, "share": share}
    return [_say(Severity.WARNING, "outliers", **data)]


def _typed(fit: GeometricFit, pose: int) -> tuple[str, float, str] | None:
    """The one joint whose value explains where the markers of a pose are.

    Returns:
        The joint, the value that explains them less the written one, and its unit; None where no
        joint does, or several do alike.
    """
    seen = fit.fitted.model.see(fit.fitted.theta, fit.data.means.q[[pose]])
    assert seen.by_joints is not None
    error = fit.left_out[pose]
    there = np.isfinite(error)
    J = seen.by_joints[0, :, :3][there]
    sizes = (J.T @ error[there]) / np.maximum((J**2).sum(axis=0), NO_MOTION)
    left = np.sqrt(((error[there][:, None] - J * sizes) ** 2).sum(axis=0))
    best, second = np.argsort(left)[:2] if len(left) > 1 else (0, 0)
    fits = left[best] < EXPLAINED_POSE * np.linalg.norm(error[there])
    if not fits or (len(left) > 1 and left[second] < CLEARLY_WORSE * left[best]):
        return None
    joint = fit.fitted.model.robot.joints[best]
    turns = joint.kind == "revolute"
    size = float(np.rad2deg(sizes[best]) if turns else MM * sizes[best])
    return joint.name, size, "deg" if turns else "mm"


def _causes(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """What happened in the course of the day, or is otherwise than said: the likeliest cause.

    A drift looks like a frame that moved once, and a weight in half of the poses like either, and
    what a robot leaves in like poses, where these follow each other, like any of them: so each is
    weighed beside such errors, see `LikePoses`, and the likeliest is named where it is many times
    likelier than none. What errors of the drawing that were not asked for explain is no motion:
    they are fitted beside it.
    """
    alone = FitRows.of(fit, setting.loads)
    rows = alone.beside(setting.taken_as_drawn)
    found: list[tuple[SizedColumns, Callable[[], Finding]]] = []
    moved = moved_frame(rows)
    if moved is not None:
        found.append((moved, partial(_moved, fit, moved)))
    slipped = slipped_joint(rows)
    if slipped is not None:
        found.append((slipped, partial(_slipped, fit, slipped)))
    found += [(trend, partial(_trend, fit, trend)) for trend in day_trends(rows)]
    rigid = not any(one.is_spring for one in fit.fitted.model.parameters)
    if fit.fitted.noise.model_fit is not None:
        bent = untold_load(alone) if rigid else lost_load(alone)
        if bent is not None:
            found.append((bent, partial(_bent, fit, bent, rigid)))
        others = other_causes(alone)
        rows = alone if others else rows  # these may be of errors that were not asked for
        found += [(one, partial(_other, one, alone, setting)) for one in others]
    if not found:
        return []
    causes = [one for one, _ in found]
    if slipped is not None and slipped.explained >= HALF:
        rows, columns = _about(slipped, rows, setting)
        causes[causes.index(slipped)] = replace(slipped, columns=columns)
    likelier = LikePoses.of(rows).likelier(causes)
    best = int(np.argmax(likelier))
    return [found[best][1]()] if likelier[best] > np.log(LIKELIER) else []


def _about(slipped: SlippedJoint, rows: FitRows, setting: StudyGeometry) -> tuple[FitRows, Array]:
    """The residuals of a day to first order about a fit without a slip, and columns of the slip.

    A joint that turns by 3 deg moves a marker by an arc, which at half a metre is 0.7 mm off its
    tangent, and a fit that knows no slip shifts all else: what that leaves looks like other causes.
    """
    data = rows.fit.data
    joint = rows.scene.robot.joint_names.index(slipped.joint)
    own = np.arange(data.q.shape[1]) == joint
    there = replace(data, q=data.q + np.outer(slipped.by_pose(data.pose), own))
    about = FitRows.of(_refitted(rows, there, setting), setting.loads)
    about = about.beside(setting.taken_as_drawn)
    by = MM * slipped.by_pose(np.arange(len(about.residual)))
    added = about.motion[..., joint] * by[:, None]
    # Errors of poses are as they were fitted without a slip, which they would explain in its stead.
    rows = replace(about, residual=about.residual + added, noise=rows.noise)
    return rows, added[..., None] / (MM * slipped.by)


def _refitted(rows: FitRows, data: MarkerPositions, setting: StudyGeometry) -> GeometricFit:
    """The fit of other positions in the way of this one."""
    fit = rows.fit
    prior = None if fit.told_before is None else fit.told_before.prior
    stated = replace(setting.noise, unknown=fit.fitted.noise.unknown)
    is_robust = bool((fit.weights < 1).any())
    return fit_geometry(setting.model, data, stated, setting.loads, is_robust, prior)


def _other(found: NamedCause, rows: FitRows, setting: StudyGeometry) -> Finding:
    """A fault of the robot, the tool or the load that is the same in all poses."""
    cause = replace(found.cause, effect=_effect(found, rows, setting))
    return _say(Severity.WARNING, "cause", cause=cause, explained=cause.explained)


def _effect(found: NamedCause, rows: FitRows, setting: StudyGeometry) -> float | None:
    """How far a robot with a fault is off in the tasks, root mean square [m].

    None without a task that has a tool, and where more than positions was fitted: what the fault
    does to that is not known here.
    """
    tasks, fit = setting.study.tasks, rows.fit
    alone = fit.turns is None and not fit.data.is_difference.any()
    if not (tasks and alone and all(task.tool is not None for task in tasks)):
        return None
    cleared = _refitted(rows, rows.without(found.added), setting).fitted
    each = [rows.off_in(task, setting.every_load_of(task), found, cleared) for task in tasks]
    return float(np.sqrt(tasks.shares @ np.square(each).sum(axis=-1))) / MM


def _cause(data: Data) -> str:
    """A fault, what it explains, and what it does in the test poses."""
    cause = data["cause"]
    text = f"{cause_wording(cause)}: {_explains(data)}"
    if cause.effect is None:
        return text
    return f"{text}, and puts the test pose off by {MM * cause.effect:.2g} mm"


def _moved(fit: GeometricFit, moved: MovedFrame) -> Finding:
    """The frame of the instrument moved between two poses."""
    rows = fit.data.rows_of_pose(moved.first)
    severity = Severity.ALARM if moved.shift > fit.rms else Severity.WARNING
    is_back = moved.end < len(fit.data.means)
    last = fit.data.rows_of_pose(moved.end - 1)[-1] if is_back else None
    data = {"shift": moved.shift, "explained": moved.explained}
    return _say(severity, "frame_moved", rows=(rows[0],), last=last, **data)


def _slipped(fit: GeometricFit, slipped: SlippedJoint) -> Finding:
    """The zero of a joint changed between two poses, so that the fit is of neither."""
    rows = fit.data.rows_of_pose(slipped.first)
    data = {"joint": slipped.joint, "size": slipped.size, "unit": slipped.unit}
    more = {"also": slipped.also, "explained": slipped.explained}
    severity = Severity.ALARM if slipped.explained >= HALF else Severity.WARNING
    return _say(severity, "joint_slipped", rows=(rows[0],), **data, **more)


def _trend(fit: GeometricFit, trend: DayTrend) -> Finding:
    """Something grew from the first pose to the last, or was there all day."""
    if trend.kind == "scale":
        data = {"size": trend.size, "std": trend.std, "known": True}
        return _say(Severity.WARNING, "scale", explained=trend.explained, **data)
    large = trend.kind == "drift" and trend.size > fit.rms
    severity = Severity.ALARM if large else Severity.WARNING
    return _say(severity, trend.kind, size=trend.size, explained=trend.explained)


def _bent(fit: GeometricFit, found: UntoldLoad, rigid: bool) -> Finding:
    """A weight that nobody told bends the robot, or where springs are fitted, none that was told.

    The former is taken by springs that a study asks for; without its load a visit tells false ones.
    """
    poses = np.flatnonzero(found.loaded & ~found.loaded.all())  # none where all poses have it
    rows = tuple(sorted(row for pose in poses for row in fit.data.rows_of_pose(int(pose))))
    data = {"joints": tuple(found.joints), "explained": found.explained}
    if rigid:
        return _say(Severity.WARNING, "untold_load", rows=rows, **data)
    p = float(np.exp(found.log_chance))
    return _say(Severity.ALARM, "unloaded_rows", rows=rows, factor=0.0, p=p, **data)


def _loaded(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """The sheet has loads that bend the robot between visits, and no spring is asked for."""
    loaded = np.asarray(fit.data.wrench.any(axis=1))
    if setting.loads is not None or not np.ptp(fit.data.wrench, axis=0).any():
        return []
    data = {"loaded": int(loaded.sum()), "visits": len(loaded)}
    return [_say(Severity.WARNING, "no_springs", **data)]


def _springs(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Springs that the study asks for, and no load of the sheet turns."""
    fitted = fit.fitted
    told = {one.of for one in fitted.model.parameters if one.place == "compliance"}
    told |= {one.of for one in fitted.open_parameters if one.place == "compliance"}
    untold = [name for name in setting.study.specification.joints.unknown if name not in told]
    if not untold:
        return []
    loaded = bool(fit.data.wrench.any())
    severity = Severity.NOTE if loaded else Severity.WARNING
    return [_say(severity, "springs", joints=tuple(untold), loaded=loaded)]


def _large(fit: GeometricFit) -> list[Finding]:
    """Errors of the drawing that no robot has."""
    fitted = fit.fitted
    large = [
        f"{one.words} is {_shown(one, value)} off"
        for one, value in zip(fitted.model.parameters, fitted.values, strict=True)
        if one.place == "joint" and abs(value) > LARGE_ERROR
    ]
    if not large:
        return []
    return [_say(Severity.WARNING, "large", errors=tuple(large))]


def _scaled(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """All lengths are longer together than they were known to be, as by the instrument's scale."""
    scale = scale_of(fit, setting)
    if scale is None or not scale.is_told:
        return []
    data = {"size": scale.size, "std": scale.std, "known": scale.known}
    return [_say(Severity.WARNING, "scale", **data)]


def scale_of(fit: GeometricFit, setting: StudyGeometry) -> CommonScale | None:
    """By how much all lengths come out longer; None where these, or the robot, are other ones."""
    # Of another robot errors of the drawing are not small, and do not add up.
    return None if setting.taken_as_drawn or _large(fit) else common_scale(fit)


def _shown(parameter: Parameter, value: float) -> str:
    """A large error: angles in degrees."""
    if parameter.turns:
        return f"{np.rad2deg(value * parameter.scale):.3g} deg"
    return f"{value:.3g} {parameter.unit}"


def _negative(fit: GeometricFit) -> list[Finding]:
    """Compliances far below zero; couplings and laws may be so."""
    fitted = fit.fitted
    found = [
        one.name.removeprefix("k_")
        for one, value, std in zip(fitted.model.parameters, fitted.values, fitted.std, strict=True)
        if one.is_spring and not one.law and len(one.ends) == 1 and value < -3 * std
    ]
    if not found:
        return []
    return [_say(Severity.WARNING, "negative", joints=tuple(found))]


def _snapping(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Visits in which an arm of the fitted springs does not come to rest."""
    means = fit.data.means
    snapping = np.flatnonzero(fit.fitted.snaps(means.q, means.wrench, setting.loads))
    if not len(snapping):
        return []
    rows = tuple(sorted({row for pose in snapping for row in fit.data.rows_of_pose(int(pose))}))
    why = why_no_rest(setting.study.robot, means.q[snapping[0]], fit.fitted.compliances)
    return [_say(Severity.ALARM, "snaps", rows=rows, why=why)]


def _prior(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """What the estimate rests on besides the poses, and what these contradict."""
    told = fit.told_before
    if told is None:
        return []
    parameters = fit.fitted.model.parameters
    found = rescue_findings(fit.rescued, fit.beyond)
    known = setting.uncertain
    own = [one.place == "compliance" and one.of in known for one in parameters]
    others = np.where(own, np.nan, told.mean)
    words = tuple(one.words for one in parameters)
    chance = chance_of_square(told.square, told.rank, told.dof) if told.rank else None
    found += contradictions(words, told.prior, (others, told.std), told.dof, chance)
    sizes = zip(parameters, fit.fitted.theta, fit.fitted.std, own, strict=True)
    left = {
        one.of: AssumedJoint(one.of, 0, float(value), float(std) * one.scale, KNOWN)
        for one, value, std, is_known in sizes
        if is_known
    }
    return [*found, *known_findings(setting.study, left)]


def _noise(fit: GeometricFit, setting: StudyGeometry, caused: bool) -> list[Finding]:
    """What the model leaves out, beside the stated noise; and repeats that scatter otherwise.

    Args:
        fit: The fit.
        setting: The study.
        caused: Whether a cause explains a part of it, which is named besides.
    """
    found = []
    noise = fit.fitted.noise
    reading = fit.reading
    stated = fit.typical(setting.noise.seen_from(fit.fitted.model.start))
    if noise.unknown:
        stated = reading
    if noise.repeats and not 1 / NOISY < reading / stated < NOISY:
        found.append(_say(Severity.NOTE, "sigma", reading_mm=reading, stated_mm=stated))
    if fit.rms * MM > NOISY * max(stated, reading):
        data = {
            "rms": fit.rms,
            "joints_mrad": float(np.max(noise.model_joints, initial=0.0)),
            "alike": not np.ptp(noise.model_joints) > 0,
            "positions_mm": noise.model_white,
            "as_drawn": _as_drawn(fit, setting),
            "caused": caused,
        }
        found.append(_say(Severity.NOTE, "discrepancy", **data))
    return found


def _as_drawn(fit: GeometricFit, setting: StudyGeometry) -> float | None:
    """How much of what is left the geometry explains that nobody asked for; None for little."""
    others = setting.taken_as_drawn
    if not others:
        return None
    rows = FitRows.of(fit).beside(others)
    along = rows.design.onto(rows.residual[..., None])
    explained = float((along**2).sum() / (rows.residual**2).sum())
    return None if explained < MOST_OF_MISFIT or rows.dof(0) < rows.design.rank else explained


def _outliers_words(data: Data) -> str:
    """Poses that are off, and the joints that explain it."""
    far = f"up to {MM * data['off']:.3g} mm"
    off = f"{rows_in_words(data['rows'])}: {far} from where the other poses predict the markers"
    if data["causes"]:
        return "; ".join([off, *map(cause_wording, data["causes"][:MOST_TYPED_NAMED])])
    return f"{off}; a swapped marker, or a pose typed wrongly?"


def _few_poses(data: Data) -> str:
    """So few that little, or nothing, speaks for the fit."""
    missing = data["missing"]
    text = (
        f"{data['coordinates']} coordinates for {data['count']} parameters leave little to judge "
        f"by; measure {missing} more pose{'s' * (missing > 1)}"
    )
    if "loo_rms" not in data:
        return text
    return (
        f"{text}. A pose left out is {MM * data['loo_rms']:.3g} mm off, and by the drawing "
        f"{MM * data['placed']:.3g}"
    )


def _explains(data: Data) -> str:
    """The share that a cause explains, and where that is little, whose the rest is."""
    share = f"that explains {100 * data['explained']:.0f} % of the residuals"
    return share if data["explained"] >= HALF else f"{share}; the rest is noise, or the model's"


def _frame_moved(data: Data) -> str:
    """A frame that moved, and whether it moved back."""
    until = "here on" if data["last"] is None else f"here to row {data['last'] + 1}"
    return (
        f"row {data['rows'][0] + 1}: from {until} positions are {MM * data['shift']:.3g} mm off, "
        f"as if the instrument's frame or the robot's base had moved; {_explains(data)}"
    )


def _joint_slipped(data: Data) -> str:
    """A joint that slipped, and what looks the same."""
    moved = "turned about" if data["unit"] == "deg" else "moved along"
    also = {"frame": f"; a base or a frame that {moved} its axis looks the same"}
    also["tool"] = f"; a tool that {moved} its axis looks the same"
    side = "further than" if data["size"] > 0 else "short of"
    return (
        f"row {data['rows'][0] + 1}: from here on joint {data['joint']} is "
        f"{abs(data['size']):.3g} {data['unit']} {side} what is written, as if its encoder or "
        f"belt had slipped{also.get(data['also'], '')}; {_explains(data)}. Master the joint, and "
        "fit the rows before and after this one apart"
    )


def _growth(data: Data) -> str:
    """Links that grow in the course of the day."""
    verb = "grown" if data["size"] > 0 else "shrunk"
    return (
        f"as if all links had {verb} by {1e6 * abs(data['size']):.3g} um/m from the first row to "
        f"the last: {_explains(data)}. Did the robot warm up? Measure when it is warm, or in an "
        "order that is not that of the poses"
    )


def _unloaded_rows(data: Data) -> str:
    """Visits that lack their load."""
    told = cause_wording(cause_of_rows("unloaded_rows", data))
    return (
        f"{told}: {_explains(data)}. Springs come out too stiff; expected readings under the load "
        "that is written"
    )


def _untold_load(data: Data) -> str:
    """A weight that nobody told, in some rows or in all."""
    joints = data["joints"]
    asked = ", ".join(f'"{name}"' for name in joints)
    where = f"{rows_in_words(data['rows'])}: " if data["rows"] else ""
    return (
        f"{where}as if a weight that the study does not know bent {', '.join(joints)}"
        f"{' there alone' if where else ''}: {_explains(data)}. A load, or the links' own mass? "
        f"Give it, and ask for compliance = [{asked}]"
    )


def _untold_springs(data: Data) -> str:
    """Springs of which nothing is told, and why."""
    joints = data["joints"]
    why = "no visit of the sheet is under a load; expected columns Fx_N and so on"
    if data["loaded"]:
        why = f"no load of the sheet turns {'this joint' if len(joints) == 1 else 'these joints'}"
    return f"nothing is told of the compliance of {', '.join(joints)}: {why}"


def _large_errors(data: Data) -> str:
    """The first of them."""
    errors = data["errors"]
    more = f", and {len(errors) - 1} more" if len(errors) > 1 else ""
    return f"{errors[0]}{more}: is the drawing that of this robot?"


def _common_scale(data: Data) -> str:
    """Lengths that all come out longer, or shorter."""
    or_else = "the robot of another size? A known length, measured beside the robot, would tell"
    if data["known"]:
        or_else = "what was known of lengths wrong?"
    size = scale_in_words(data["size"], data["std"], data["known"])
    return f"all lengths come out {size}: is the scale of the instrument off, or {or_else}"


def scale_in_words(size: float, std: float, known: bool) -> str:
    """By how much lengths come out longer than what they are compared with [m/m]."""
    longer = "longer" if size > 0 else "shorter"
    than = "known before," if known else "drawn"
    per, unit = (1e6, "um/m") if std < BY_PERCENT else (1e2, "%")
    by, within = (f"{x:.0f}" if x >= 10 else f"{x:.2g}" for x in (per * abs(size), per * std))
    return f"{longer} than {than} together, by {by} +- {within} {unit}"


def _discrepancy(data: Data) -> str:
    """What the model leaves, and whose it may be."""
    up_to = "" if data["alike"] else "up to "
    joints, positions = data["joints_mrad"], data["positions_mm"]
    parts = [f"joints erred by {up_to}{joints:.2g} mrad"] if joints else []
    parts += [f"positions erred by {positions:.2g} mm"] if positions else []
    as_if = f": as if {' and '.join(parts)} in each pose" if parts else ""
    text = (
        f"the model leaves {MM * data['rms']:.2g} mm, many times the noise{as_if}; bands include it"
    )
    if data["as_drawn"] is not None:
        return (
            f"{text}. Errors of the drawing that the study does not ask for explain "
            f'{100 * data["as_drawn"]:.0f} % of it; see parameters.geometry = "all"'
        )
    if data["caused"]:
        return text
    return (
        f"{text}. No cause in the list explains it (a frame that moved or drifts, links that grow, "
        "a weight): it is the model's. Poses that are reached from both sides would tell backlash"
    )


WORDING: Wording = {
    "few_poses": _few_poses,
    "alone": lambda data: (
        f"{rows_in_words(data['rows'])}: each tells what no other pose does, so that the error of "
        "poses left out is that of some directions alone, and too small"
    ),
    "worse_than_placed": lambda data: (
        f"do not use: a pose left out is {MM * data['loo_rms']:.3g} mm off, and with base and tool "
        f"alone {MM * data['placed']:.3g} mm. {data['poses']} poses are too few for "
        f"{data['count']} parameters beside what the model leaves out; measure more, or ask for "
        "fewer parameters"
    ),
    "rounded": lambda data: (
        f"all joint angles are multiples of {data['step_deg']:g} deg, and joints err by "
        f"{data['left']:.2g} mrad in each pose, as rounding to {data['step_deg']:g} deg would "
        f"leave ({data['rounding']:.2g}): were they rounded? Export them with three decimals"
    ),
    "rough": lambda data: f"the fit leaves {MM * data['rms']:.3g} mm: {IS_IT_THIS_ROBOT}",
    "rough_turns": lambda data: (
        f"the fit leaves {data['rms_deg']:.3g} deg of the orientations: are they rotation vectors "
        "(axis times angle) in degrees, or quaternions, in the frame of the positions?"
    ),
    "outliers": _outliers_words,
    "cause": _cause,
    "frame_moved": _frame_moved,
    "joint_slipped": _joint_slipped,
    "growth": _growth,
    "drift": lambda data: (
        f"from the first row to the last positions drift by {MM * data['size']:.3g} mm, as if the "
        f"instrument's frame or the robot's base moved slowly; {_explains(data)}. Points on the "
        'base would tell, as [[marker]] with joint = "base"'
    ),
    "untold_load": _untold_load,
    "unloaded_rows": _unloaded_rows,
    "no_springs": lambda data: (
        f"{data['loaded']} of {data['visits']} visits are under a load, and the study asks for no "
        "compliance, so that the arm counts as rigid; expected joints in parameters.compliance"
    ),
    "springs": _untold_springs,
    "large": _large_errors,
    "scale": _common_scale,
    "negative": lambda data: (
        f"compliances of {', '.join(data['joints'])} are below zero by more than noise explains"
    ),
    "snaps": lambda data: (
        f"{rows_in_words(data['rows'])}: an arm of the fitted springs does not come to rest; "
        f"{data['why']}"
    ),
    "sigma": lambda data: (
        f"repeated readings scatter by {data['reading_mm']:.2g} mm beside common motions, and "
        f"measurement.sigma_mm says {data['stated_mm']:.2g}"
    ),
    "discrepancy": _discrepancy,
}
