"""The setting of designs of a study of geometry, as a certificate holds it."""

from typing import Any

import numpy as np

from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.certificate.feasible_to_dict import feasible_to_dict
from edtk.certificate.physics_to_dict import place_to_dict, weights_to_list
from edtk.model.body_point import BodyPoint
from edtk.model.dead_weights import DeadWeights
from edtk.model.geometry.geometric_parameter import COMPONENTS, GeometricParameter
from edtk.system.typing import Array
from edtk.tables.in_file_units import of_file_units


def geometry_setting(question: GeometryQuestion) -> dict[str, Any]:
    """Write robot, markers, parameters, loads, noise and test poses as plain data.

    Everything is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        question: The question of the study.
    """
    feasible = feasible_to_dict(question.study, question.space)
    loads = question.setting.loads
    return {
        "robot": feasible["robot"],
        "unknown": [],
        "rows": question.model.rows,
        **_noise(question),
        "load": _load(question.wrenches),
        "workspace": feasible["workspace"],
        "excluded": feasible["excluded"],
        "free": feasible["free"],
        "fixed": feasible["fixed"],
        **({"margin": feasible["margin"]} if any(feasible["margin"]) else {}),
        "test_pose": _test_poses(question),
        "physics": {
            "sensors": [
                {"kind": question.model.rows, "offset": offset.tolist(), "joint": None}
                for offset in question.model.offsets
            ],
            "load_point": place_to_dict(
                BodyPoint() if loads is None else loads.by_wrench.load_point
            ),
            "weights": _weights(None if loads is None else loads.links),
        },
        "geometry": {
            "parameters": [_parameter(question, one) for one in question.model.parameters],
            "payload": _weights(None if loads is None else loads.payload),
        },
        **_interest(question),
    }


def _noise(question: GeometryQuestion) -> dict[str, Any]:
    """The white part, and the joints' repeatability where there is any."""
    noise = question.setting.noise
    of_marker = [noise.reading / 1e3] * 3 + ([] if noise.turn is None else [noise.turn / 1e3] * 3)
    white = {"sigma": of_marker * len(question.model.markers)}
    if not np.any(noise.joints):
        return white
    return white | {
        "noise": {
            "tracker": None,
            "repeatability": (np.asarray(noise.joints) / 1e3).tolist(),
            "discrepancy": [0.0] * len(white["sigma"]),
            "within": 0.0,
            "readings": 1,
        }
    }


def _load(wrenches: Array) -> dict[str, Any]:
    """No load, or the wrenches among which a visit chooses."""
    if len(wrenches) == 1:
        return {"F_N": [0.0, 0.0, 0.0], "T_Nm": [0.0, 0.0, 0.0]}
    return {"wrenches": wrenches.tolist()}


def _test_poses(question: GeometryQuestion) -> list[dict[str, Any]] | None:
    """The test poses with their loads and weights; None without any."""
    poses = question.study.specification.test_poses
    if not poses:
        return None
    return [
        {
            "q": of_file_units(question.study.robot, np.array(pose.q_deg)).tolist(),
            "wrench": pose.load.build().tolist(),
            "weight": pose.weight,
        }
        for pose in poses
    ]


def _weights(weights: DeadWeights | None) -> list[dict[str, Any]]:
    """Mass and centre of each weight; none without any."""
    return [] if weights is None else weights_to_list(weights)


def _parameter(question: GeometryQuestion, one: GeometricParameter) -> dict[str, Any]:
    """A parameter: its name, what it moves, of which joint or marker, and its component."""
    robot = question.study.robot
    names = {
        "base": ("",),
        "joint": robot.body_names,
        "tool": question.model.markers,
        "compliance": robot.joint_names,
    }
    return {
        "name": one.name,
        "place": one.place,
        "of": names[one.place].index(one.of),
        "component": COMPONENTS.index(one.component) if one.component else 0,
    }


def _interest(question: GeometryQuestion) -> dict[str, Any]:
    """What criteria without a task are about; nothing where that is all."""
    if question.study.specification.interest is None:
        return {}
    return {"interest": question.interest()[0].tolist()}
