"""What the file of a calibration holds for commands, predictions and pictures, written and read.

Commands and predictions need the table `prediction` of compliances alone, or `geometry`; pictures
of the measured poses need `poses`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from criteria.linalg.spectrum import is_semidefinite
from edtk.calibration.propagation import FittedSprings, root_of
from edtk.design.plan import Plan
from edtk.findings.counting import Counting
from edtk.findings.moving_joints import ReadingNoise
from edtk.fit.fitted_geometry import RIGID, UNTOLD, Circumstances, FittedGeometry
from edtk.measure.compliances import LEAST_DOF
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.noise import Tracker
from edtk.measure.parameters import Parameter, all_parameters
from edtk.measure.position_noise import BlockVariances, PositionNoise
from edtk.robots.frames import MM
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, study_marks
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.parsing import not_negative_of, numbers_of, parse_json
from edtk.system.typing import Array, Indices

MOST_ENTRIES = 1000  # parameters or joints in a file
MOST_MB = 100.0  # of a file
ORTHONORMAL = 1e-9
ASYMMETRY = 1e-8  # of a covariance's entries, beside the standard deviations
SAME = 1e-6  # relative difference of marks that rounding may leave
OTHERWISE = {
    "shown": "the study's controller counts joints otherwise than when the result was made",
    "loads": "the study's load point, payload or masses are not those of the result",
}
POSSIBLE = "possible_springs"  # key of what errors of the model leave possible
OTHER_ROBOT = "the result is of another robot or tool than the study's"
MOST_POSES = 2000  # of a file, which people read too
POSE_KEYS = ("q", "wrench", "repeats", "residual_mm")


Left = TypeVar("Left")


def possible_springs(
    given: object, read: Callable[[Mapping[str, Any]], Left], where: Path | str, key: str = POSSIBLE
) -> Left | None:
    """What errors of the model leave possible, as a file says it; None where it does not.

    Args:
        given: What stands there.
        read: Reads the table.
        where: The file, for messages.
        key: The place in it.

    Raises:
        UserError: It is not valid.
    """
    if given is None:
        return None
    try:
        if not isinstance(given, Mapping):
            raise ValueError(f"{POSSIBLE}: expected a table")
        return read(given)
    except ValueError as error:
        raise UserError(str(error), where=where, key=key) from error


def geometry_result(given: object) -> Mapping[str, Any]:
    """The keys of a result, `geometry` among them.

    Args:
        given: What the file of a calibration holds, or its path.

    Raises:
        UserError: It is no such result.
    """
    where = given if isinstance(given, str | Path) else None
    content: Any = given if where is None else parse_json(read_text(where, MOST_MB), where)
    if not isinstance(content, Mapping) or not isinstance(content.get("geometry"), Mapping):
        message = "no result of a study with [parameters]; expected what edtk identify --json wrote"
        raise UserError(message, where=where or "result")
    return content


def springs_to_dict(springs: FittedSprings, robot: Robot) -> dict[str, Any]:
    """The table `prediction`, in SI units but `repeatability_deg` and `discrepancy_mm`."""
    noise = springs.noise
    joints, model = (None, None) if noise.joints is None else noise.joints
    return {
        "robot": robot.digest,
        **({"compensators": robot.compensators_digest} if robot.compensators else {}),
        "joints": [robot.joint_names[j] for j in springs.joints],
        "k": springs.k.tolist(),
        "covariance": (springs.root @ springs.root.T).tolist(),
        "covariance_beside": (springs.beside @ springs.beside.T).tolist(),
        "dof": springs.dof if np.isfinite(springs.dof) else None,
        "open": springs.open.T.tolist(),
        "noise_ratio": noise.ratio,
        "repeatability_deg": joints,
        "discrepancy_mm": None if model is None else MM * model,
    }


def springs_of_dict(robot: Robot, given: Mapping[str, Any]) -> FittedSprings:
    """Those of the table `prediction`.

    Raises:
        ValueError: A number is missing, or none.
    """
    names = given.get("joints")
    every = robot.joint_names
    if not isinstance(names, list) or len(set(map(str, names))) < len(names):
        raise ValueError("joints: expected a list of names, each once")
    unknown = [name for name in names if name not in every]
    if unknown:
        raise ValueError(f"joints: the robot has no joint {unknown[0]!r}")
    a = len(names)
    opened = given.get("open")
    if not isinstance(opened, list) or len(opened) > a:
        raise ValueError("open: expected a list of errors")
    dof = np.inf if given.get("dof") is None else float(not_negative_of(given, "dof", ()))
    joints = None
    if given.get("repeatability_deg") is not None:
        model = float(not_negative_of(given, "discrepancy_mm", ())) / MM
        joints = float(not_negative_of(given, "repeatability_deg", ())), model
    beside, key = np.zeros((a, 0)), "covariance_beside"  # which older files do not tell apart
    return FittedSprings(
        joints=tuple(every.index(name) for name in names),
        k=numbers_of(given, "k", (a,)),
        root=root_of(covariance_of(given, "covariance", a)),
        dof=max(dof, LEAST_DOF),
        open=numbers_of(given, "open", (len(opened), a)).T,
        noise=ReadingNoise(float(not_negative_of(given, "noise_ratio", ())), joints),
        beside=root_of(covariance_of(given, key, a)) if key in given else beside,
    )


def geometry_to_dict(fitted: FittedGeometry, counting: Counting) -> dict[str, Any]:
    """All that a prediction needs, besides the study.

    Lengths are in metres, parameters in their own units (mm, mrad, 1e-6 rad/(N m)).
    """
    noise = fitted.noise
    found = noise.model_fit
    return {
        "robot": fitted.model.robot.digest,
        "markers": list(fitted.model.markers),
        "base": fitted.model.start.tolist(),
        "offsets_m": np.asarray(fitted.model.offsets).tolist(),
        "placed_m": fitted.placed.tolist(),
        **(
            {}
            if fitted.placed_turns is None
            else {"placed_turns_rad": fitted.placed_turns.tolist()}
        ),
        "names": [one.name for one in fitted.model.parameters],
        "values": fitted.values.tolist(),
        "covariance": fitted.covariance.tolist(),
        "open": [one.name for one in fitted.open_parameters],
        "shares": fitted.shares.tolist(),
        **_circumstances_to_dict(fitted.circumstances),
        "counting": counting.matrix.tolist(),
        "counting_words": counting.words,
        "noise": {
            "reading_mm": noise.reading,
            "joints_mrad": np.asarray(noise.joints).tolist(),
            "model_white_mm": noise.model_white,
            "model_joints_mrad": np.asarray(noise.model_joints).tolist(),
            "variances": [] if found is None else found.variances.tolist(),
            "variances_covariance": [] if found is None else found.covariance.tolist(),
            "repeats": noise.repeats,
            **(
                {}
                if noise.turn is None
                else {"turn_mrad": noise.turn, "model_turn_mrad": noise.model_turn}
            ),
            **({"sigma_unknown": True} if noise.unknown else {}),
            **({} if noise.tracker is None else {"tracker": _tracker_to_dict(noise.tracker)}),
            **({"model_change": list(noise.model_change)} if any(noise.model_change) else {}),
        },
    }


def geometry_of_dict(
    given: Mapping[str, Any], setting: StudyGeometry
) -> tuple[FittedGeometry, Counting]:
    """The fitted geometry of a result.

    Args:
        given: The table `geometry` of a result.
        setting: The study that it is of.

    Raises:
        ValueError: It is none of this study; the message says what is wrong.
    """
    model = setting.model
    if given.get("robot") != model.robot.digest:
        raise ValueError(f"robot: {OTHER_ROBOT}")
    every = {one.name: one for one in model.parameters}
    kept = _named(given, "names", every)
    opened = _named(given, "open", every)
    if len({one.name for one in (*kept, *opened)}) < len(kept) + len(opened):
        raise ValueError("names: expected each once, in names or in open")
    n = model.robot.n
    p = len(kept)
    values = numbers_of(given, "values", (p,))
    fitted_model = model.with_parameters(tuple(kept))
    fitted_model = replace(
        fitted_model,
        start=_pose(given, "base"),
        offsets=numbers_of(given, "offsets_m", (len(model.markers), 3)),
    )
    if given.get("markers") != list(model.markers):
        raise ValueError(f"markers: expected {', '.join(model.markers)}, those of the study")
    fitted = FittedGeometry(
        fitted_model,
        values * fitted_model.scales,
        covariance_of(given, "covariance", p),
        tuple(opened),
        numbers_of(given, "shares", (p, len(opened))),
        _noise(given.get("noise"), setting),
        numbers_of(given, "placed_m", (len(model.markers), 3)),
        # Results of full poses that are older do not have them; commands ask for them.
        numbers_of(given, "placed_turns_rad", (len(model.markers), 3))
        if "placed_turns_rad" in given and setting.full_poses
        else None,
        _circumstances(given.get("circumstances"), fitted_model, setting),
    )
    words = given.get("counting_words", "")
    return fitted, Counting(numbers_of(given, "counting", (n, n)), str(words))


def _circumstances_to_dict(found: Circumstances | None) -> dict[str, Any]:
    """What no reading tells; nothing where nothing is known of it."""
    if found is None:
        return {}
    joints = [
        {
            "joint": one.name,
            "rad_per_Nm": one.compliance,
            "std_rad_per_Nm": one.std,
            "source": one.source,
        }
        for one in found.joints
    ]
    errors = {name: E.tolist() for name, E in found.roots.items()}
    others = [one.name for one in found.others]
    return {"circumstances": {"joints": joints, "others": others, "errors": errors}}


def _circumstances(
    given: object, model: MeasuredModel, setting: StudyGeometry
) -> Circumstances | None:
    """What no reading tells; None in results that are older.

    Args:
        given: The table of a result.
        model: The parameters that were identified.
        setting: What loads the joints.

    Raises:
        ValueError: It is not valid.
    """
    if given is None:
        return None
    if not isinstance(given, Mapping) or not isinstance(given.get("errors"), Mapping):
        raise ValueError("circumstances: expected a table with the table errors")
    names = model.robot.joint_names
    joints = []
    for one in given.get("joints", ()):
        if not isinstance(one, Mapping) or one.get("joint") not in names:
            raise ValueError(f"circumstances.joints: expected joints among {', '.join(names)}")
        taken, std = (
            float(not_negative_of(one, key, ())) for key in ("rad_per_Nm", "std_rad_per_Nm")
        )
        name = one["joint"]
        joints.append(AssumedJoint(name, names.index(name), taken, std, str(one.get("source"))))
    places = all_parameters(model.robot, model.markers, (), names, base=False, tool=True)
    others = tuple(_named(given, "others", {one.name: one for one in places}))
    errors = given["errors"]
    widths = {name: _width(errors[name]) for name in UNTOLD if name in errors}
    widths[RIGID] = sum(one.rigid for one in joints)
    rows = model.p + len(others)
    roots = {name: numbers_of(errors, name, (rows, width)) for name, width in widths.items()}
    loads = setting.every_load
    return Circumstances(tuple(joints), others, roots, loads, setting.untold(loads))


def _width(rows: object) -> int:
    """How many columns rows of a file have, by the first of them."""
    return len(rows[0]) if isinstance(rows, list) and rows and isinstance(rows[0], list) else 0


def _named(given: Mapping[str, Any], key: str, every: Mapping[str, Parameter]) -> list[Parameter]:
    """Parameters by their names.

    Raises:
        ValueError: A name is not that of a parameter of the study.
    """
    names = given.get(key)
    if not isinstance(names, list) or len(names) > MOST_ENTRIES:
        raise ValueError(f"{key}: expected a list of names")
    for name in names:
        if not isinstance(name, str) or name not in every:
            raise ValueError(f"{key}: the study has no parameter {name!r}")
    return [every[name] for name in names]


def _tracker_to_dict(tracker: Tracker) -> dict[str, Any]:
    """A tracker in the frame of the sheet."""
    return {
        "position_m": tracker.position.tolist(),
        "along_m": list(tracker.along),
        "across_m": list(tracker.across),
    }


def _tracker(given: object) -> Tracker | None:
    """The tracker of a result; None where it has none.

    Raises:
        ValueError: A number is missing.
    """
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise ValueError("tracker: expected a table")
    along, across = (not_negative_of(given, key, (2,)).tolist() for key in ("along_m", "across_m"))
    position = numbers_of(given, "position_m", (3,))
    return Tracker(position, (along[0], along[1]), (across[0], across[1]))


def _noise(given: object, setting: StudyGeometry) -> PositionNoise:
    """The noise.

    Raises:
        ValueError: A number is missing.
    """
    if not isinstance(given, Mapping):
        raise ValueError("noise: expected a table")
    n = setting.study.robot.n
    full_poses = setting.full_poses
    found = None
    variances = given.get("variances")
    if not isinstance(variances, list) or len(variances) > MOST_ENTRIES:
        raise ValueError("variances: expected a list of numbers")
    if variances:
        c = len(variances)
        found = BlockVariances(
            not_negative_of(given, "variances", (c,)),
            covariance_of(given, "variances_covariance", c),
            float("nan"),
        )
    noise = PositionNoise(
        float(not_negative_of(given, "reading_mm", ())),
        not_negative_of(given, "joints_mrad", (n,)),
        float(not_negative_of(given, "model_white_mm", ())),
        not_negative_of(given, "model_joints_mrad", (n,)),
        found,
        int(not_negative_of(given, "repeats", ())),
        float(not_negative_of(given, "turn_mrad", ())) if full_poses else None,
        float(not_negative_of(given, "model_turn_mrad", ())) if full_poses else 0.0,
        tracker=_tracker(given.get("tracker")),
        unknown=given.get("sigma_unknown") is True,
        tracked=setting.tracked,
        ratios=setting.noise.ratios,
        model_change=_changes(given),
    )
    if found is None or not noise.changes:
        return noise
    # Earlier results take the size of a change as known, and do not have it among the others.
    change = np.square(noise.model_change)[: noise.changes]
    if np.allclose(found.variances[-noise.changes :], change, atol=0):
        return noise
    known = np.pad(found.covariance, (0, noise.changes))
    found = replace(found, variances=np.append(found.variances, change), covariance=known)
    return replace(noise, model_fit=found)


def _changes(given: Mapping[str, Any]) -> tuple[float, float]:
    """What the model leaves out of differences [mm, mrad]."""
    if "model_change" not in given:
        return (0.0, 0.0)
    position, turn = not_negative_of(given, "model_change", (2,)).tolist()
    return (position, turn)


def covariance_of(given: Mapping[str, Any], key: str, order: int) -> Array:
    """A covariance (order, order).

    Raises:
        ValueError: The key has other numbers.
    """
    values = numbers_of(given, key, (order, order))
    size = np.sqrt(np.abs(np.diag(values)))
    is_symmetric = (np.abs(values - values.T) <= ASYMMETRY * np.outer(size, size)).all()
    if not is_symmetric or not is_semidefinite(values):
        raise ValueError(f"{key}: expected a covariance, symmetric and positive semidefinite")
    return values


def _pose(given: Mapping[str, Any], key: str) -> Array:
    """A pose (4, 4).

    Raises:
        ValueError: The key has other numbers.
    """
    values = numbers_of(given, key, (4, 4))
    R = values[:3, :3]
    bottom = np.array([0.0, 0.0, 0.0, 1.0])
    is_rotation = np.allclose(R @ R.T, np.eye(3), atol=ORTHONORMAL) and np.linalg.det(R) > 0
    if not is_rotation or not np.array_equal(values[3], bottom):
        raise ValueError(f"{key}: expected a pose, a rotation and a place")
    return values


def read_geometry(
    study: Study, geometry: Mapping[str, Any], where: Path | str
) -> tuple[StudyGeometry, FittedGeometry, Counting]:
    """The setting, the fitted geometry, and how its sheet counted the joints.

    Args:
        study: The study of the calibration.
        geometry: The table `geometry` of its result.
        where: The result, for messages.

    Raises:
        UserError: The table is not valid, or of another study.
    """
    setting = StudyGeometry.of_result(study, geometry.get("markers"))
    try:
        fitted, counting = geometry_of_dict(geometry, setting)
    except ValueError as error:
        raise UserError(str(error), where=where, key="geometry") from error
    _require_same(geometry.get("study", {}), setting, where)
    return setting, fitted, counting


def _require_same(given: object, setting: StudyGeometry, where: Path | str) -> None:
    """Check the marks of the study; older results have none.

    Raises:
        UserError: One differs.
    """
    if not isinstance(given, Mapping):
        raise UserError("expected a table", where=where, key="geometry.study")
    for name, own in study_marks(setting).items():
        if name not in given:
            continue
        try:
            mark = np.array(given[name], dtype=float)
        except (TypeError, ValueError, OverflowError):
            mark = np.array(np.nan)
        size = float(np.abs(own).max(initial=1.0))
        if mark.shape != own.shape or not (np.abs(mark - own) <= SAME * size).all():
            raise UserError(OTHERWISE[name], where=where, key=f"geometry.study.{name}")


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """Poses in the order of the sheet.

    Attributes:
        plan: The poses, their loads, and how many rows of the sheet each has.
        residual: Root mean square of the distances of its readings from the fit (k,) [m]; NaN where
            nothing but rotations was read.
    """

    plan: Plan
    residual: Array

    @classmethod
    def of(cls, plan: Plan, pose: Indices, square: Array) -> "MeasuredPoses":
        """Those of a fit.

        Args:
            plan: The poses, each once.
            pose: Which of them each reading is of (r,).
            square: Squared distances of markers from the fit (r, k) [m^2]; NaN where none was seen.
        """
        seen = np.isfinite(square)
        count = np.bincount(pose, weights=seen.sum(axis=1), minlength=len(plan.q))
        size = np.where(seen, square, 0.0).sum(axis=1)
        total = np.bincount(pose, weights=size, minlength=len(plan.q))
        return cls(plan, np.sqrt(total / np.where(count > 0, count, np.nan)))

    def to_list(self) -> list[dict[str, Any]]:
        """A table for each of the first poses, SI but for the residual."""
        rows = zip(self.plan.q, self.plan.wrench, self.plan.repeats, self.residual, strict=True)
        return [
            {
                "q": q.tolist(),
                "wrench": wrench.tolist(),
                "repeats": int(repeats),
                "residual_mm": 1e3 * float(residual) if np.isfinite(residual) else None,
            }
            for q, wrench, repeats, residual in list(rows)[:MOST_POSES]
        ]

    @classmethod
    def from_list(cls, given: object, joints: int, where: object) -> "MeasuredPoses":
        """The poses of a file.

        Args:
            given: What `to_list` gave.
            joints: Number of joints of the robot.
            where: The file, for messages.

        Raises:
            UserError: It is none, or of another robot.
        """
        expected = f"expected a table for each pose with {', '.join(POSE_KEYS)}"
        if not isinstance(given, list) or not given:
            raise UserError(expected, where=str(where), key="poses")
        columns: dict[str, list[Any]] = {key: [] for key in POSE_KEYS}
        for i, row in enumerate(given):
            key = f"poses[{i + 1}]"
            if not isinstance(row, Mapping) or not set(POSE_KEYS) <= set(row):
                raise UserError(expected, where=str(where), key=key)
            if isinstance(row["q"], list) and len(row["q"]) != joints:
                message = f"has {len(row['q'])} joints; expected the {joints} of the study's robot"
                raise UserError(message, where=str(where), key=key)
            for name in POSE_KEYS:
                columns[name].append(np.nan if row[name] is None else row[name])
        try:
            q, wrench, residual = (
                np.array(columns[name], dtype=float) for name in ("q", "wrench", "residual_mm")
            )
            plan = Plan(q, wrench, np.array(columns["repeats"], dtype=int))
        except (TypeError, ValueError) as error:
            raise UserError(expected, where=str(where), key="poses") from error
        return cls(plan, residual / 1e3)
