"""Text of a compensation."""

import numpy as np

from edtk.calibration.compensation import Compensation
from edtk.calibration.refused_rows import refused_in_words
from edtk.model.error_budget import JointPart
from edtk.report.text.error_budget import SHARE, assumed_joint
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
    lines += [found.rigid] if found.by_noise is None and found.rigid else _parts(found)
    refused = refused_in_words(found.refused)
    return "\n".join([*lines, refused] if refused else lines)


def _parts(found: Compensation) -> list[str]:
    """What the remaining error is made of; nothing where it is not known."""
    if found.by_noise is None or found.remaining is None:
        return []
    noise = f"{1e3 * found.by_noise.max():.2g} mm"
    first = f"what remains is the total of all that is uncertain; of it at most {noise} by noise"
    parts = [JointPart(joint, float(error.max())) for joint, error in found.by_joints]
    least = SHARE * found.remaining.max()
    return [first, *(assumed_joint(one) for one in parts if one.error > least)]
