"""From a sheet of positions to geometry and springs, with what looks wrong on the way."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from edtk.calibration.calibration import Origin
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.model_left import PiecesLeft
from edtk.calibration.told_before import told_before
from edtk.calibration.visit_propagation import circumstances_of, fit_propagation
from edtk.design.plan import Plan
from edtk.findings.counting import (
    Counting,
    as_said,
    far_off,
    find_counting,
    in_metres,
    in_radians,
    one_in_radians,
    placed_by_most,
)
from edtk.findings.finding import (
    Data,
    Finding,
    Severity,
    Wording,
    rows_in_words,
    worst_first,
)
from edtk.findings.fitted_data import AS_USUAL, HowFitted
from edtk.findings.geometric_fit import IS_IT_THIS_ROBOT, geometric_findings
from edtk.findings.gross_errors import SCALES, GrossErrors, gross_errors, gross_findings
from edtk.findings.match_plan import match_plan, not_measured, other_pose
from edtk.findings.sound_rows import (
    reference_points,
    refuse_copied_visits,
    rigid_tool,
    with_standing,
    without_beyond_reach,
    without_copied_markers,
)
from edtk.findings.turn_reading import EXPECTED, turn_reading
from edtk.findings.units import force_findings
from edtk.fit.fit_geometry import NoiseNotToldError, TooFewPosesError, fit_geometry
from edtk.fit.fitted_geometry import GeometricFit, Predicted, root_mean_squares
from edtk.fit.marker_positions import MarkerPositions, read_positions
from edtk.measure.pose_table import LOADED_COLUMNS, Table, path_of
from edtk.robots.frames import MM
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, alone_load
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices, Mask

SCALE_WITHIN = 0.2  # relative: how near to one of these a unit has to be
AGREES = 5.0  # times the error of poses left out, within which a visit agrees with the others
UNSURE = 3.0  # standard deviations of a prediction, within which it does, too


@dataclass(frozen=True, eq=False)
class Sound:
    """Positions that can be fitted, and what was found on the way.

    Attributes:
        data: All visits.
        gross: Those that do not seem to be of the markers.
        counting: How the sheet counts the joints.
        findings: What was found.
    """

    data: MarkerPositions
    gross: GrossErrors
    counting: Counting
    findings: tuple[Finding, ...]


def calibrate_geometry(
    study: Study, path: Table, how: HowFitted = AS_USUAL
) -> GeometricCalibration:
    """Identify geometry, base, tools and springs of a study from a sheet of positions.

    Args:
        study: The question, with `[parameters]`.
        path: The sheet (CSV, or a data frame), see `read_positions`.
        how: How it is fitted. Poses that are not in its plan are an error; planned visits that were
            not made, and other loads, are among the findings. As it is, a sheet in other units,
            with copied rows, or of other poses than planned is fitted all the same.

    Raises:
        UserError: The file cannot be read, is in other units, has poses that are not in the plan,
            or has too few poses.
    """
    where = path_of(path)
    every = _as_read(study, path, where, how.as_is)
    setting, every, standing = with_standing(StudyGeometry.of(study, every.markers), every)
    sound = _sound(setting, every, where, how.as_is)
    planned = [] if how.plan is None else _beside_plan(setting, every, how.plan, where, how.as_is)
    setting = replace(setting, markers=sound.data.markers)
    try:
        fit, gross = _fitted(setting, sound, how)
    except (TooFewPosesError, NoiseNotToldError) as error:
        raise UserError(str(error), where=where) from error
    except np.linalg.LinAlgError as error:
        # It went where the parameters, which the drawing tells apart, are no longer told apart.
        raise UserError(
            f"no geometry near the drawing fits: {IS_IT_THIS_ROBOT}", where=where
        ) from error
    pieces = PiecesLeft.of(setting, fit)
    apart = fit.fitted if pieces is None else pieces.apart(fit.fitted)
    propagation = fit_propagation(setting, fit, apart)
    circumstances = circumstances_of(propagation, setting)
    fit = replace(fit, fitted=replace(fit.fitted, circumstances=circumstances))
    findings = [
        *standing,
        *sound.findings,
        *planned,
        *gross_findings(sound.data, gross),
        *geometric_findings(fit, setting, partial(_fit, setting, how)),
    ]
    left = None if pieces is None else pieces.in_tasks(setting, fit.fitted)
    if pieces is not None and left is not None:
        findings += left.findings(pieces.shares, pieces.counts)
    found = GeometricCalibration(
        setting=setting,
        fit=fit,
        findings=(),
        path=where,
        counting=sound.counting,
        left_out=tuple(gross.visits),
        robust=how.robust,
        origin=Origin.of(path),
        pieces=pieces,
        propagation=propagation,
    )
    findings += found.rests_on_known
    return replace(found, findings=_that_count(findings, where, how.as_is))


def _as_read(study: Study, path: Table, where: Path, as_is: bool) -> MarkerPositions:
    """What a sheet has of a study's markers, in the frame of the instrument.

    Raises:
        UserError: The file cannot be read, or turns are written otherwise than they are taken, or
            rows are copies of others, and it is not taken as it is.
    """
    named = StudyGeometry.of(study)
    every = read_positions(
        path,
        study.robot,
        study.fixed,
        named.read,
        load=alone_load(study),
        reference=named.reference,
    )
    setting = StudyGeometry.of(study, every.markers)
    every = _from_instrument(setting, every, where)
    if as_is:
        return every
    on_tool = every.absolute.of_markers(slice(len(setting.on_tool)))
    if reading := turn_reading(path, study.robot, on_tool):
        raise UserError(f"the robot fits if {reading}; expected {EXPECTED}", where=where)
    refuse_copied_visits(every, _typical_reading(named, every), where)
    return every


def _that_count(findings: list[Finding], where: Path, as_is: bool) -> tuple[Finding, ...]:
    """The findings, the worst first: where the frame moved that is what is wrong, not the robot.

    Raises:
        UserError: The robot is another one by far, and the sheet is not taken as it is.
    """
    rough = [one for one in findings if one.kind == "rough"]
    if any(one.kind == "frame_moved" for one in findings):
        findings = [one for one in findings if one.kind != "rough"]
    elif rough and not as_is:
        raise UserError(rough[0].words, where=where)
    return worst_first(findings)


def _typical_reading(setting: StudyGeometry, data: MarkerPositions) -> float:
    """The stated size of a reading's error [m], of markers where the drawing has them."""
    model = setting.model
    seen = model.see(np.zeros(model.p), data.q, derivatives=False)
    return setting.noise.typical(seen.places) / MM


def _beside_plan(
    setting: StudyGeometry, every: MarkerPositions, plan: Plan, where: Path, as_is: bool
) -> list[Finding]:
    """What differs between the visits in which a marker of the tool was seen, and the plan.

    Raises:
        UserError: A pose is not in the plan, and the sheet is not taken as it is.
    """
    tool, _ = setting.split(every.without_lost())
    made = tool[np.flatnonzero(tool.seen.any(axis=1))]
    rows = [sorted(set(row[row >= 0].tolist())) for row in made.row]
    study = setting.study
    match = match_plan(study, made, plan)
    other = other_pose(study, made, plan, match, rows)
    if other is not None and not as_is:
        raise UserError(other.words, where=where)
    others = [] if other is None else [other]
    forces = force_findings(plan.wrench[match.experiment], made.wrench, True, rows)
    return [*others, *forces, *not_measured(match)]


def _fitted(
    setting: StudyGeometry, sound: Sound, how: HowFitted
) -> tuple[GeometricFit, GrossErrors]:
    """The fit without visits that are far off, and those that are so indeed.

    They were far from where the drawing has them. Where the fitted geometry, which may differ much
    from it, predicts them as well as others, they count again; and where it cannot predict them
    better, since they are those of a plan that tell what no other visit does.
    """
    gross = sound.gross
    kept = np.ones(len(sound.data), dtype=bool)
    kept[gross.visits] = False
    fit = _fit(setting, how, sound.data[kept])
    wrong = np.array([one.visit for one in gross.wrong], dtype=int)
    if not len(wrong):
        return fit, gross
    data = sound.data[wrong]
    apart, predicted = _apart(setting, fit, data)
    # What is open everywhere excuses nothing.
    squares = (predicted.std**2).sum(axis=-1) - predicted.open**2
    unsure = np.sqrt(np.where(data.seen, squares, 0.0).sum(axis=1) / data.seen.sum(axis=1))
    near = apart < np.maximum(AGREES * max(fit.loo_rms, fit.rms), UNSURE * unsure)
    bent = ~near & data.wrench.any(axis=1) & (setting.loads is not None)
    near[bent] = _fit_together(setting, how, fit, sound.data, kept, wrong[bent])
    if not near.any():
        return fit, gross
    kept[wrong[near]] = True
    still = tuple(one for one, is_near in zip(gross.wrong, near, strict=True) if not is_near)
    fit = _fit(setting, how, sound.data[kept])
    return fit, replace(gross, wrong=still)


def _apart(
    setting: StudyGeometry, fit: GeometricFit, data: MarkerPositions
) -> tuple[Array, Predicted]:
    """How far visits (m,) are from where a fit has them [m], and its predictions."""
    predicted = fit.fitted.predict(data.q, data.wrench, setting.loads)
    return root_mean_squares(data.measured - predicted.points), predicted


def _fit_together(
    setting: StudyGeometry,
    how: HowFitted,
    sound: GeometricFit,
    data: MarkerPositions,
    kept: Mask,
    loaded: Indices,
) -> Mask:
    """Which visits (k,) under loads are as near as others where all of them are fitted.

    A load takes them far from the drawing. Springs that visits tell which it hardly moved, or which
    it was not applied to, do not predict them; wrong ones are far from a wary fit of all, too. But
    it follows those that agree with each other, and is far from all others then: none counts.
    """
    none = np.zeros(len(loaded), dtype=bool)
    absolute = kept & ~data.is_difference
    if not len(loaded) or not absolute.any():
        return none
    try:
        fit = _fit(setting, how, data[np.union1d(np.flatnonzero(kept), loaded)], wary=True)
    except np.linalg.LinAlgError:
        return none
    others, apart = (_apart(setting, fit, some)[0] for some in (data[absolute], data[loaded]))
    size = float(np.sqrt(np.nanmean(others**2)))
    return none if size > AGREES * max(sound.loo_rms, sound.rms) else apart < AGREES * size


def _fit(
    setting: StudyGeometry, how: HowFitted, data: MarkerPositions, wary: bool = False
) -> GeometricFit:
    """The fit of some visits; where it is wary, poses that fit badly count less in any case."""
    stated = replace(setting.noise, unknown=how.sigma_unknown)
    given = (stated, setting.loads, how.robust or wary, told_before(setting))
    return fit_geometry(setting.model, data, *given)


def _sound(setting: StudyGeometry, every: MarkerPositions, path: Path, as_is: bool) -> Sound:
    """Positions without lost beams, moved frames, and visits of no use.

    Raises:
        UserError: Positions or angles are in other units.
    """
    seen, lost = _without_lost(every)
    if not seen.seen.any():
        raise UserError("no position of a marker is filled in, or all are zero", where=path)
    findings = [*lost, *_blank(every)]
    data = _on_robot(setting, seen, findings)
    if not len(data):
        raise UserError("no marker of the robot was seen in any row", where=path)
    data = _without_unseen(data, findings)
    counting = as_said(setting.study.robot)
    asked = setting.study.specification.parameters
    gross = GrossErrors()
    on_tool = [i for i, name in enumerate(data.markers) if name in setting.on_tool]
    rigid = data.absolute.of_markers(on_tool)
    if asked is not None and asked.base and asked.tool and rigid.seen.any():
        robot = setting.study.robot
        # Distances between markers need no robot: a false one is not to look like another counting.
        tool = rigid_tool(rigid)
        sound = tool.without_swapped(tool.without_apart(rigid))
        seen_there = sound[np.flatnonzero(sound.seen.any(axis=1))]
        counting = _counted(setting, seen_there, path, as_is, findings)
        gross = gross_errors(robot, counting.of(rigid), tool)
        # Absolute visits and markers on the tool come first, so that numbers are the same.
        data = tool.without_apart(counting.of(data))
    return Sound(data, gross, counting, tuple(findings))


def _on_robot(
    setting: StudyGeometry, seen: MarkerPositions, findings: list[Finding]
) -> MarkerPositions:
    """The markers on the robot, without rows of no use: absolute visits first, then differences.

    What an instrument's frame, a reach and points on the base say is said of absolute positions.
    """
    every, base = setting.split(seen.absolute)
    changes = setting.split(seen[seen.is_difference])[0]
    wires = np.array([name in setting.distances for name in every.markers])
    moved = every.of_markers(np.flatnonzero(~wires))
    if moved.seen.any():
        references = reference_points(base, moved)
        moved = _taken_back(moved, references.frames)
        moved, beyond = without_beyond_reach(moved, setting.study.robot.reach)
        moved, copied = without_copied_markers(moved)
        findings += [*references.findings, *beyond, *copied]
    if wires.any():
        moved = moved.with_markers(every.of_markers(np.flatnonzero(wires)))
    changes = changes.of_markers([changes.markers.index(name) for name in moved.markers])
    both = moved.with_visits(changes) if len(changes) else moved
    return both[np.flatnonzero(both.seen.any(axis=1))]


def _from_instrument(setting: StudyGeometry, data: MarkerPositions, where: Path) -> MarkerPositions:
    """Displacements from the nominal robot as absolute positions; others stay.

    Raises:
        UserError: Displacements under a load have no compliance to tell.
    """
    data = setting.as_positions(data)
    if data.differs is None:
        return data
    given = setting.study.specification
    if not given.joints.unknown and not setting.springs:
        raise UserError(
            "displacements under a load tell compliances alone, and the study asks for none; "
            f"expected {', '.join(LOADED_COLUMNS)} alone, or parameters.compliance",
            where=where,
        )
    return data


def _without_lost(data: MarkerPositions) -> tuple[MarkerPositions, list[Finding]]:
    """The positions without those at the origin of the instrument, which no beam has reached."""
    lost = data.lost
    if not lost.any():
        return data, []
    rows = tuple(sorted({int(row) for row in data.row[lost]}))
    names = tuple(data.markers[i] for i in np.flatnonzero(lost.sum(axis=0)))
    of = {"rows": rows, "markers": names, "positions": int(lost.sum())}
    return data.without_lost(), [Finding.of(Severity.WARNING, WORDING, "lost_beam", **of)]


def _blank(data: MarkerPositions) -> list[Finding]:
    """How many visits are filled in, and which cells of markers are empty in these."""
    made: Mask = np.any(data.seen, axis=1)
    said = []
    if not made.all():
        counts = {"made": int(made.sum()), "visits": len(data)}
        said.append(Finding.of(Severity.NOTE, WORDING, "unfinished", **counts))
    blank = (data.row >= 0) & ~data.seen & data.seen.any(axis=0) & made[:, None]
    if not blank.any():
        return said
    rows = tuple(sorted({int(row) for row in data.row[blank]}))
    names = tuple(data.markers[i] for i in np.flatnonzero(blank.any(axis=0)))
    return [*said, Finding.of(Severity.NOTE, WORDING, "blank", rows=rows, markers=names)]


def _without_unseen(data: MarkerPositions, findings: list[Finding]) -> MarkerPositions:
    """The positions without the markers that were seen nowhere."""
    kept = np.flatnonzero(data.seen.sum(axis=0))
    unseen = tuple(name for i, name in enumerate(data.markers) if i not in kept)
    if not unseen:
        return data
    findings.append(Finding.of(Severity.NOTE, WORDING, "unseen", markers=unseen))
    return data.of_markers(kept)


def _taken_back(data: MarkerPositions, frames: Array) -> MarkerPositions:
    """Positions in the frame in which the instrument was at most times."""
    moved = np.einsum("vij,vkj->vki", frames[:, :3, :3], data.measured) + frames[:, None, :3, 3]
    same = (frames == np.eye(4)).all(axis=(1, 2))
    turns = data.turns
    if turns is not None:
        turned = frames[:, None, :3, :3] @ turns
        turns = np.where(same[:, None, None, None], turns, turned)
    measured = np.where(same[:, None, None], data.measured, moved)
    return replace(data, measured=measured, turns=turns)


def _counted(
    setting: StudyGeometry,
    data: MarkerPositions,
    path: Path,
    as_is: bool,
    findings: list[Finding],
) -> Counting:
    """How the joints are counted, after units were checked.

    Raises:
        UserError: Positions or angles are in other units, and the sheet is not taken as it is.
    """
    robot = setting.study.robot
    same = as_said(robot)
    start = placed_by_most(robot, data)
    unit = _unit(start.scale) if start.whole else ""
    if unit and not as_is:
        raise UserError(
            f"positions look as if in {unit}: they are {start.scale:.3g} times as large as the "
            "robot's; expected millimetres",
            where=path,
        )
    if not far_off(start, data):
        return same
    if in_radians(robot, data) and not as_is:
        raise UserError(
            "the robot fits the positions if joint angles are taken as radians; expected degrees",
            where=path,
        )
    if in_metres(robot, data) and not as_is:
        raise UserError(
            "the robot fits the positions if prismatic joints are taken as metres; expected "
            "millimetres",
            where=path,
        )
    places = setting.model.offsets[[setting.markers.index(name) for name in data.markers]]
    found = find_counting(robot, data, places)
    if found is None:
        joint = None if as_is else one_in_radians(robot, data)
        if joint is not None:
            message = f"the positions fit if {joint} is taken as radians; expected degrees"
            raise UserError(message, where=path)
        return same
    if found.exchanged:
        if as_is:
            return same
        message = f"the positions fit if {found.words}; expected each joint in its own column"
        raise UserError(message, where=path)
    said = {"counting": found.words, "mirrored": start.mirrored}
    findings.append(Finding.of(Severity.WARNING, WORDING, "counting", **said))
    return found


def _unit(scale: float) -> str:
    """The unit that positions seem to be in; empty for millimetres."""
    for unit, size in SCALES.items():
        if abs(scale / size - 1) < SCALE_WITHIN:
            return unit
    return ""


def _lost_beam(data: Data) -> str:
    """Positions that no beam has reached."""
    of = ", ".join(data["markers"])
    said = f"{data['positions']} positions of {of} are zero, as of lost beams; they do not count"
    if data["positions"] == 1:
        said = f"1 position of {of} is zero, as of a lost beam; it does not count"
    return f"{rows_in_words(data['rows'])}: {said}"


def _counting(data: Data) -> str:
    """Joints that are counted otherwise than the study says."""
    mirrored = " (or if two coordinates of the positions are exchanged)" if data["mirrored"] else ""
    return (
        f"the positions fit if {data['counting']}{mirrored}, and so they were fitted; expected a "
        "[controller] that says so, see edtk controller"
    )


WORDING: Wording = {
    "lost_beam": _lost_beam,
    "unfinished": lambda data: (
        f"{data['made']} of {data['visits']} visits are filled in, the others left out"
    ),
    "blank": lambda data: (
        f"{rows_in_words(data['rows'])}: no position of {', '.join(data['markers'])}"
    ),
    "unseen": lambda data: (
        f"no row has positions of {', '.join(data['markers'])}; nothing is told of them"
    ),
    "counting": _counting,
}
