"""Which experiment of a plan each measurement is one of, and rows that are equal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from edtk.design.plan import Plan
from edtk.findings.finding import Data, Finding, Severity, Wording, row_names
from edtk.fit.correlated_noise import row_numbers
from edtk.fit.distributions import poisson_tail
from edtk.fit.measurements import Measurements
from edtk.measure.pose_table import DIGITS, pose_columns, pose_factors
from edtk.study.study import Study
from edtk.system.typing import Array, Indices

MOST_POSES = 2000  # of more, every second, third, ... is enough to tell how far robots bend
MOST_DIGITS = 9  # decimals of a millimetre or a degree that a reading is looked at to
SAME_READING = 1e-4  # of a decimal step: below that a number is a multiple of it, but for rounding
ROUNDING = 1e-9  # relative: a pose at the very limit counts as within
SAME_ANGLE = 1e-6  # of a decimal step: below that a number is a multiple of it, but for rounding
CHANCE = 1e-3  # probability of equal rows up to which they are copies
OTHER_LOAD = 0.25  # of the planned load: an applied load that is farther off is another one


def some_poses(pose: Indices) -> Indices:
    """Choose the rows of at most `MOST_POSES` poses, with all their repetitions.

    Args:
        pose: Number (m,) of each row's pose, counted from 0.
    """
    every = -(-(1 + int(pose.max())) // MOST_POSES)
    return np.flatnonzero(pose % every == 0)


def some_rows(count: int, most: int) -> Indices:
    """Choose rows by chance, as every second row may be of the same pose.

    Args:
        count: Number of rows.
        most: How many are wanted, at most.

    Returns:
        Rows in their order, counted from 0; all of them if they are not too many.
    """
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))


@dataclass(frozen=True)
class EqualRows:
    """Rows that are the same in all columns.

    Attributes:
        later: The first row, counted from 0, that repeats an earlier one.
        earlier: The row that it repeats.
        others: Number of further rows that repeat earlier ones.
        chance: Probability of so many, by the resolution of the readings.
    """

    later: int
    earlier: int
    others: int
    chance: float


def equal_rows(data: Measurements) -> EqualRows | None:
    """Find rows that are the same to the last digit; None where all are different.

    Two repetitions agree in a coordinate of resolution d with probability
    ``d / (2 sqrt(pi) sigma)`` at most, and the number of agreeing pairs is about Poisson's.
    """
    pose = data.places
    row = row_numbers(pose[:, None].astype(float), data.deflection)
    copies = np.ones(len(row), dtype=bool)
    copies[np.unique(row, return_index=True)[1]] = False
    if not copies.any():
        return None
    later = int(np.flatnonzero(copies)[0])
    earlier = int(np.flatnonzero(row == row[later])[0])
    turn = np.zeros(len(data), dtype=bool) if data.turn is None else data.turn
    kinds = [np.flatnonzero(~turn), np.flatnonzero(turn)]
    expected = sum(_agreeing(data[kind], pose[kind]) for kind in kinds if len(kind))
    chance = float(poisson_tail(pairs(row) - 1, expected))
    return EqualRows(later, earlier, int(copies.sum()) - 1, chance)


def _agreeing(data: Measurements, place: Indices) -> float:
    """Expected number of pairs of repetitions of a place that agree, of at most."""
    agree = _steps(data) / (2 * np.sqrt(np.pi) * data.sigma.mean(axis=0))
    return float(pairs(place) * np.minimum(agree, 1.0).prod())


def pairs(number: np.ndarray) -> float:
    """How many pairs have the same number."""
    counts = np.bincount(number)
    return float((counts * (counts - 1) / 2).sum())


def _steps(data: Measurements) -> Array:
    """Resolution (rows,) of the readings [m, rad]."""
    if data.turn is not None and data.turn.all():
        turned = resolution(data.deflection * 180 / np.pi) * np.pi / 180
        return np.full(1, turned)
    lengths = data.deflection[:, :3]
    steps = [np.full(lengths.shape[1], resolution(lengths * 1e3) / 1e3)]
    if data.deflection.shape[1] == 6:
        per_radian = 180 / np.pi
        turned = resolution(data.deflection[:, 3:] * per_radian) / per_radian
        steps.append(np.full(3, turned))
    return np.concatenate(steps)


def resolution(values: Array) -> float:
    """The decimal step 10^-d, d <= 9, that all values are multiples of."""
    for digits in range(MOST_DIGITS):
        scaled = values * 10.0**digits
        if np.abs(scaled - np.rint(scaled)).max() < SAME_READING:
            return float(10.0**-digits)
    return 10.0**-MOST_DIGITS


STEPS_DEG = (10.0, 5.0, 1.0, 0.5, 0.1)  # to which angles are rounded, the coarsest first
COARSE_DEG = 0.5  # no controller shows less: angles as coarse were rounded by a person
ROUNDED = 1e-6  # of a step: nearer to a multiple an angle is one, but for rounding
LIKE_ROUNDING = 0.6  # to its inverse: errors of joints beside those of rounding


def steps_of(degrees: Array) -> list[float]:
    """The usual steps that all angles are multiples of, the coarsest first [deg]."""
    off = [np.abs(degrees - step * np.round(degrees / step)).max() / step for step in STEPS_DEG]
    return [step for step, size in zip(STEPS_DEG, off, strict=True) if size < ROUNDED]


def like_rounding(size: float, rounding: float) -> bool:
    """Whether errors are as large as those of rounding, within a factor."""
    return LIKE_ROUNDING * rounding < size < rounding / LIKE_ROUNDING


LEAST = 10.0**-DIGITS  # [deg, mm]: plans have so many digits


class Visits(Protocol):
    """What was measured in some poses under loads: displacements, or positions."""

    @property
    def q(self) -> Array:
        """Joint variables (m, n) [rad or m]."""

    @property
    def wrench(self) -> Array:
        """Forces and torques (m, 6) [N, N m]."""


def pose_resolution(study: Study, data: Visits | None = None) -> float:
    """The digits that poses are written with [deg, mm].

    Those are the study's `plan_resolution_deg`, or the digits of the sheet if these are fewer.

    Args:
        study: The study.
        data: The measurements of a sheet, if its digits count.
    """
    steps = [LEAST, study.specification.workspace.plan_resolution_deg]
    if data is not None:
        steps.append(_printed_step(study.robot.shown(data.q) / pose_factors(study.robot)))
    return max(steps) * (1 + ROUNDING)


def _printed_step(values: Array) -> float:
    """The coarsest decimal step of the columns (m, n), as far as they have decimals.

    A column of whole numbers has the digits of the others: it may be a joint that stands still.
    """
    digits = []
    for column in values.T:
        scaled = column * 10.0 ** np.arange(DIGITS + 1)[:, None]
        whole = (np.abs(scaled - np.rint(scaled)) < SAME_ANGLE).all(axis=1)
        digits.append(int(whole.argmax()) if whole.any() else DIGITS)
    return float(10.0 ** -min((d for d in digits if d), default=0))


@dataclass(frozen=True, eq=False)
class PlanMatch:
    """Measurements beside the experiments of a plan, both counted from 0.

    Attributes:
        pose: Planned experiment (m,) whose pose is nearest.
        distance: How far that is (m,), in the joint where it is farthest [deg, mm].
        experiment: Of the planned experiments in that pose, the one (m,) whose load is the most
            similar.
        missing: Planned experiments (k,) that no measurement is one of.
        within: How far apart two poses are the same [deg, mm].
    """

    pose: Indices
    distance: Array
    experiment: Indices
    missing: Indices
    within: float


def match_plan(study: Study, data: Visits, plan: Plan) -> PlanMatch:
    """Find each measurement's experiment by its pose, and among several in one pose by its load.

    Args:
        study: Says, with the digits of the sheet, how far apart two poses are the same; see
            `pose_resolution`.
        data: The measurements.
        plan: The plan that was to be carried out.
    """
    from scipy.spatial import cKDTree

    factors = pose_factors(study.robot)
    within = pose_resolution(study, data)
    tree = cKDTree(study.robot.shown(plan.q) / factors)
    measured = study.robot.shown(data.q) / factors
    distance, pose = tree.query(measured, p=np.inf)
    experiment = pose.copy()
    in_pose = tree.query_ball_point(measured, within, p=np.inf, return_length=True)
    several = np.flatnonzero(in_pose > 1)
    found = tree.query_ball_point(measured[several], within, p=np.inf)
    for row, planned in zip(several, found, strict=True):
        candidates = np.array(sorted(planned))
        nearest = _most_similar(plan.wrench[candidates], data.wrench[row])
        experiment[row] = candidates[nearest]
    number = row_numbers(plan.q, plan.wrench)
    made = number[experiment[distance <= within]]
    missing = np.flatnonzero(~np.isin(number, made))
    return PlanMatch(pose, distance, experiment, missing, within)


def _most_similar(planned: Array, applied: Array) -> int:
    """Of planned wrenches (k, 6) the one that was applied (6,), as far as one can tell.

    That is the nearest. Where none is near, as with forces in another unit, it is the one whose
    direction is the most similar.
    """
    off = np.linalg.norm(planned - applied, axis=1)
    nearest = int(off.argmin())
    # The size of the farthest one is the scale, for the nearest may be zero.
    if off[nearest] <= OTHER_LOAD * np.linalg.norm(planned[off.argmax()]):
        return nearest
    return int((_direction(planned) @ _direction(applied[None])[0]).argmax())


def _direction(wrench: Array) -> Array:
    """Unit wrenches (k, 6); a wrench that is zero stays so."""
    return wrench / np.maximum(np.linalg.norm(wrench, axis=1, keepdims=True), 1e-300)


def other_pose(
    study: Study, data: Visits, plan: Plan, match: PlanMatch, rows: Sequence[Sequence[int]]
) -> Finding | None:
    """Find the first measured pose that is not planned, and the column that is farthest off.

    Args:
        study: Names the joints.
        data: The measurements.
        plan: The plan that was to be carried out.
        match: How they go together.
        rows: Rows of the file that each measurement is in, counted from 0.
    """
    others = np.flatnonzero(match.distance > match.within).tolist()
    if not others:
        return None
    robot = study.robot
    first = others[0]
    nearest = int(match.pose[first])
    off = np.abs(robot.shown_change(data.q[first] - plan.q[nearest])) / pose_factors(robot)
    joint = int(off.argmax())
    return Finding.of(
        Severity.ALARM,
        WORDING,
        "other_pose",
        rows=(rows[first][0],),
        columns=(pose_columns(robot)[joint],),
        nearest=nearest,
        distance=float(match.distance[first]),
        within=match.within,
        unit="mm" if robot.joints[joint].kind == "prismatic" else "deg",
        others=sum(len(rows[i]) for i in others) - 1,
    )


def not_measured(match: PlanMatch) -> list[Finding]:
    """Name the planned experiments without a measurement."""
    missing = tuple(match.missing.tolist())
    return [Finding.of(Severity.WARNING, WORDING, "not_measured", rows=missing)] if missing else []


def _other_pose(data: Data) -> str:
    """A measured pose that is not planned."""
    more = f"; {data['others']} more rows are not either" if data["others"] else ""
    return (
        f"row {data['rows'][0] + 1}, column {data['columns'][0]}: the pose is not in the plan; the "
        f"nearest planned one, row {data['nearest'] + 1}, is {data['distance']:.3g} "
        f"{data['unit']} away; expected {data['within']:.3g} at most (plan_resolution_deg in the "
        f"study's [workspace] allows more){more}"
    )


WORDING: Wording = {
    "other_pose": _other_pose,
    "not_measured": lambda data: f"{row_names(data['rows'])} of the plan: not measured",
}
