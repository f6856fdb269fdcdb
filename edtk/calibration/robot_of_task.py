"""The robot with the tool of its task."""

import numpy as np

from edtk.model.dead_weights import DeadWeights
from edtk.model.robot import Robot
from edtk.study.study import Study


def require_task(study: Study) -> None:
    """Check that a study has a task.

    Raises:
        UserError: It has none.
    """
    if not study.tasks:
        message = "expected a table with the tool and the load of the task; the study has none"
        raise study.error("test_pose", message)


def robot_of_task(study: Study) -> Robot:
    """Find the robot with the tool that all tasks of a study share.

    Args:
        study: Robot and tasks.

    Raises:
        UserError: The study has no task, or tasks with several tools.
    """
    require_task(study)
    robot = study.tasks[0].model.robot
    if any(not np.array_equal(task.model.robot.tool, robot.tool) for task in study.tasks):
        message = "the test poses have different tools; expected one, or no file of other poses"
        raise study.error("test_pose", message)
    return robot


def weights_of_task(study: Study) -> DeadWeights | None:
    """Find what loads the robot in all tasks of a study besides their wrenches; None for nothing.

    Args:
        study: The study, which has a task.

    Raises:
        UserError: The robot carries different payloads in the tasks.
    """
    if len({pose.payload for pose in study.specification.test_poses}) > 1:
        message = "the test poses have different payloads; expected one, or no file of other poses"
        raise study.error("test_pose", message)
    return study.tasks[0].dead_weights
