"""Text of a compensation of geometry."""

import numpy as np

from edtk.calibration.geometry.compensate_geometry import GeometricCompensation
from edtk.calibration.refused_rows import refused_in_words
from edtk.tables.pose_table import pose_factors

MM = 1e3
MOST_LINES = 60


def geometric_compensation(found: GeometricCompensation) -> str:
    """A line for each command, with the errors before and after."""
    shown = found.robot.shown(found.command) / pose_factors(found.robot)
    lines = [f"commands {', '.join(found.robot.joint_names)} [deg, mm], and errors of the markers"]
    for row, values in enumerate(shown[:MOST_LINES]):
        joints = " ".join(f"{value:9.4f}" for value in values)
        before = MM * found.uncompensated[row]
        after = MM * found.remaining[row]
        line = (
            f"{found.rows[row] + 1:4d} {joints}   {before:.3g} mm, with this command {after:.3g} mm"
        )
        if found.turns is not None:
            turned = np.rad2deg(found.turns.uncompensated[row])
            then = np.rad2deg(found.turns.remaining[row])
            line += f"; {turned:.3g} deg, then {then:.3g} deg"
        lines.append(line)
    more = len(shown) - MOST_LINES
    if more > 0:
        lines.append(f"... and {more} more, in --json or --out")
    if found.refused:
        lines.append(refused_in_words(found.refused))
    return "\n".join(lines)
