"""Task poses from a file."""

from pathlib import Path

from edtk.design.plan import Plan
from edtk.study.study import Study


def load_task(study: Study, path: Path | str) -> Plan:
    """Read task poses, columns as in a plan; without wrench columns, the test pose's load acts.

    Joints that the study fixes may be left out, as in a plan. A column `repeats` means nothing.

    Args:
        study: Robot and test pose.
        path: The CSV file.

    Raises:
        UserError: The study has no test pose, or the file cannot be read; names the row and the
            column.
    """
    if study.task is None:
        message = "expected a table with the tool and the load of the task; the study has none"
        raise study.error("test_pose", message)
    return Plan.from_csv(path, study.robot, study.fixed, study.task.wrench)
