"""Table of what a robot is for a calibration, for a notebook."""

from edtk.model.robot_overview import RobotOverview
from edtk.report.notebook_table import notebook_table
from edtk.report.text.robot_overview import overview_rows


def robot_overview(found: RobotOverview) -> str:
    """The rows of the text."""
    return notebook_table(found.headline(), *overview_rows(found))
