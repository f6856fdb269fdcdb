"""What a study measures and what loads its robot, as the model needs it, and in words."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from edtk.measure.elastostatic_model import ElastostaticModel, Rows
from edtk.measure.expected_error import (
    SAMPLE,
    SHORTEST,
    AssumedJoint,
    Likely,
    as_neighbours,
    by_load,
    levers,
)
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.one_row import OneRow
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.measured_model import Kind
from edtk.measure.model_error import ASSUMED, ModelError, groups_of
from edtk.measure.noise import VisitNoise
from edtk.measure.parameters import Parameter, numbers_asked, springs_asked
from edtk.measure.pose_table import pose_factors
from edtk.robots.compensator import GivingWay
from edtk.robots.frames import BodyPoint
from edtk.robots.weights import GRAVITY, DeadWeights
from edtk.study.asked import Asked
from edtk.study.tables_of_measurement import MarkerTable, NoiseTable
from edtk.study.tables_of_task import PayloadTable, TaskTable, TestPose
from edtk.system.fields import Vector3
from edtk.system.typing import Array, Mask

KNOWN = "known_rad_per_Nm"
ROWS = ("x", "y", "z", "rx", "ry", "rz")
BASE = "base"  # the body of a marker that the robot does not move
READINGS = {"unloaded": 2, "nominal": 1}  # by what a displacement is measured from


def assumed_joints(
    study: Asked, k: Array | None = None, untold: Collection[str] = ()
) -> tuple[AssumedJoint, ...]:
    """List the joints that are not identified, from base to tip.

    A known joint may be off by its standard deviation. A revolute joint without a known compliance
    counts as rigid, and is off by the compliance that it has. That is what the study says of it
    (`rigid_rad_per_Nm`, then `[simulation]`), or else follows from its neighbours by load capacity,
    see `as_neighbours`, and without any from the load.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints; default to those of [simulation], as far as it
            has any [rad/(N m)].
        untold: Unknown joints that no reading tells, which count as rigid, too.
    """
    known = study.specification.joints.known
    likely = likely_compliances(study, k)
    found = []
    for index, joint in enumerate(study.robot.joints):
        if index in study.unknown and joint.name not in untold:
            continue
        if joint.name in known:
            one = known[joint.name]
            found.append(AssumedJoint(joint.name, index, one.value, one.deviation, KNOWN))
        elif joint.name in likely:
            size, source = likely[joint.name].compliance, likely[joint.name].source
            found.append(AssumedJoint(joint.name, index, 0.0, size, source))
    return tuple(found)


def springs_of(study: Asked) -> tuple[Parameter, ...]:
    """The unknown compliances of a study as parameters, for their words."""
    joints = [study.robot.joints[j] for j in study.unknown]
    return tuple(
        Parameter("compliance", one.name, slides=one.kind == "prismatic") for one in joints
    )


def other_springs(study: Asked) -> tuple[Parameter, ...]:
    """The springs that a study asks for besides the joints' own compliances."""
    table = study.specification.parameters
    if table is None:
        return ()
    return tuple(one for one in springs_asked(study.robot, table.springs) if one.place == "spring")


def compensator_numbers(study: Asked) -> tuple[Parameter, ...]:
    """The numbers of compensators that a study asks for.

    Raises:
        ValueError: An entry of `parameters.compensators` names none.
    """
    table = study.specification.parameters
    return () if table is None else numbers_asked(study.robot, table.compensators)


def likely_compliances(study: Asked, k: Array | None = None) -> dict[str, Likely]:
    """The compliance that each revolute joint is likely to have, by name.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints, those that are not positive count as not known;
            default to those of [simulation].
    """
    given = study.specification
    simulated = {} if given.simulation is None else given.simulation.compliance_rad_per_Nm
    told = {name: Likely(size, "[simulation]") for name, size in simulated.items()}
    stated = given.uncertainty.rigid_rad_per_Nm
    told |= {name: Likely(size, "rigid_rad_per_Nm") for name, size in stated.items()}
    near = _neighbours(study, simulated, k)
    lever = levers(study.robot)
    force = largest_force(study)
    found = {}
    for j, joint in enumerate(study.robot.joints):
        if joint.kind == "revolute":
            guess = as_neighbours(lever, near, j, study.robot.joint_names) if near else None
            found[joint.name] = told.get(joint.name) or guess or by_load(float(lever[j]), force)
    return found


def with_likely_sizes(study: Asked, springs: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Springs, with the size that each is likely to have at most: as soft as the joint itself.

    A law of the torque turns the joint under the largest load as far as its compliance does,
    ``c tau^power = k tau``.

    Args:
        study: The study.
        springs: Those besides the joints' own compliances.
    """
    if not springs:
        return ()
    joints = {name: one.compliance for name, one in likely_compliances(study).items()}
    largest = dict(
        zip(study.robot.joint_names, largest_force(study) * levers(study.robot), strict=True)
    )
    return tuple(
        replace(one, likely=joints[one.of] * largest[one.of] ** (1 - one.power))
        if one.of in joints and largest[one.of]
        else one
        for one in springs
    )


def _neighbours(study: Asked, simulated: Mapping[str, float], k: Array | None) -> dict[int, float]:
    """Compliances of the revolute joints of which something is known, by index [rad/(N m)]."""
    joints = study.robot.joints
    unknown = study.specification.joints.unknown
    sizes = dict(simulated) if k is None else dict(zip(unknown, k.tolist(), strict=True))
    near = study.known | {study.robot.joint_names.index(name): k for name, k in sizes.items()}
    return {j: size for j, size in near.items() if size > 0 and joints[j].kind == "revolute"}


def largest_force(study: Asked) -> float:
    """Size of the largest load at the tool point, of calibration or task, torques by the reach [N].

    A robot is chosen for what it shall do as well as for what it is calibrated with.
    """
    given = study.specification
    reach = max(study.robot.reach, SHORTEST)
    tasks: list[TestPose | TaskTable] = [*given.test_poses]
    tasks += [] if given.task is None else [given.task]
    sizes = [0.0]
    for one in tasks:
        sizes += [] if one.load is None else [_size(one.load.build(), reach)]
        sizes += [] if one.payload is None else [GRAVITY * one.payload.mass_kg]
    if given.load is not None or given.payload is not None:
        load = given.build_load()
        cube = np.random.default_rng(0).random((SAMPLE, load.limits.shape[1]))
        sizes.append(_size(load.wrench(load.draw(cube)), reach))
    return max(sizes)


def _size(wrench: Array, reach: float) -> float:
    """The largest of some wrenches (..., 6), torques by the reach [N]."""
    size = np.linalg.norm(wrench[..., :3], axis=-1)
    turn = np.linalg.norm(wrench[..., 3:6], axis=-1)
    return float(np.max(size + turn / reach))


def study_model(study: Asked, unknown: tuple[int, ...]) -> ElastostaticModel:
    """The elastostatic model of a study: its robot, instruments, load point and weights.

    Args:
        study: Its keys and its robot, checked.
        unknown: Indices of the joints whose compliances are the parameters.
    """
    given = study.specification
    return ElastostaticModel(
        study.robot,
        unknown,
        given.measurement.rows,
        sensors=_sensors(study),
        load_point=_load_point(study),
        weights=_weights(study),
        own_weights=None if study.is_absolute else _links(study),
        gives=giving_way(study),
    )


def giving_way(study: Asked, brought: bool = False) -> GivingWay | None:
    """How joints with compensators give way; None without any.

    That is about what the study knows or guesses, in [simulation] or [prior]. A joint of which it
    says nothing counts as rigid, unless numbers of its compensator are unknown: then it is as its
    neighbours, see `likely_compliances`.

    Args:
        study: Its keys and its robot, checked.
        brought: Whether poses are those under load, as in a task.
    """
    k = np.zeros(study.robot.n)
    k[list(study.known)] = list(study.known.values())
    k[list(study.unknown)] = np.nan_to_num(own_scale(study))
    likely = likely_compliances(study) if compensator_numbers(study) else {}
    for j in study.unknown:
        if not k[j] and study.robot.joint_names[j] in likely:
            k[j] = likely[study.robot.joint_names[j]].compliance
    return study.robot.giving_way(k, brought)


def study_sigma(study: Asked) -> Array:
    """Standard deviation of each measured row (rows,) [m, rad], one instrument after another.

    Zero for lengths whose noise is that of a tracker alone.
    """
    given = study.specification
    default = (given.measurement.sigma_mm or 0.0) / 1e3
    turn = np.deg2rad(given.measurement.sigma_deg or 0)
    kinds = list(marker_kinds(study))
    if not kinds and not given.distance:
        kinds = [given.measurement.rows]
    rows: list[float] = []
    for kind in kinds:
        rows += [default] * 3 + ([turn] * 3 if kind == "pose" else [])
    for distance in given.distance:
        rows.append(default if distance.sigma_mm is None else distance.sigma_mm / 1e3)
    return np.array(rows)


def marker_kinds(study: Asked) -> tuple[Rows, ...]:
    """What is measured of each marker: of points on the base positions alone."""
    given = study.specification
    return tuple(
        "position" if is_reference(study, one) else one.rows or given.measurement.rows
        for one in given.marker
    )


def marker_names(study: Asked) -> tuple[str, ...]:
    """Names of the markers, in their order; those without one are numbered."""
    markers = study.specification.marker
    return tuple(marker.name or f"marker {i + 1}" for i, marker in enumerate(markers))


def on_robot(study: Asked) -> list[tuple[MarkerTable, str]]:
    """The markers that the robot moves, with their names."""
    every = zip(study.specification.marker, marker_names(study), strict=True)
    return [(marker, name) for marker, name in every if not is_reference(study, marker)]


def is_reference(study: Asked, marker: MarkerTable) -> bool:
    """Whether a marker stands on the base, and shows whether that moves.

    Only absolute positions see it: see `Kind.bodies`.
    """
    return marker.joint == BASE and BASE not in study.robot.body_names


def distance_names(study: Asked) -> tuple[str, ...]:
    """Names of the distances, in their order; those without one are numbered."""
    distances = study.specification.distance
    return tuple(one.name or f"distance {i + 1}" for i, one in enumerate(distances))


def instrument_kinds(study: Asked) -> dict[str, Kind]:
    """What is read of each marker and distance, by name; of points on the base positions."""
    usual = study.specification.measurement.rows
    found: dict[str, Kind] = dict.fromkeys(marker_names(study), "position")
    found |= {name: marker.rows or usual for marker, name in on_robot(study)}
    return found | dict.fromkeys(distance_names(study), "distance")


def _sensors(study: Asked) -> tuple[Sensor, ...]:
    """Markers, then distances; empty where nothing but the tool point is measured."""
    given = study.specification
    markers = on_robot(study)
    names = tuple(name for _, name in markers)
    points = [_point(study, marker.position_mm, marker.joint) for marker, _ in markers]
    found: list[Sensor] = []
    kinds = [marker.rows or given.measurement.rows for marker, _ in markers]
    for kind, name, point in zip(kinds, names, points, strict=True):
        found.append(Marker(point, name) if kind == "position" else PoseMarker(point, name))
    for distance, name in zip(given.distance, distance_names(study), strict=True):
        point = _point(study, distance.position_mm, distance.joint)
        if distance.marker is not None:
            point = points[names.index(distance.marker)]
        found.append(Distance(point, name, np.array(distance.anchor_mm) / 1e3))
    return _in_rows(found)


def _in_rows(sensors: list[Sensor]) -> tuple[Sensor, ...]:
    """Instruments; of several kinds by single rows, which one sheet can hold."""
    if len({type(sensor) for sensor in sensors}) < 2:
        return tuple(sensors)
    found: list[Sensor] = []
    for sensor in sensors:
        if isinstance(sensor, Distance):
            found.append(sensor)
        else:
            names = [f"{sensor.name} {row}" for row in ROWS[: sensor.rows]]
            found += [OneRow(sensor.point, name, sensor, i) for i, name in enumerate(names)]
    return tuple(found)


def _point(study: Asked, position_mm: Vector3, joint: str | None) -> BodyPoint:
    """A point of the tool, or of the body of a joint."""
    index = None if joint is None else study.robot.body_names.index(joint)
    return BodyPoint(np.array(position_mm) / 1e3, index)


def _load_point(study: Asked) -> BodyPoint:
    """Where the wrench acts: as [load] says, or where the payload's weight does."""
    given = study.specification
    if given.load is not None:
        return BodyPoint(np.array(given.load.at_mm) / 1e3)
    return _payload_point(study)


def _payload_point(study: Asked, payload: PayloadTable | None = None) -> BodyPoint:
    """A payload's centre of mass, on the body of the last joint: a longer tool does not move it.

    Tools and payloads are given in the frame of the flange.
    """
    payload = payload or study.specification.payload
    if payload is None:
        return BodyPoint()  # nothing loads a study of geometry alone
    flange = study.robot.flange
    return BodyPoint(flange[:3, :3] @ payload.center + flange[:3, 3], len(study.robot.chain) - 1)


def task_weights(study: Asked, payload: PayloadTable | None) -> DeadWeights | None:
    """All that loads the joints in a task besides its wrench.

    Args:
        study: The study.
        payload: What the robot carries in the task; None for nothing.
    """
    return _held(study, payload, link_weights(study))


def absolute_task_weights(study: Asked, payload: PayloadTable | None) -> DeadWeights | None:
    """The same where positions are absolute, so that the links' weights always count."""
    return _held(study, payload, _links(study))


def link_weights(study: Asked) -> DeadWeights | None:
    """The weights of the links, where displacements are measured from the nominal robot.

    Differences of a loaded and an unloaded reading do not see them, as they bend the robot in both.
    """
    return _links(study) if study.is_absolute else None


def _links(study: Asked) -> DeadWeights | None:
    """The weights of the links, and the compensators; None where neither is known."""
    links = {joint: link for joint, link in enumerate(study.robot.links) if link.mass}
    pulls = study.robot.pulls
    if not links and not pulls:
        return None
    centers = tuple(BodyPoint(link.center, joint) for joint, link in links.items())
    masses = tuple(link.mass for link in links.values())
    return DeadWeights(masses, centers, len(study.robot.chain), pulls)


def own_task_weights(study: Asked) -> DeadWeights | None:
    """What bends the robot of a task with and without its load, where that matters.

    Displacements see it to the second order only, which is of any size with a compensator alone.
    """
    return _links(study) if study.robot.pulls and not study.is_absolute else None


def own_weights(study: Asked) -> tuple[DeadWeights | None, DeadWeights | None]:
    """The weights of the links, and of a payload beside a load, for absolute positions."""
    payload = None if study.specification.load is None else study.specification.payload
    return _links(study), _held(study, payload, None)


def _weights(study: Asked) -> DeadWeights | None:
    """All that loads the joints besides the wrench: a payload beside a load, and the links."""
    return _held(study, _beside_load(study), link_weights(study))


def payload_beside_load(study: Asked) -> DeadWeights | None:
    """The weight of a payload that a study has besides [load]; without one it is the load."""
    return _held(study, _beside_load(study), None)


def _beside_load(study: Asked) -> PayloadTable | None:
    return None if study.specification.load is None else study.specification.payload


def _held(
    study: Asked, payload: PayloadTable | None, links: DeadWeights | None
) -> DeadWeights | None:
    """The weights of a payload and of links, either of which there may not be."""
    if payload is None:
        return links
    point = _payload_point(study, payload)
    held = DeadWeights((payload.mass_kg,), (point,), len(study.robot.chain))
    return held if links is None else held.with_more(links)


def study_noise(study: Asked, model: ElastostaticModel) -> VisitNoise | None:
    """Build the noise of the rows that the model of a study has; None where it is white.

    Tracker and discrepancy concern lengths. Rotations have the noise of `measurement.sigma_deg`,
    and distances that of their own instrument, besides what the joints do to both.

    Args:
        study: Its keys and its robot, checked.
        model: Its model.
    """
    table = study.specification.noise
    if table is None or table.is_white:
        return None
    return _visit_noise(study, model, table)


def promised_noise(study: Asked, model: ElastostaticModel) -> VisitNoise | None:
    """The same, with what springs likely leave out where the study says nothing of that.

    The error that is expected of a plan rests on it, and its poses do not.
    """
    table = promised_table(study)
    return None if table.is_white else _visit_noise(study, model, table)


def promised_table(study: Asked) -> NoiseTable:
    """What a study says of the noise, with the share that springs likely leave out, if nothing."""
    table = study.specification.noise or NoiseTable()
    if table.says_of_model:
        return table
    return table.model_copy(update={"model_error_percent": 100 * ASSUMED})


def _visit_noise(study: Asked, model: ElastostaticModel, table: NoiseTable) -> VisitNoise:
    """The noise of a table, with springs that leave out a share of what they do."""
    lengths: list[bool] = []
    tracked: list[tuple[int, int]] = []
    for point, sensor in enumerate(model.whole_instruments):
        if table.has_tracker and not isinstance(sensor, Distance):
            tracked.append((point, len(lengths)))
        lengths += sensor.lengths.tolist()
    return VisitNoise(
        **table.reading(pose_factors(study.robot)),
        tracked=tuple(tracked),
        white=study_sigma(study),
        readings=READINGS[study.specification.measurement.reference],
        groups=groups_of(model.whole_instruments),
        **left_out(study, table, np.array(lengths)),
    )


def left_out(
    study: Asked, table: NoiseTable, lengths: Mask, springs: bool = True, unit: float = 1.0
) -> dict[str, Any]:
    """What the model leaves out, as a `VisitNoise` takes it.

    Args:
        study: Its keys and its robot, checked.
        table: What it says of the noise.
        lengths: Which rows (rows,) are lengths.
        springs: Whether there are any, of which a share can be left out.
        unit: What a metre is in the units of the rows.
    """
    share = (table.model_error_percent or 0.0) / 100 if springs else 0.0
    return {
        "discrepancy": np.where(lengths, table.discrepancy_mm / (1e3 / unit), 0.0),
        "within": float(np.deg2rad(table.within)),
        "error": ModelError.of_share(unit * guessed_compliances(study), share) if share else None,
    }


def own_scale(study: Asked) -> Array:
    """Compliances (p,) as far as a study knows them: simulated, or from before; else NaN."""
    given = study.specification
    simulated = given.simulation.compliance_rad_per_Nm if given.simulation is not None else {}
    earlier = given.prior.earlier.mean_rad_per_Nm if given.prior.earlier is not None else {}
    medians = {name: one.median_rad_per_Nm for name, one in given.prior.joints.items()}
    known = {name: k for name, k in medians.items() if k is not None} | dict(earlier) | simulated
    return np.array([abs(known.get(name, np.nan)) for name in given.joints.unknown])


def guessed_compliances(study: Asked) -> Array:
    """Compliances (n,) of all joints, of which an error of the model is a share [rad/(N m)].

    Those that are unknown are as [simulation] or [prior] guesses; joints that are neither unknown
    nor known are rigid.

    Raises:
        UserError: The study guesses none of an unknown joint.
    """
    guess = own_scale(study)
    names = study.specification.joints.unknown
    for name, size in zip(names, guess, strict=True):
        if not np.isfinite(size):
            raise study.error(
                "noise.model_error_percent",
                f"is a share of what the springs do; expected a guess for joint {name!r} in "
                "simulation.compliance_rad_per_Nm",
            )
    k = np.zeros(study.robot.n)
    k[list(study.known)] = list(study.known.values())
    k[list(study.unknown)] = guess
    return k


def describe_measured(study: Asked) -> str:
    """How many markers, poses and distances, and what they are measured from.

    Args:
        study: Its keys, checked.
    """
    since = ", from the nominal robot" if study.is_absolute else ""
    given = study.specification
    if not on_robot(study) and not given.distance:
        return f"{given.measurement.rows}{since}"
    kinds = marker_kinds(study)
    poses = kinds.count("pose")
    positions = kinds.count("position")
    distances = len(given.distance)
    parts = [
        f"{count} {kind}{'s' if count > 1 else ''}"
        for count, kind in ((positions, "position"), (poses, "pose"), (distances, "distance"))
        if count
    ]
    return f"{', '.join(parts)}{since}"
