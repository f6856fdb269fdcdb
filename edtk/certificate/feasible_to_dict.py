"""Where the experiments of a study may lie, as a certificate holds it."""

from typing import Any

from edtk.design.design_space import DesignSpace
from edtk.model.constraints.excluded import Excluded
from edtk.model.robot import Robot
from edtk.study.study import Study


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
