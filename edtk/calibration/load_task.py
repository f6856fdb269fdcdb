"""Task poses from a file."""

import numpy as np

from edtk.calibration.robot_of_task import require_task, robot_of_task
from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.tables.pose_table import Table


def load_task(study: Study, path: Table | None = None) -> Plan:
    """Read task poses, columns as in a plan; without wrench columns, the test pose's load acts.

    A file without them goes with test poses of one and the same load.

    Joints that the study fixes may be left out, as in a plan. A column `repeats` means nothing.

    Args:
        study: Robot and test pose.
        path: The CSV file, or a data frame that holds what it would; None for the poses
            of the study itself.

    Raises:
        UserError: The study has no test pose, or some with different tools, or the file cannot be
            read; names the row and the column.
    """
    require_task(study)
    if path is None:
        poses = np.array([task.q for task in study.tasks])
        wrenches = np.array([task.wrench for task in study.tasks])
        return Plan(poses, wrenches, np.ones(len(poses), dtype=int))
    wrench = study.tasks[0].wrench
    robot_of_task(study)
    same = all(np.array_equal(task.wrench, wrench) for task in study.tasks)
    return Plan.from_csv(path, study.robot, study.fixed, wrench if same else None)
