"""What looks wrong in a fit of geometry, and whether its poses are enough to judge it."""

import numpy as np

from edtk.findings.finding import Finding, Severity, rows_in_words
from edtk.findings.geometry.fit_rows import DayTrend, FitRows, common_scale, day_trend
from edtk.findings.geometry.moved_frame import MovedFrame, UntoldLoad, moved_frame, untold_load
from edtk.findings.geometry.sound_rows import marker_findings
from edtk.fit.geometry.fitted_geometry import MM, GeometricFit, root_mean_square
from edtk.fit.geometry.judge_fit import chance_of_outside
from edtk.measure.parameters import GeometricParameter
from edtk.study.study_geometry import StudyGeometry
from edtk.system.typing import Array

ALONE = 1e-9  # leverage below one that rounding makes of a direction that one pose tells
WORSE = 10.0  # times as far off as by the drawing: nothing shows that so few poses tell anything
FEW = 2.5  # coordinates a parameter, below which poses are few
UNLIKELY = 1e-6  # probability, over all poses, below which a pose is named
MOST_NAMED = 2  # open directions that are named in full
MOST_LETTERS = 120  # of their names together
LARGE = 60.0  # mm or mrad: no robot is built as wrongly
ROUGH = 0.02  # of the spread of positions that the fit leaves: the drawing is of another robot
ROUGH_DEG = 1.0  # orientations that the fit leaves
SAME = 1e-6  # [rad or m] a joint that moves less stands still
MOSTLY = 0.7  # of the squares that are left
NOISY = 5.0  # times the stated noise
RARE = 5e-3  # of sound days leave as few coordinates inside their bands as make a finding
HELD = 0.75  # of the coordinates: below it bands are no bands
STEPS_DEG = (10.0, 5.0, 1.0, 0.5, 0.1)  # to which angles are rounded, the coarsest first
COARSE_DEG = 0.5  # no controller shows less: angles as coarse were rounded by a person
EXACT = 1e-6  # of a step: nearer to a multiple an angle is one, but for rounding
LIKE_ROUNDING = 0.6  # to its inverse: errors of joints beside those of rounding
UNCAUSED = (
    ". No cause in the list explains it (a frame that moved or drifts, links that grow, a weight): "
    "it is the model's. Poses that are reached from both sides would tell backlash"
)
EXPLAINED = ("outliers", "frame_moved", "rough")  # these leave many outside by themselves


def few_poses(fit: GeometricFit) -> list[Finding]:
    """What looks wrong in the number of poses, in any order."""
    return [*_few(fit), *_alone(fit)]


def _few(fit: GeometricFit) -> list[Finding]:
    """Hardly more coordinates than parameters."""
    coordinates = fit.data.rows * fit.data.means.count
    if coordinates >= FEW * fit.structural:
        return []
    markers = len(fit.data.markers)
    missing = int(np.ceil((FEW * fit.structural - coordinates) / (fit.data.rows * markers)))
    poses = f"{missing} more pose{'s' if missing > 1 else ''}"
    text = (
        f"{coordinates} coordinates for {fit.structural} parameters leave little to judge by; "
        f"measure {poses}"
    )
    if fit.loo_rms <= WORSE * fit.placed:
        return [Finding(Severity.WARNING, "few_poses", text)]
    # Neither residuals nor poses left out speak for such a fit, and an error of one pose is all in.
    text += (
        f". A pose left out is {MM * fit.loo_rms:.3g} mm off, and by the drawing "
        f"{MM * fit.placed:.3g}"
    )
    return [Finding(Severity.ALARM, "few_poses", text)]


def _alone(fit: GeometricFit) -> list[Finding]:
    """Poses that alone tell something: how far off they are without themselves is not known."""
    if fit.turns is not None:
        return []
    design = FitRows.of(fit).design
    Q = np.linalg.qr(design.reshape(-1, design.shape[-1]))[0].reshape(design.shape)
    leverage = np.linalg.eigvalsh(Q @ np.swapaxes(Q, 1, 2))[:, -1]
    alone = np.flatnonzero(leverage > 1 - ALONE)
    if not len(alone):
        return []
    rows = tuple(sorted({row for pose in alone for row in fit.data.rows_of_pose(int(pose))}))
    text = (
        f"{rows_in_words(rows)}: each tells what no other pose does, so that the error of poses "
        "left out is that of some directions alone, and too small"
    )
    return [Finding(Severity.WARNING, "alone", text, {"rows": rows})]


def geometric_findings(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Everything that looks wrong, in any order."""
    causes = _causes(fit, setting)
    found = [
        *_rough(fit),
        *_turned(fit),
        *_open(fit),
        *few_poses(fit),
        *_worse(fit),
        *_rounded(fit),
        *_outliers(fit),
        *causes,
        *_loaded(fit, setting),
        *_springs(fit, setting),
        *_large(fit),
        *marker_findings(fit, setting),
        *_scaled(fit, setting),
        *_negative(fit),
        *_noise(fit, setting, bool(causes)),
    ]
    named = any(one.kind in EXPLAINED for one in found)
    return [*found, *_outside(fit, named)]


def _worse(fit: GeometricFit) -> list[Finding]:
    """Poses that are left out are predicted worse than with base and tool alone."""
    if not fit.worse_than_placed:
        return []
    text = (
        f"do not use: a pose left out is {MM * fit.loo_rms:.3g} mm off, and with base and tool "
        f"alone {MM * fit.placed:.3g} mm. {fit.data.poses} poses are too few for {fit.rank} "
        "parameters beside what the model leaves out; measure more, or ask for fewer parameters"
    )
    return [Finding(Severity.ALARM, "worse_than_placed", text)]


def _rounded(fit: GeometricFit) -> list[Finding]:
    """Joint angles that were rounded, by as much as the fit leaves.

    Rounding to steps h leaves errors that are uniform, of standard deviation ``h / sqrt(12)``, in
    each joint and pose. Commands may be whole degrees: they are a finding only where the residuals
    are those of joints that err by as much.
    """
    slides = np.array([joint.kind == "prismatic" for joint in fit.fitted.model.robot.joints])
    errors = fit.fitted.noise.model_joints
    if slides.all() or not len(errors):
        return []
    angles = np.rad2deg(fit.fitted.model.robot.shown(fit.data.q)[:, ~slides])
    left = float(np.sqrt(np.mean(errors[~slides] ** 2)))
    for step in STEPS_DEG:
        rounding = 1e3 * float(np.deg2rad(step)) / np.sqrt(12)
        is_step = np.abs(angles - step * np.round(angles / step)).max() < step * EXACT
        if is_step and LIKE_ROUNDING * rounding < left < rounding / LIKE_ROUNDING:
            text = (
                f"all joint angles are multiples of {step:g} deg, and joints err by "
                f"{left:.2g} mrad in each pose, as rounding to {step:g} deg would leave "
                f"({rounding:.2g}): were they rounded? Export them with three decimals"
            )
            severity = Severity.ALARM if step >= COARSE_DEG else Severity.WARNING
            return [Finding(severity, "rounded", text)]
    return []


def _rough(fit: GeometricFit) -> list[Finding]:
    """A fit that leaves centimetres is of another robot, or of other angles."""
    x = fit.data.means.measured
    spread = float(np.sqrt(np.nanmean(((x - np.nanmean(x, axis=(0, 1))) ** 2).sum(axis=-1))))
    if fit.rms < ROUGH * spread:
        return []
    text = (
        f"the fit leaves {MM * fit.rms:.3g} mm: is it this robot, are angles in degrees, and does "
        "the controller count joints as the study says? See edtk controller"
    )
    return [Finding(Severity.ALARM, "rough", text)]


def _turned(fit: GeometricFit) -> list[Finding]:
    """Orientations that leave degrees are given in another way."""
    if fit.turns is None:
        return []
    off = float(np.rad2deg(root_mean_square(fit.turns.residual)))
    if off < ROUGH_DEG:
        return []
    text = (
        f"the fit leaves {off:.3g} deg of the orientations: are they rotation vectors (axis times "
        "angle) in degrees, or quaternions, in the frame of the positions?"
    )
    return [Finding(Severity.ALARM, "rough_turns", text)]


def _open(fit: GeometricFit) -> list[Finding]:
    """Directions that the poses leave open."""
    if not fit.open:
        return []
    count = MOST_NAMED if len("; ".join(fit.open[:MOST_NAMED])) <= MOST_LETTERS else 1
    named = "; ".join(fit.open[:count])
    more = len(fit.open) - count
    rest = f"; and {more} more" if more > 0 else ""
    still = _still(fit)
    text = (
        f"{fit.rank} of {fit.structural} parameters can be told{still}: {named}{rest}. Poses that "
        "move these apart would tell, and predictions elsewhere have wide bands"
    )
    return [Finding(Severity.WARNING, "open", text)]


def _still(fit: GeometricFit) -> str:
    """The joints that stand still in all poses, in words."""
    robot = fit.fitted.model.robot
    still = np.ptp(fit.data.q, axis=0) <= SAME
    names = [name for name, is_still in zip(robot.joint_names, still, strict=True) if is_still]
    if not names or len(names) == robot.n:
        return ""
    return f", as {', '.join(names)} stand{'s' * (len(names) == 1)} still in all poses"


def _outliers(fit: GeometricFit) -> list[Finding]:
    """Poses that the others do not predict."""
    from scipy.stats import chi2

    coordinates = fit.data.rows * fit.data.means.seen.sum(axis=1)
    probability = chi2.sf(fit.surprise, np.maximum(coordinates, 1))
    wrong = np.flatnonzero(probability * len(probability) < UNLIKELY)
    if not len(wrong):
        return []
    rows = [row for pose in wrong for row in fit.data.rows_of_pose(int(pose))]
    size = MM * float(np.sqrt(np.nanmax((fit.left_out[wrong] ** 2).sum(axis=-1))))
    named = rows_in_words(sorted(rows))
    text = (
        f"{named}: up to {size:.3g} mm from where the other poses predict the markers; a swapped "
        "marker, a pose typed wrongly, or see --robust"
    )
    return [Finding(Severity.WARNING, "outliers", text, {"rows": tuple(sorted(rows))})]


def _outside(fit: GeometricFit, named: bool) -> list[Finding]:
    """Bands that hold too few of the coordinates that were left out, where nothing else says why.

    Args:
        fit: The fit.
        named: Whether poses that err by much are named already.
    """
    inside = fit.share_inside
    if chance_of_outside(1 - inside, fit.independent) > RARE or (named and inside > HELD):
        return []
    look = "look at the largest residuals"
    text = (
        f"{100 * inside:.0f} % of the coordinates left out are inside their 95 % bands: errors of "
        "some poses are far larger than those of others, and bands and standard deviations say too "
        f"little; {look if (fit.weights < 1).any() else f'{look}, or see --robust'}"
    )
    severity = Severity.ALARM if inside < HELD else Severity.WARNING
    return [Finding(severity, "outside", text)]


def _causes(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """What happened in the course of the day, or bends the robot: the cause that explains most.

    A drift looks like a frame that moved once, and a weight in half of the poses like either: so
    that which lowers the squares most, beside the noise that all of them leave, is named alone.
    """
    others = setting.taken_as_drawn
    moved = moved_frame(fit, others)
    trend = day_trend(fit, others)
    rigid = not any(one.place == "compliance" for one in fit.fitted.model.parameters)
    bent = untold_load(fit) if rigid and fit.fitted.noise.model_fit is not None else None
    found: list[tuple[Array, Finding]] = []
    if moved is not None:
        found.append((moved.columns(fit), _moved(fit, moved)))
    if trend is not None:
        found.append((trend.columns, _trend(fit, trend)))
    if bent is not None:
        found.append((bent.columns, _bent(fit, bent)))
    if len(found) < 2:
        return [one for _, one in found]
    gains = FitRows.of(fit).beside(others).gains([columns for columns, _ in found])
    return [found[int(np.argmax(gains))][1]]


def _moved(fit: GeometricFit, moved: MovedFrame) -> Finding:
    """The frame of the instrument moved between two poses."""
    rows = fit.data.rows_of_pose(moved.first)
    severity = Severity.ALARM if moved.shift > fit.rms else Severity.WARNING
    until = "here on"
    if moved.end < len(fit.data.means):
        until = f"here to row {fit.data.rows_of_pose(moved.end - 1)[-1] + 1}"
    text = (
        f"row {rows[0] + 1}: from {until} positions are {MM * moved.shift:.3g} mm off, as if the "
        f"instrument's frame or the robot's base had moved; that explains "
        f"{100 * moved.explained:.0f} % of the residuals"
    )
    return Finding(severity, "frame_moved", text, {"rows": (rows[0],)})


def _trend(fit: GeometricFit, trend: DayTrend) -> Finding:
    """Something grew from the first pose to the last."""
    explains = f"that explains {100 * trend.explained:.0f} % of the residuals"
    if trend.kind == "growth":
        verb = "grown" if trend.size > 0 else "shrunk"
        text = (
            f"as if all links had {verb} by {1e6 * abs(trend.size):.3g} um/m from the first row to "
            f"the last: {explains}. Did the robot warm up? Measure when it is warm, or in an order "
            "that is not that of the poses"
        )
        return Finding(Severity.WARNING, "growth", text)
    severity = Severity.ALARM if trend.size > fit.rms else Severity.WARNING
    text = (
        f"from the first row to the last positions drift by {MM * trend.size:.3g} mm, as if the "
        f"instrument's frame or the robot's base moved slowly; {explains}. Points on the base "
        'would tell, as [[marker]] with joint = "base"'
    )
    return Finding(severity, "drift", text)


def _bent(fit: GeometricFit, found: UntoldLoad) -> Finding:
    """A weight that nobody told bends the robot; where springs are fitted, these take it."""
    listed = ", ".join(f'"{name}"' for name in found.joints)
    poses = np.flatnonzero(found.loaded)
    part: tuple[int, ...] = ()
    where = ""
    if not found.loaded.all():
        part = tuple(sorted(row for pose in poses for row in fit.data.rows_of_pose(int(pose))))
        where = f"{rows_in_words(part)}: "
    text = (
        f"{where}as if a weight that the study does not know bent {', '.join(found.joints)}"
        f"{' there alone' if where else ''}: that explains {100 * found.explained:.0f} % of the "
        "residuals. A load, or the links' own mass? Give it, and ask for compliance = "
        f"[{listed}]"
    )
    return Finding(Severity.WARNING, "untold_load", text, {"rows": part})


def _loaded(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """The sheet has loads that bend the robot between visits, and no spring is asked for."""
    loaded = np.asarray(fit.data.wrench.any(axis=1))
    if setting.study.specification.joints.unknown or not np.ptp(fit.data.wrench, axis=0).any():
        return []
    text = (
        f"{int(loaded.sum())} of {len(loaded)} visits are under a load, and the study asks for no "
        "compliance, so that the arm counts as rigid; expected joints in parameters.compliance"
    )
    return [Finding(Severity.WARNING, "no_springs", text)]


def _springs(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Springs that the study asks for, and no load of the sheet turns."""
    fitted = fit.fitted
    told = {one.of for one in fitted.model.parameters if one.place == "compliance"}
    told |= {one.of for one in fitted.open_parameters if one.place == "compliance"}
    untold = [name for name in setting.study.specification.joints.unknown if name not in told]
    if not untold:
        return []
    which = "this joint" if len(untold) == 1 else "these joints"
    why = f"no load of the sheet turns {which}"
    severity = Severity.NOTE
    if not fit.data.wrench.any():
        why = "no visit of the sheet is under a load; expected columns Fx_N and so on"
        severity = Severity.WARNING
    text = f"nothing is told of the compliance of {', '.join(untold)}: {why}"
    return [Finding(severity, "springs", text)]


def _large(fit: GeometricFit) -> list[Finding]:
    """Errors of the drawing that no robot has."""
    fitted = fit.fitted
    large = [
        f"{one.words} is {_shown(one, value)} off"
        for one, value in zip(fitted.model.parameters, fitted.values, strict=True)
        if one.place == "joint" and abs(value) > LARGE
    ]
    if not large:
        return []
    more = f", and {len(large) - 1} more" if len(large) > 1 else ""
    text = f"{large[0]}{more}: is the drawing that of this robot?"
    return [Finding(Severity.WARNING, "large", text)]


def _scaled(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """All lengths are longer than drawn together, as by a scale of the instrument."""
    scale = None if setting.taken_as_drawn else common_scale(fit)
    if scale is None:
        return []
    longer = "longer" if scale.size > 0 else "shorter"
    text = (
        f"all lengths come out {longer} than drawn together, by {1e6 * abs(scale.size):.3g} +- "
        f"{1e6 * scale.std:.2g} um/m: is the scale of the instrument off, or the robot of another "
        "size? A known length, measured beside the robot, would tell"
    )
    return [Finding(Severity.WARNING, "scale", text)]


def _shown(parameter: GeometricParameter, value: float) -> str:
    """A large error: angles in degrees."""
    if parameter.turns:
        return f"{np.rad2deg(value * parameter.scale):.3g} deg"
    return f"{value:.3g} {parameter.unit}"


def _negative(fit: GeometricFit) -> list[Finding]:
    """Compliances far below zero."""
    fitted = fit.fitted
    found = [
        one.of
        for one, value, std in zip(fitted.model.parameters, fitted.values, fitted.std, strict=True)
        if one.place == "compliance" and value < -3 * std
    ]
    if not found:
        return []
    text = f"compliances of {', '.join(found)} are below zero by more than noise explains"
    return [Finding(Severity.WARNING, "negative", text)]


def _noise(fit: GeometricFit, setting: StudyGeometry, caused: bool) -> list[Finding]:
    """What the model leaves out, beside the stated noise; and repeats that scatter otherwise.

    Args:
        fit: The fit.
        setting: The study.
        caused: Whether a cause explains a part of it, which is named besides.
    """
    found = []
    noise = fit.fitted.noise
    stated = setting.noise
    if noise.repeats and not 1 / NOISY < noise.reading / stated.reading < NOISY:
        text = (
            f"repeated readings scatter by {noise.reading:.2g} mm beside common motions, and "
            f"measurement.sigma_mm says {stated.reading:.2g}"
        )
        found.append(Finding(Severity.NOTE, "sigma", text))
    if fit.rms * MM > NOISY * max(stated.reading, noise.reading):
        joints = float(np.max(noise.model_joints, initial=0.0))
        up_to = "up to " if np.ptp(noise.model_joints) > 0 else ""
        text = (
            f"the model leaves {MM * fit.rms:.2g} mm, many times the noise: as if joints erred by "
            f"{up_to}{joints:.2g} mrad and positions by {noise.model_white:.2g} mm in each pose; "
            f"bands include it{_as_drawn(fit, setting) or ('' if caused else UNCAUSED)}"
        )
        found.append(Finding(Severity.NOTE, "discrepancy", text))
    return found


def _as_drawn(fit: GeometricFit, setting: StudyGeometry) -> str:
    """How much of what is left the geometry explains that nobody asked for, in words."""
    others = setting.taken_as_drawn
    if not others:
        return ""
    rows = FitRows.of(fit).beside(others)
    basis = rows.design.reshape(rows.residual.size, -1)
    explained = float(((basis.T @ rows.residual.ravel()) ** 2).sum() / (rows.residual**2).sum())
    if explained < MOSTLY or rows.dof(0) < basis.shape[1]:
        return ""
    return (
        f". Errors of the drawing that the study does not ask for explain {100 * explained:.0f} % "
        'of it; see parameters.geometry = "all"'
    )
