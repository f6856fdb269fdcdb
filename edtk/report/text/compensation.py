"""Text of a compensation."""

import numpy as np

from edtk.calibration.compensation import Compensation
from edtk.calibration.refused_rows import refused_in_words
from edtk.report.text_table import number_columns
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import pose_factors


def compensation(found: Compensation) -> str:
    """A line for each task pose: the command, and the errors before and after."""
    shown = found.robot.shown(found.command) / pose_factors(found.robot)
    numbers = [[f"{x:.5f}" for x in row] for row in shown]
    columns, *commands = number_columns(pose_columns(found.robot), numbers, 12)
    band = "" if found.remaining is None else "   remaining rms (95 % band) [mm]"
    if found.rotation is not None:
        band += "   rotation rms [deg]"
    lines = [f"{'pose':>4}  {columns}   error [mm]{band}"]
    for i, command in enumerate(commands):
        line = f"{found.rows[i] + 1:4}  {command}{1e3 * found.uncompensated[i]:13.4f}"
        if found.remaining is not None and found.band is not None:
            low, high = 1e3 * found.band[i]
            line += f"   {1e3 * found.remaining[i]:.4g} ({low:.4g} .. {high:.4g})"
        if found.rotation is not None:
            line += f"   {np.rad2deg(found.rotation[i]):.4g}"
        lines.append(line)
    if found.remaining is None:
        lines.append(
            "the compliances come without a covariance: what errors of theirs leave is not known"
        )
    elif found.linear is not None:
        if found.linear.any():
            most = f"{1e3 * found.linear.max():.2g} mm"
            lines.append(f"of that, identifying with the linear model left {most} at most")
    elif found.rho0_bias is not None:
        bias = f"{1e3 * found.rho0_bias:.2g} mm"
        lines.append(f"beside that, identifying with the linear model left {bias} in the test pose")
    if found.remaining is not None:
        lines.append(
            "what remains is by errors of the compliances; those of load and tool add to it, see "
            "the error budget of edtk identify"
        )
    notes = filter(None, (found.rigid, refused_in_words(found.refused)))
    return "\n".join([*lines, *notes])
