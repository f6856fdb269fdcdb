"""The setting of a study's designs as a certificate holds it."""

from typing import Any

import numpy as np

from criteria.linalg.inverse import ROUNDING, unit_spectrum
from edtk.design.design_space import DesignSpace
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.noise import VisitNoise
from edtk.measure.task import Task
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.frames import BodyPoint
from edtk.robots.robot import Robot
from edtk.robots.weights import DeadWeights
from edtk.study.study import Study
from edtk.system.typing import Array


def noise_to_dict(noise: VisitNoise | None) -> dict[str, Any]:
    """Write a tracker, the joints' repeatability and the discrepancy as plain data [m, rad].

    Returns:
        Two keys: the white part, and the rest; none where all noise is white.
    """
    if noise is None:
        return {}
    tracker = noise.tracker
    return {
        "sigma": noise.white.tolist(),
        "noise": {
            "tracker": None
            if tracker is None
            else {
                "position": tracker.position.tolist(),
                "along": list(tracker.along),
                "across": list(tracker.across),
            },
            "repeatability": noise.repeatability.tolist(),
            "discrepancy": noise.discrepancy.tolist(),
            "within": noise.within,
            "readings": noise.readings,
        },
    }


KINDS: dict[type[Sensor], str] = {Marker: "position", PoseMarker: "pose", Distance: "distance"}


def physics_to_dict(model: ElastostaticModel) -> dict[str, Any]:
    """Write instruments, load point and weights as plain data [m, kg].

    Returns:
        One key; none where load and measurement are at the tool point.
    """
    if model.is_plain:
        return {}
    return {
        "physics": {
            "sensors": [_sensor(sensor) for sensor in model.whole_instruments],
            "load_point": place_to_dict(model.load_point),
            "weights": [] if model.weights is None else weights_to_list(model.weights),
        }
    }


def weights_to_list(weights: DeadWeights) -> list[dict[str, Any]]:
    """Mass [kg] and centre of mass of each weight."""
    parts = zip(weights.masses, weights.centers, strict=True)
    return [{"mass": mass, **place_to_dict(center)} for mass, center in parts]


def _sensor(sensor: Sensor) -> dict[str, Any]:
    anchor = {"anchor": sensor.anchor.tolist()} if isinstance(sensor, Distance) else {}
    return {"kind": KINDS[type(sensor)], **place_to_dict(sensor.point), **anchor}


def place_to_dict(point: BodyPoint) -> dict[str, Any]:
    """Offset (3,) of a point [m], in the frame of the joint of this index, or of the tool."""
    return {"offset": point.offset.tolist(), "joint": point.joint}


def feasible_to_dict(study: Study, space: DesignSpace) -> dict[str, Any]:
    """Write the robot, the constraints and the free joints as plain data.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.

    Returns:
        The keys `robot`, `workspace`, `excluded`, `free`, `fixed` and `margin`, in SI units and
        radians, but for the study's own keys, which name their units.
    """
    # Joints that turn without end are cut nowhere.
    margin = space.workspace.robot.limits[0] - study.robot.limits[0]
    excluded = [
        {"poses": part.poses.tolist(), "distance": part.distance}
        for part in space.workspace.constraints
        if isinstance(part, Excluded)
    ]
    return {
        "robot": _robot(study.robot),
        "workspace": study.specification.workspace.model_dump(mode="json", exclude_none=True),
        "excluded": excluded,
        "free": list(space.free),
        "fixed": space.fixed.tolist(),
        "margin": margin.tolist(),
    }


def _robot(robot: Robot) -> dict[str, Any]:
    """The chain: transforms [m], axes, limits [rad or m]; masters by their index among the free."""
    follows = {
        tied.name: {
            "joint": robot.joint_names.index(tied.master),
            "factor": tied.factor,
            "offset": tied.offset,
        }
        for tied in robot.tied
    }
    joints = [
        {
            "name": joint.name,
            "kind": joint.kind,
            "origin": joint.origin.tolist(),
            "axis": joint.axis.tolist(),
            "limits": list(joint.limits),
            **({"continuous": True} if joint.continuous else {}),
            **({"follows": follows[joint.name]} if joint.name in follows else {}),
        }
        for joint in robot.chain
    ]
    return {
        "name": robot.name,
        "base": robot.base.tolist(),
        "tool": robot.tool.tolist(),
        "joints": joints,
    }


def setting_to_dict(study: Study, space: DesignSpace) -> dict[str, Any]:
    """Write robot, load, noise, constraints and test pose as plain data.

    All is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.
    """
    feasible = feasible_to_dict(study, space)
    return {
        "robot": feasible["robot"],
        "unknown": list(study.model.joints),
        "rows": study.model.rows,
        **(noise_to_dict(study.noise) or {"sigma": study.sigma.tolist()}),
        "load": _load(study),
        "workspace": feasible["workspace"],
        "excluded": feasible["excluded"],
        "free": feasible["free"],
        "fixed": feasible["fixed"],
        **({"margin": feasible["margin"]} if any(feasible["margin"]) else {}),
        "test_pose": _test_pose(study),
        **physics_to_dict(study.model),
        **({} if study.interest is None else {"interest": study.interest.tolist()}),
        **({} if study.prior_information is None else {"prior": _prior(study.prior_information)}),
    }


def _prior(information: Array) -> list[list[float]]:
    """Rows F (r, p) of measurements that tell as much as the prior: ``F'F`` is its information."""
    r, V, d = unit_spectrum(information)
    kept = r > len(r) * ROUNDING * r[-1]
    return (np.sqrt(r[kept])[:, None] * V[:, kept].T * d).tolist()


def _load(study: Study) -> dict[str, Any]:
    """The keys of the load; a payload in its stead is the force of its weight."""
    keys = study.specification
    if keys.load is not None:
        return keys.load.model_dump(mode="json", exclude_none=True, exclude={"at_mm"})
    return {"F_N": keys.build_load().wrench(np.zeros(0))[:3].tolist(), "T_Nm": [0.0, 0.0, 0.0]}


def _test_pose(study: Study) -> dict[str, Any] | list[dict[str, Any]] | None:
    """The task, several tasks with their weights, or None."""
    if len(study.tasks) < 2:
        return _task(study.tasks[0]) if study.tasks else None
    return [_task(task) | {"weight": task.weight} for task in study.tasks]


def _task(task: Task) -> dict[str, Any]:
    """Pose [rad or m], tool [m] and wrench [N, N m] of a task.

    Where a neighbourhood [rad] or rotations [m] count, their size follows.
    """
    hanging = task.dead_weights
    sizes = {"within": task.within, "lever": task.lever}
    return {
        "q": task.q.tolist(),
        "tool": task.model.robot.tool.tolist(),
        "wrench": task.wrench.tolist(),
        **{name: size for name, size in sizes.items() if size},
        **({} if hanging is None else {"weights": weights_to_list(hanging)}),
    }
