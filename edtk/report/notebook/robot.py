"""Table of a robot, for a notebook."""

from edtk.model.robot import Robot
from edtk.report.notebook_table import notebook_table
from edtk.report.text.robot import robot_rows


def robot(result: Robot) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *robot_rows(result))
