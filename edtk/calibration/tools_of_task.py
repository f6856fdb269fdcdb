"""The tools and payloads that a robot has in task poses."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.robot_of_task import robot_of_task, weights_of_task
from edtk.model.dead_weights import DeadWeights
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.system.typing import Indices


@dataclass(frozen=True, eq=False)
class ToolInUse:
    """A tool with a payload, and the poses in which the robot has them.

    Attributes:
        rows: Indices of the poses.
        robot: The chain with the tool.
        weights: What loads the robot besides wrenches; None for nothing.
    """

    rows: Indices
    robot: Robot
    weights: DeadWeights | None


def tools_of_task(study: Study, poses: int, own: bool) -> tuple[ToolInUse, ...]:
    """Find the tools in which task poses are meant.

    Args:
        study: Robot and test poses.
        poses: Number of poses.
        own: Whether these are the test poses of the study, of which each says its own tool.

    Raises:
        UserError: The study has no task, or other poses go with test poses of several tools.
    """
    given = study.specification.test_poses
    if not own or not given:
        robot = robot_of_task(study)
        return (ToolInUse(np.arange(poses), robot, weights_of_task(study)),)
    pairs = zip(study.tasks, given, strict=True)
    keys = [(task.model.robot.tool.tobytes(), one.payload) for task, one in pairs]
    found = []
    for key in dict.fromkeys(keys):
        rows = np.array([i for i, other in enumerate(keys) if other == key])
        task = study.tasks[int(rows[0])]
        found.append(ToolInUse(rows, task.model.robot, task.dead_weights))
    return tuple(found)
