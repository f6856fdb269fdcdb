"""The checks of a study that need its robot and the criteria, beyond those of single keys."""

from dataclasses import replace

import numpy as np

import criteria
from edtk.cell.cell import standing_at
from edtk.measure.instruments.sensor import Sensor
from edtk.robots.compensator import SAMPLES
from edtk.robots.frames import Frames
from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import Beyond, Robot, shown_limits
from edtk.study.schema import Specification
from edtk.study.study_model import distance_names, marker_kinds, marker_names
from edtk.study.study_objects import StudyObjects
from edtk.study.study_parts import check_limits
from edtk.study.study_sight import check_sight, sample_poses
from edtk.system.typing import Array

# Displacement of the tool by 1 rad/(N m) below which a load turns no joint: what rounding leaves.
LEAST_HARM = 1e-9  # [m]
KEY_OF_KIND = {"revolute": "fixed_deg", "prismatic": "fixed_mm"}
# No tracker measures nearer to its own head, which the arm must not touch either.
NEAREST = 0.5  # [m]
IN_METRES = 0.1  # a tracker this near to the world's origin may be given in metres [m]
SAMPLED_POSES = 2048  # poses within the limits, in which the arm is looked at
STARTS = 32  # of these, from which a marker is moved towards the tracker
STEPS = 20
DAMPING = 1e-3  # of a step, beside the squared reach
FEW_POSES = 64  # poses in which covariances are looked at
LEAST_EIGENVALUE = 1e-10  # of a correlation matrix: below it Cholesky loses ten of 16 digits


def check_tasks(study: StudyObjects) -> None:
    """Check that a study's tasks make sense for its robot.

    Raises:
        UserError: One line that names the study or the file of the path, the key and what was
            expected.
    """
    specification = study.specification
    if specification.task is not None and specification.test_pose is not None:
        raise study.error("task", "expected one of [test_pose] and [task], the study has both")
    for i, pose in enumerate(specification.test_poses):
        key = study.key_of(i)
        if len(pose.q_deg) != study.robot.n:
            raise study.error(
                f"{key}.q_deg",
                f"has {len(pose.q_deg)} entries, expected {study.robot.n}, one per joint",
            )
    if not study.tasks:
        return
    _check_weights(study)
    if specification.task is None:
        check_limits(study, np.array([task.q for task in study.tasks]))
    # Geometry has no such target: it is in error in every pose, whatever the load turns.
    if study.target is not None and np.abs(study.target).max() < LEAST_HARM:
        where = "in the test pose" if len(study.tasks) == 1 else "in any of the test poses"
        raise study.error(
            "test_pose.load" if specification.task is None else "task.load",
            f"the load turns no joint of joints.unknown {where}, so that there is nothing "
            "to compensate; expected another load, tool or pose",
        )


def _check_weights(study: StudyObjects) -> None:
    if not any(task.weight for task in study.tasks):
        raise study.error(
            f"{study.key_of(0)}.weight",
            "the weights of all test poses are 0; expected one above it",
        )


def check_study(study: StudyObjects) -> None:
    """Check that the keys of a study fit its robot, each other and the criteria that there are.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    specification = study.specification
    study.kind.check(study)
    _check_joint_names(study, specification, study.robot)
    _check_fixed_joints(study, specification, study.robot)
    _check_measurement(study, specification)
    check_markers(study)
    check_noise(study)
    check_sight(study, study.sight)
    _check_compensators(study)
    _check_home(study)
    _check_speeds(study)
    check_tasks(study)
    _check_criteria(study, specification)
    if specification.interest is not None:
        study.kind.check_interest(study, specification.interest)


def _check_home(study: StudyObjects) -> None:
    """The home pose has a number for each joint, within its limits."""
    scene = study.specification.scene
    if scene is None or scene.home_deg is None:
        return
    if len(scene.home_deg) != study.robot.n:
        message = f"has {len(scene.home_deg)} entries, expected {study.robot.n}, one per joint"
        raise study.error("scene.home_deg", message)
    assert study.home is not None
    beyond = np.flatnonzero(study.robot.bounds.excess(study.home) > AT_LIMIT)
    if len(beyond):
        found = Beyond.of(study.robot, study.home, int(beyond[0]))
        low, high = found.limits
        message = f"{found.name} = {found.value:g} is outside its limits {low:g} .. {high:g}"
        raise study.error("scene.home_deg", message)


def _check_speeds(study: StudyObjects) -> None:
    """Speeds by name are of joints that there are, in their own unit."""
    costs = study.specification.costs
    kinds = {joint.name: joint.kind for joint in study.robot.joints}
    for key, kind in (("speed_deg_per_s", "revolute"), ("speed_mm_per_s", "prismatic")):
        given = None if costs is None else getattr(costs, key)
        for name in given if isinstance(given, dict) else ():
            if kinds.get(name) != kind:
                those = [one for one, own in kinds.items() if own == kind]
                has = ", ".join(those) if those else "none"
                message = f"no {kind} joint {name!r}; this robot has {has}"
                raise study.error(f"costs.{key}", message)


def _check_joint_names(study: StudyObjects, specification: Specification, robot: Robot) -> None:
    for key in ("unknown", "known_rad_per_Nm", "fixed_deg", "fixed_mm"):
        for name in getattr(specification.joints, key):
            if name not in robot.joint_names:
                names = ", ".join(robot.joint_names)
                follows = {tied.name: tied.masters for tied in robot.tied}
                what = f"no joint {name!r}"
                if name.partition(".")[0] in robot.joint_names:
                    what += " ([parameters] springs asks for springs across joints and for laws)"
                if name in follows:
                    masters = " and ".join(map(repr, follows[name]))
                    what = f"joint {name!r} follows {masters} and has no spring of its own"
                raise study.error(f"joints.{key}", f"{what}; this robot has {names}")
    for name in specification.joints.known_rad_per_Nm:
        if name in specification.joints.unknown:
            raise study.error(
                f"joints.known_rad_per_Nm.{name}",
                "the joint is among joints.unknown too; expected it in one of them",
            )


def _check_fixed_joints(study: StudyObjects, specification: Specification, robot: Robot) -> None:
    """Fixed values are given in the joint's own unit, and lie within its limits."""
    for key in KEY_OF_KIND.values():
        for name in getattr(specification.joints, key):
            kind = robot.joints[robot.joint_names.index(name)].kind
            if key != KEY_OF_KIND[kind]:
                message = f"the joint is {kind}; give its value in {KEY_OF_KIND[kind]}"
                raise study.error(f"joints.{key}.{name}", message)
    _check_fixed_leaders(study, robot)
    q = np.array([study.fixed.get(j, 0.0) for j in range(robot.n)])
    moving = np.delete(robot.bounds.rows, list(study.fixed), axis=1).any(axis=1)
    for row in np.flatnonzero((robot.bounds.excess(q) > 0) & ~moving):
        joint = robot.joints[robot.bounds.of[row]]
        key = f"joints.{KEY_OF_KIND[joint.kind]}.{joint.name}"
        raise study.error(key, "the value is outside the joint's limits")


def _check_fixed_leaders(study: StudyObjects, robot: Robot) -> None:
    """A joint that follows another one stays where it is only if that one does."""
    if robot.controller is None:
        return
    for j in study.fixed:
        for leader in robot.controller.leaders(j):
            if leader not in study.fixed:
                joint = robot.joints[j]
                name = robot.joint_names[leader]
                raise study.error(
                    f"joints.{KEY_OF_KIND[joint.kind]}.{joint.name}",
                    f"the joint follows {name}, which moves, and so would it; expected {name} "
                    "among the fixed joints too, or neither of them",
                )


def _check_compensators(study: StudyObjects) -> None:
    """No compensator takes more stiffness than a joint of the guessed compliance has."""
    gives = study.model.gives
    if gives is None:
        return
    robot = study.robot
    for pull in gives.pulls:
        j = robot.joint_names.index(pull.given.joint)
        fixed = study.fixed.get(j)
        lower, upper = robot.limits[:, j] if fixed is None else (fixed, fixed)
        q = np.linspace(lower, upper, SAMPLES)
        taken = pull.derivative(q)
        k = float(gives.compliances[j])
        worst = int(taken.argmax())
        if k * taken[worst] >= 1:
            at = shown_limits(robot)[j].of(float(q[worst])) / robot.units[j]
            raise study.error(
                "robot.compensator",
                f"the arm would snap at {pull.given.joint} = {at:.4g} deg: the compensator takes "
                f"{taken[worst]:.3g} N m/rad there from a spring of {1 / k:.3g}, as [simulation], "
                "[prior] or known compliances say; expected other numbers, or limits without it",
            )


def _check_measurement(study: StudyObjects, specification: Specification) -> None:
    unknown = specification.joints.unknown
    if len(set(unknown)) < len(unknown):
        raise study.error("joints.unknown", "a joint is named twice")


def _check_criteria(study: StudyObjects, specification: Specification) -> None:
    # `criteria` defaults to `optimise`, so a wrong name in both is reported where it was written.
    for key in ("optimise", "criteria"):
        for name in getattr(specification, key):
            try:
                criterion = criteria.get(name)
            except criteria.CriterionError as error:
                raise study.error(key, str(error)) from error
            study.kind.check_criterion(study, key, name)
            if criterion.needs_target and not study.tasks:
                raise study.error(key, f"criterion {name!r} needs a [test_pose], and there is none")
            if key == "optimise" and not issubclass(criterion, criteria.Relaxable):
                raise study.error(
                    key,
                    f"criterion {name!r} has no convex form to optimise; it can only be compared",
                )


def check_markers(study: StudyObjects) -> None:
    """Check names and bodies of markers and distances, and the noise and weights that they need.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    _check_names(study)
    _check_bodies(study)
    _check_rows(study)
    measurement = study.specification.measurement
    kinds = set(marker_kinds(study))
    if "pose" in (kinds or {measurement.rows}) and measurement.sigma_deg is None:
        raise study.error(
            "measurement.sigma_deg", "expected, since rows = 'pose' measures rotations too"
        )
    if measurement.reference == "nominal" and not any(link.mass for link in study.robot.links):
        raise study.error(
            "measurement.reference",
            "'nominal' positions see the weight of the links, and the robot file gives no masses; "
            "expected mass_kg and center_m of its joints, or reference = 'unloaded'",
        )


def _check_names(study: StudyObjects) -> None:
    """Each name once, and distances that end at markers that there are."""
    markers = marker_names(study)
    distances = distance_names(study)
    for key, names, before in (("marker", markers, ()), ("distance", distances, markers)):
        for i, name in enumerate(names):
            if name in (*before, *names[:i]):
                raise study.error(f"{key}.{i}.name", f"{name!r} is named twice")
    for i, distance in enumerate(study.specification.distance):
        if distance.marker is not None and distance.marker not in markers:
            known = ", ".join(markers) or "none"
            raise study.error(
                f"distance.{i}.marker", f"no marker {distance.marker!r}; this study has {known}"
            )


def _check_bodies(study: StudyObjects) -> None:
    """Markers and distances sit on bodies of this robot."""
    known = study.kind.bodies(study.robot)
    bodies = [(f"marker.{i}", one.joint) for i, one in enumerate(study.specification.marker)]
    bodies += [(f"distance.{i}", one.joint) for i, one in enumerate(study.specification.distance)]
    for key, joint in bodies:
        if joint is not None and joint not in known:
            raise study.error(
                f"{key}.joint", f"no joint {joint!r}; this robot has {', '.join(known)}"
            )


def _check_rows(study: StudyObjects) -> None:
    """The rows of a sheet can be told apart: "a x" is a coordinate of a marker "a"."""
    names = [sensor.name for sensor in study.model.sensors]
    for i, name in enumerate(names):
        if name in names[:i]:
            key = "distance" if name in distance_names(study) else "marker"
            raise study.error(key, f"{name!r} is the name of a row in sheets; expected another one")


def check_noise(study: StudyObjects) -> None:
    """Check that the noise is whole, and that its tracker can stand where it does.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    _check_white(study)
    table = study.specification.noise
    if table is None:
        return
    given = table.repeatability_deg
    if len(given) not in (1, study.robot.n):
        raise study.error(
            "noise.repeatability_deg",
            f"has {len(given)} entries, expected {study.robot.n}, one per joint, or one number",
        )
    q = sample_poses(study, SAMPLED_POSES)
    if table.has_tracker:
        _check_place(study, q)
    _check_regular(study, q[:FEW_POSES])


def _check_white(study: StudyObjects) -> None:
    """White noise is given wherever no tracker stands in for it."""
    measurement = study.specification.measurement
    table = study.specification.noise
    if measurement.sigma_mm is not None:
        return
    if table is None or not table.has_tracker:
        without = "" if table is None else " without a tracker in [noise]"
        raise study.error(
            "measurement.sigma_mm",
            f"this key is required{without}: Standard deviation of a displacement, per coordinate "
            "[mm]",
        )
    for i, distance in enumerate(study.specification.distance):
        if distance.sigma_mm is None:
            raise study.error(
                f"distance.{i}.sigma_mm",
                "expected, since the tracker does not measure it and there is no "
                "measurement.sigma_mm",
            )


def _check_place(study: StudyObjects, q: Array) -> None:
    """The tracker is in no body, and neither arm nor marker come near, as a search can tell."""
    tracker = np.array(study.specification.noise.tracker_position_mm) / 1e3  # type: ignore[union-attr]
    within = None if study.cell is None else standing_at(study.cell.bodies, tracker)
    if within is not None:
        name, depth = within
        raise study.error(
            "noise.tracker_position_mm",
            f"the tracker stands {1e3 * depth:.0f} mm inside {name!r}; expected a place outside of "
            "all bodies of [scene]",
        )
    frames = study.model.frames(q)
    near = _distance_of_arm(frames, study.robot.base[:3, 3], tracker)
    for sensor in study.model.whole_instruments:
        near = min(near, _distance_of_marker(study, sensor, q, frames, tracker))
    if near < NEAREST:
        unit = "; is it given in metres?" if np.linalg.norm(tracker) < IN_METRES else ""
        raise study.error(
            "noise.tracker_position_mm",
            f"the tracker stands inside the arm's reach: arm or marker come within "
            f"{1e3 * near:.0f} mm of it, expected at least {1e3 * NEAREST:.0f} mm{unit}",
        )


def _distance_of_arm(frames: Frames, base: Array, tracker: Array) -> float:
    """Least distance [m] of the line through base, joints and tool point from the tracker."""
    shape = frames.position.shape
    start = np.broadcast_to(base.reshape(3, *[1] * (len(shape) - 1)), shape)
    points = np.concatenate([start[None], frames.origins, frames.position[None]])
    away = points - tracker.reshape(3, *[1] * (len(shape) - 1))
    along = np.diff(away, axis=0)
    length = np.maximum(np.square(along).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(-(away[:-1] * along).sum(axis=1) / length, 0.0, 1.0)
    nearest = away[:-1] + share[:, None] * along
    return float(np.sqrt(np.square(nearest).sum(axis=1).min()))


def _distance_of_marker(
    study: StudyObjects, sensor: Sensor, q: Array, frames: Frames, tracker: Array
) -> float:
    """Least distance [m] of a marker from the tracker: of sampled poses, and downhill of the best.

    Steps are those of Gauss and Newton, damped, and end at the joint limits.
    """
    lower, upper = study.robot.limits
    away = sensor.point.position(frames) - tracker[:, None]
    q = q[np.argsort(np.square(away).sum(axis=0))[:STARTS]]
    movable = np.array([j not in study.fixed for j in range(study.robot.n)])
    damping = DAMPING * study.robot.reach**2
    least = np.inf
    for _ in range(STEPS):
        frames = study.model.frames(q)
        away = sensor.point.position(frames) - tracker[:, None]
        least = min(least, float(np.sqrt(np.square(away).sum(axis=0).min())))
        J = frames.folded(sensor.point.linear(frames)).transpose(2, 1, 0) * movable
        normal = J @ J.transpose(0, 2, 1) + damping * np.eye(3)
        step = (J.transpose(0, 2, 1) @ np.linalg.solve(normal, away.T[..., None]))[..., 0]
        q = np.clip(q - step, lower, upper)
    return least


def _check_regular(study: StudyObjects, q: Array) -> None:
    """No combination of measured rows is free of errors, joints and discrepancy left aside.

    In some poses a joint moves no marker along some direction; errors of the tracker, or white
    noise, must be left there.
    """
    noise = study.noise
    if noise is None:
        return
    frames = study.model.frames(q)
    size = np.sqrt(np.einsum("rrk->rk", noise.scatter_of(study.model, frames)))
    size = np.maximum(size, np.finfo(float).tiny)
    still = replace(noise, repeatability=np.zeros(study.robot.n))
    scaled = still.scatter_of(study.model, frames) / size[:, None] / size
    if np.linalg.eigvalsh(np.moveaxis(scaled, -1, 0)).min() < LEAST_EIGENVALUE:
        raise study.error(
            "noise",
            "some combination of the measured rows has next to no error; expected larger errors "
            "of the tracker along and across its beam, or measurement.sigma_mm",
        )
