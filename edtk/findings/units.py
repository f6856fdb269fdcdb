"""Numbers that look like those of another unit, or like rounded ones."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from edtk.findings.causes.scene import counted_from
from edtk.findings.finding import Data, Finding, Severity, Wording, row_names
from edtk.findings.fitted_data import FittedData
from edtk.findings.match_plan import COARSE_DEG, OTHER_LOAD, STEPS_DEG, like_rounding, steps_of
from edtk.fit.equilibrium import NoFitError, fit_equilibrium
from edtk.fit.place_robot import rigid_motion
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.pose_table import WRENCH_COLUMNS
from edtk.measure.task import all_compliances
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.study.plausibility import is_like_radians
from edtk.study.study import Study
from edtk.system.typing import Array, Mask

UNITS = ((1 / 10, "centimetres"), (1 / 25.4, "inches"))
ENOUGH_FREEDOM = 5  # degrees of freedom from which residuals tell their size
SUSPECT_BELOW = 0.3  # residuals over sigma below which other units are tried
# Factor up to which residuals are as large as sigma says: the two units are 2.5 apart.
AS_LARGE = 1.5
USUAL_FORCES = 1.5  # factor up to which the median force is taken as the expected one
UNIT_FACTOR = 1.2  # factor up to which a ratio of forces is that of two units
FORCE_UNITS = (
    (1e-3, "kilonewtons"),
    (1e3, "millinewtons"),
    (1 / 9.81, "kilograms"),
    (1 / 4.448, "pounds"),
)
LENGTH_UNITS = ((1e-3, "metres"), (1e3, "micrometres"))
LENGTH_FACTOR = 10.0  # factor up to which a ratio of lengths is that of two units
MISPLACED = 0.01  # [m] positions beside those of the drawing: robots are some millimetres off
SCALED = 0.005  # lengths that come out longer together, from which it is said
ROTATION_FACTOR = 3.0  # the same of rotations


def small_unit(fitted: FittedData, ratio: float | None) -> str | None:
    """Find the unit in which displacements and residuals have the sizes that they should.

    A factor on all displacements is one on all compliances and on the residuals. The residuals in
    millimetres are smaller than sigma by the factor, and the displacements smaller than predicted.

    Args:
        fitted: The measurements and their fit.
        ratio: Size of the displacements over that of the predicted ones; None without assumed
            compliances, where a sigma that is as many times too large looks the same.

    Returns:
        The unit's name, in the plural; None where millimetres are as likely.
    """
    fit = fitted.fit
    if fit.dof < ENOUGH_FREEDOM or not fit.scale < SUSPECT_BELOW:
        return None
    found = []
    for factor, name in UNITS:
        near = ratio is None or ratio < np.sqrt(factor)
        off = abs(np.log(_noise(fitted, factor))) if near else np.inf
        if off < np.log(AS_LARGE):
            found.append((off, name))
    return min(found, key=lambda entry: entry[0])[1] if found else None


def _noise(fitted: FittedData, factor: float) -> float:
    """Residuals over sigma, where displacements are in a unit; inf where that does not fit."""
    study = fitted.study
    data = fitted.data
    data = replace(data, deflection=data.deflection / factor)
    start = all_compliances(study.model, fitted.fit.unbounded / factor)
    try:
        return fit_equilibrium(study.model, data, start)[1].scale
    except (NoEquilibriumError, NoFitError):
        return np.inf


def unit_findings(fitted: FittedData) -> Iterator[Finding]:
    """Compare forces, displacements, rotations and joint angles with what is expected."""
    forces = list(_forces(fitted))
    yield from forces
    # Displacements follow from the forces: another unit of these is not blamed on those.
    if all(one.severity < Severity.ALARM for one in forces):
        yield from _lengths(fitted)
    yield from _rotations(fitted)
    yield from _angles(fitted)
    yield from _rounded(fitted)


def _expected_load(fitted: FittedData) -> Array | None:
    """Wrenches (m, 6) of the plan, or else of a study whose load is fixed."""
    load = fitted.study.space.load
    if fitted.plan is not None and fitted.match is not None:
        return fitted.plan.wrench[fitted.match.experiment]
    if isinstance(load, FixedLoad):
        return np.broadcast_to(load.always, fitted.data.wrench.shape)
    return None


def _forces(fitted: FittedData) -> Iterator[Finding]:
    """Forces of another size than expected, or a load that is not the planned one."""
    expected = _expected_load(fitted)
    if expected is not None:
        rows = [(row,) for row in range(len(fitted.data))]
        yield from force_findings(expected, fitted.data.wrench, fitted.plan is not None, rows)


def force_findings(
    expected: Array, wrench: Array, planned: bool, rows: Sequence[Sequence[int]]
) -> Iterator[Finding]:
    """Compare forces with those that were to be applied.

    Args:
        expected: Wrenches (m, 6) that were to be applied [N, N m].
        wrench: Those that were (m, 6).
        planned: Whether a plan says what was to be applied, and not the study.
        rows: Rows of the file that each measurement is in, counted from 0.
    """
    size = np.linalg.norm(expected[:, :3], axis=1)
    applied = np.linalg.norm(wrench[:, :3], axis=1)
    both = (size > 0) & (applied > 0)
    ratio = float(np.median(applied[both] / size[both])) if both.any() else 1.0
    if not 1 / USUAL_FORCES < ratio < USUAL_FORCES:
        units = [
            unit for factor, unit in FORCE_UNITS if 1 / UNIT_FACTOR < ratio / factor < UNIT_FACTOR
        ]
        unit = units[0] if units else ""
        data = {"ratio": ratio, "planned": planned, "unit": unit}
        severity = Severity.ALARM if unit else Severity.WARNING
        yield Finding.of(severity, WORDING, "force_unit", columns=WRENCH_COLUMNS[:3], **data)
    elif planned:
        largest = np.abs(expected).max(axis=1)
        off = np.flatnonzero(np.abs(wrench - expected).max(axis=1) > OTHER_LOAD * largest).tolist()
        if off:
            named = tuple(sorted({row for one in off for row in rows[one]}))
            yield Finding.of(
                Severity.WARNING, WORDING, "other_load", rows=named, tolerance=OTHER_LOAD
            )


def _ratio(fitted: FittedData, chosen: Mask) -> float | None:
    """Size of measured coordinates (m, rows) over the predicted one.

    None without assumed compliances.
    """
    specification = fitted.study.specification
    if specification.simulation is None:
        return None
    given = specification.simulation.compliance_rad_per_Nm
    if any(name not in given for name in specification.joints.unknown):
        return None
    predicted = np.linalg.norm((fitted.linear_regressor @ fitted.study.compliances)[chosen])
    measured = np.linalg.norm(fitted.unexplained[chosen])
    return float(measured / predicted) if predicted > 0 else None


def _lengths(fitted: FittedData) -> Iterator[Finding]:
    """Displacements a thousand times too small or too large, within a factor of ten; or less.

    They are compared with the prediction; without one, the residuals are compared with sigma.
    """
    ratio = _ratio(fitted, fitted.data.lengths)
    predicted = ratio is not None
    if not predicted and fitted.fit.dof >= ENOUGH_FREEDOM:
        ratio = fitted.fit.scale
    if ratio is None:
        return
    for factor, unit in LENGTH_UNITS:
        if factor / LENGTH_FACTOR < ratio < factor * LENGTH_FACTOR:
            data = {"ratio": ratio, "predicted": predicted, "unit": unit}
            yield Finding.of(Severity.ALARM, WORDING, "length_unit", **data)
            return
    small = small_unit(fitted, ratio if predicted else None)
    if small is not None:
        data = {"ratio": ratio, "predicted": predicted, "unit": small}
        # Residuals alone may be as small because sigma is too large.
        severity = Severity.ALARM if predicted else Severity.WARNING
        yield Finding.of(severity, WORDING, "length_unit", **data)


def _rotations(fitted: FittedData) -> Iterator[Finding]:
    """Rotations 57 times too small, within a factor of three."""
    turns = ~fitted.data.lengths
    if not turns.any():
        return
    ratio = _ratio(fitted, turns)
    if ratio is not None and 1 / ROTATION_FACTOR < ratio * 180 / np.pi < ROTATION_FACTOR:
        yield Finding.of(Severity.ALARM, WORDING, "rotation_unit", ratio=ratio)


def like_radians(study: Study, q: Array) -> bool:
    """Whether poses (m, n) are all within 2 pi degrees of zero, and differ or are no typed ones."""
    turning = _turning(study)
    if not turning:
        return False
    degrees = np.rad2deg(study.robot.shown(q)[:, turning])
    near = np.abs(degrees).max() <= 2 * np.pi
    return bool(near and (np.ptp(degrees, axis=0).any() or is_like_radians(degrees[0])))


def _angles(fitted: FittedData) -> Iterator[Finding]:
    """Joint angles in radians."""
    if like_radians(fitted.study, fitted.data.q):
        yield Finding.of(Severity.ALARM, WORDING, "angle_unit")


def _turning(study: Study) -> list[int]:
    """The joints whose angles a sheet has to say."""
    joints = study.robot.joints
    free = [j for j in range(len(joints)) if j not in study.fixed]
    return [j for j in free if joints[j].kind == "revolute"]


def _rounded(fitted: FittedData) -> Iterator[Finding]:
    """Joint angles that were rounded, or look so, with what that would cost.

    Rounding to steps h leaves errors that are uniform, of standard deviation ``h / sqrt(12)``, in
    each joint and pose. Commands may be whole degrees: they are doubted only where the residuals
    are as large as rounding would leave them, or where the plan has other digits. Where rounding
    errs by less than the noise, residuals do not tell, and it is noted what it would make.
    """
    study = fitted.study
    joints = _turning(study)
    if not joints:
        return
    steps = steps_of(np.rad2deg(study.robot.shown(fitted.data.q)[:, joints]))
    if not steps:
        return
    kept = [step for step in STEPS_DEG if step <= study.specification.workspace.plan_resolution_deg]
    planned = fitted.plan is not None
    if fitted.plan is not None:
        kept += steps_of(np.rad2deg(study.robot.shown(fitted.plan.q)[:, joints]))
    excess = float(np.sqrt(max(fitted.fit.scale**2 - 1, 0.0)))
    of_one_degree = _rounding(fitted, joints)
    for step in steps:
        if step in kept:
            continue
        rounding = step * of_one_degree
        hidden = rounding < 1
        if hidden and step < COARSE_DEG:
            continue
        explains = not hidden and excess > 1 and like_rounding(excess, rounding)
        # Of steps that all angles are multiples of, the coarsest is the one they were rounded to.
        if not (explains or hidden or (planned and step == steps[0])):
            continue
        data = {
            "step": step,
            "planned": planned,
            "rounding": rounding,
            "scale": fitted.fit.scale,
            "explains": explains,
        }
        alone = explains and not fitted.structural_causes
        severity = Severity.ALARM if alone else Severity.WARNING
        if hidden and not planned:
            yield Finding.of(Severity.NOTE, WORDING, "coarse_angles", **data)
        else:
            yield Finding.of(severity, WORDING, "rounded_angles", **data)
        return


def _rounding(fitted: FittedData, joints: list[int]) -> float:
    """Errors by angles that are rounded to degrees, over the noise (root mean square)."""
    model = replace(fitted.study.model, unknown=(*fitted.study.model.joints, *fitted.study.known))
    k = np.concatenate([fitted.fit.k, np.array(list(fitted.study.known.values()))])
    std = np.deg2rad(1.0) / np.sqrt(12)
    squares = np.zeros(fitted.data.deflection.shape)
    for j in joints:
        predict = counted_from(model, fitted.data, j)
        (A, b), (before, shift) = predict(np.array([std])), predict(np.array([-std]))
        squares += (((A - before) @ k + b - shift) / 2) ** 2
    return float(np.sqrt((squares / fitted.data.own_sigma**2).mean()))


def place_findings(fitted: FittedData) -> Iterator[Finding]:
    """Compare positions without load with the drawing, whatever frame they are in.

    The drawing with its marker is brought to them by the rigid motion that fits best, so that two
    poses suffice: they have a distance. What is left no displacement shows: links or zeros of
    joints that are not those of the robot, or a marker elsewhere.
    """
    data = fitted.data
    if data.unloaded is None:
        return
    flange = fitted.study.robot.forward(data.q)
    drawn = flange[:, :3, 3] + (flange[:, :3, :3] @ data.marker[..., None])[..., 0]
    base = rigid_motion(drawn, data.unloaded)
    left = drawn @ base[:3, :3].T + base[:3, 3] - data.unloaded
    size = float(np.sqrt((left**2).sum() / len(data)))
    if size > MISPLACED:
        spread = [float(np.linalg.norm(x - x.mean(axis=0))) for x in (data.unloaded, drawn)]
        scale = spread[0] / max(spread[1], 1e-12)
        step = _rounded_place(fitted, size)
        told = {"off": size, "scale": scale, "step": step}
        yield Finding.of(Severity.WARNING, WORDING, "other_robot", **told)


def _rounded_place(fitted: FittedData, size: float) -> float:
    """The step [deg] to which angles were rounded, if that moves the marker by a size [m]; or 0."""
    data, robot = fitted.data, fitted.study.robot
    joints = _turning(fitted.study)
    steps = steps_of(np.rad2deg(robot.shown(data.q)[:, joints])) if joints else []
    std = np.deg2rad(1.0) / np.sqrt(12)
    squares = 0.0
    for j in joints:
        ends = [robot.forward(data.q + side * std * np.eye(robot.n)[j]) for side in (0.5, -0.5)]
        there, back = (T[:, :3, 3] + (T[:, :3, :3] @ data.marker[..., None])[..., 0] for T in ends)
        squares += float(((there - back) ** 2).sum()) / len(data)
    of_one_degree = float(np.sqrt(squares))
    return next((step for step in steps if like_rounding(size, step * of_one_degree)), 0.0)


def _other_robot(data: Data) -> str:
    """Positions that are not those of the drawing."""
    if data["step"]:
        return (
            f"without load the marker is {1e3 * data['off']:.3g} mm (root mean square) from where "
            "the study's robot has it, wherever the base is placed, as far as rounding to "
            f"{data['step']:g} deg moves it, and all joint angles are multiples of that: were they "
            "rounded? Export them with three decimals"
        )
    scale = f"{abs(data['scale'] - 1):.1%} {'longer' if data['scale'] > 1 else 'shorter'}"
    lengths = f", and lengths come out {scale}" if abs(data["scale"] - 1) > SCALED else ""
    return (
        f"without load the marker is {1e3 * data['off']:.3g} mm (root mean square) from where the "
        f"study's robot has it, wherever the base is placed{lengths}: are links and zeros of the "
        "joints those of this robot, and is the marker where the study has it? Displacements grow "
        "with the arm, and so do the compliances"
    )


def _force_unit(data: Data) -> str:
    """Forces of another size than expected."""
    whose = "the plan" if data["planned"] else "the study's [load]"
    unit = data["unit"]
    why = "; expected those that were applied, in newtons"
    if unit:
        why = f": are they in {unit}? expected newtons"
    ratio = data["ratio"]
    return f"columns Fx_N to Fz_N: the forces are {ratio:.3g} times those of {whose}{why}"


def _other_load(data: Data) -> str:
    """Loads that are not those planned."""
    within = f"{100 * data['tolerance']:g} %"
    rows = row_names(data["rows"])
    return f"{rows}: the load is not the one planned in this pose; expected it within {within}"


def _length_unit(data: Data) -> str:
    """Displacements a thousand times off."""
    ratio = f"{data['ratio']:.2g}"
    size = f"the residuals are {ratio} times sigma"
    if data["predicted"]:
        size = f"the displacements are {ratio} times those that the study's [simulation] predicts"
    return f"{size}: are they in {data['unit']}? expected millimetres"


def _rotation_unit(data: Data) -> str:
    """Rotations in radians."""
    ratio = f"{data['ratio']:.2g}"
    return f"the rotations are {ratio} times those predicted: are they in radians? expected degrees"


def _angle_unit(data: Data) -> str:
    """Joint angles in radians."""
    return "all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"


def _rounded_angles(data: Data) -> str:
    """Joint angles that were rounded."""
    step = f"{data['step']:g} deg"
    plan = ", and those of the plan are not" if data["planned"] else ""
    size = f"rounding to {step} makes errors of {data['rounding']:.2g} times the noise"
    left = f", and the residuals are {data['scale']:.2g} times it" if data["explains"] else ""
    return (
        f"all joint angles are multiples of {step}{plan}; {size}{left}: were they rounded? Export "
        "them with three decimals"
    )


def _coarse_angles(data: Data) -> str:
    """Joint angles that may have been rounded, where no residual shows it."""
    return (
        f"all joint angles are multiples of {data['step']:g} deg. If they were rounded, each "
        f"reading is off by {data['rounding']:.2g} times the noise, which residuals do not show: "
        "export them with three decimals"
    )


WORDING: Wording = {
    "force_unit": _force_unit,
    "other_load": _other_load,
    "length_unit": _length_unit,
    "rotation_unit": _rotation_unit,
    "angle_unit": _angle_unit,
    "rounded_angles": _rounded_angles,
    "coarse_angles": _coarse_angles,
    "other_robot": _other_robot,
}
