"""Robots as data that can be written to a file and read again without losing a digit."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from edtk.model.controller_table import controller_to_dict
from edtk.model.joint import Joint
from edtk.model.link import Link
from edtk.model.robot import Robot
from edtk.model.tied_joint import TiedJoint
from edtk.model.transform import transform
from edtk.system.typing import Array

# Decimals of an angle [deg] in a file that a person wrote: what is beyond them is rounding.
DECIMALS = 12


def robot_to_dict(robot: Robot) -> dict[str, Any]:
    """Describe a robot by plain numbers, lists and texts, as `robot_from_dict` reads them.

    The robot that is read from it has the same numbers, to the last bit. Angles are written in
    degrees where degrees give back the same radians or rotation, else as `limits_rad` and
    `rotation`. A base, flange or tool that is the identity is left out.
    """
    content: dict[str, Any] = {"name": robot.name, "source": robot.source}
    for key, T in (("base", robot.base), ("flange", robot.flange), ("tool", robot.tool)):
        if not _identical(T, np.eye(4)):
            content[key] = {"position_m": T[:3, 3].tolist()} | _rotation(T[:3, :3])
    links = robot.links or (None,) * len(robot.chain)
    tied = {joint.name: joint for joint in robot.tied}
    content["joints"] = [
        _joint(joint, tied.get(joint.name)) | _link(link)
        for joint, link in zip(robot.chain, links, strict=True)
    ]
    if robot.controller is not None:
        content["controller"] = controller_to_dict(robot)
    return content


def _joint(joint: Joint, tied: TiedJoint | None) -> dict[str, Any]:
    return {
        "name": joint.name,
        "kind": joint.kind,
        "origin_m": joint.origin[:3, 3].tolist(),
        **_rotation(joint.origin[:3, :3]),
        "axis": joint.axis.tolist(),
        **(_limits(joint) if tied is None else _mimic(tied)),
    }


def _mimic(tied: TiedJoint) -> dict[str, Any]:
    """The tie to another joint."""
    key = "offset_m" if tied.kind == "prismatic" else "offset_rad"
    return {"mimic": {"joint": tied.master, "factor": tied.factor, key: tied.offset}}


def _link(link: Link | None) -> dict[str, Any]:
    """Mass and centre of the body that a joint moves, nothing where they are unknown."""
    return {} if link is None else {"mass_kg": link.mass, "center_m": link.center.tolist()}


def _limits(joint: Joint) -> dict[str, Any]:
    """The limits, revolute ones in degrees if these give back the same radians."""
    if joint.continuous:
        return {"continuous": True}
    limits = [float(limit) for limit in joint.limits]
    if joint.kind == "prismatic":
        return {"limits_m": limits}
    degrees = [_same(np.rad2deg(limit), limit, np.deg2rad) for limit in limits]
    if any(angle is None for angle in degrees):
        return {"limits_rad": limits}
    return {"limits_deg": degrees}


def _same(degrees: float, wanted: float, convert: Callable[[float], float]) -> float | None:
    """An angle near `degrees`, as round as possible, that converts to exactly the wanted number."""
    near = (round(degrees, DECIMALS), degrees, *np.nextafter(degrees, [-np.inf, np.inf]))
    return next((float(angle) for angle in near if convert(angle) == wanted), None)


def _rotation(R: Array) -> dict[str, Any]:
    """A rotation (3, 3) as angles if these give back the same matrix, nothing for the identity."""
    if _identical(R, np.eye(3)):
        return {}
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at a pitch of 90 deg two of the angles are not unique
        degrees = Rotation.from_matrix(R).as_euler("xyz", degrees=True)
    for angles in (np.round(degrees, DECIMALS), degrees):
        if _identical(transform(rpy=np.deg2rad(angles))[:3, :3], R):
            return {"rpy_deg": angles.tolist()}
    return {"rotation": R.tolist()}


def _identical(a: Array, b: Array) -> bool:
    """Whether all bits agree, the signs of zeros included."""
    return bool(np.array_equal(a, b) and np.array_equal(np.signbit(a), np.signbit(b)))
