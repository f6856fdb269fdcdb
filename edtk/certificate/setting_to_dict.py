"""The setting of a study's designs as a certificate holds it."""

from typing import Any

from edtk.design.design_space import DesignSpace
from edtk.model.constraints.excluded import Excluded
from edtk.model.robot import Robot
from edtk.study.study import Study


def setting_to_dict(study: Study, space: DesignSpace) -> dict[str, Any]:
    """Write robot, load, noise, constraints and test pose as plain data.

    All is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.
    """
    keys = study.specification
    excluded = [
        {"poses": part.poses.tolist(), "distance": part.distance}
        for part in space.workspace.constraints
        if isinstance(part, Excluded)
    ]
    return {
        "robot": _robot(study.robot),
        "unknown": list(study.model.joints),
        "rows": study.model.rows,
        "sigma": study.sigma.tolist(),
        "load": keys.load.model_dump(mode="json", exclude_none=True),
        "workspace": keys.workspace.model_dump(mode="json", exclude_none=True),
        "excluded": excluded,
        "free": list(space.free),
        "fixed": space.fixed.tolist(),
        "test_pose": _test_pose(study),
    }


def _robot(robot: Robot) -> dict[str, Any]:
    """The chain: transforms [m], axes, limits [rad or m]."""
    joints = [
        {
            "name": joint.name,
            "kind": joint.kind,
            "origin": joint.origin.tolist(),
            "axis": joint.axis.tolist(),
            "limits": list(joint.limits),
        }
        for joint in robot.joints
    ]
    return {
        "name": robot.name,
        "base": robot.base.tolist(),
        "tool": robot.tool.tolist(),
        "joints": joints,
    }


def _test_pose(study: Study) -> dict[str, Any] | None:
    """Pose [rad or m], tool [m] and wrench [N, N m] of the task; None without one.

    Where a neighbourhood [rad] or rotations [m] count, their size follows.
    """
    task = study.task
    if task is None:
        return None
    sizes = {"within": task.within, "lever": task.lever}
    return {
        "q": task.q.tolist(),
        "tool": task.model.robot.tool.tolist(),
        "wrench": task.wrench.tolist(),
        **{name: size for name, size in sizes.items() if size},
    }
