"""Compensations: commands, and what they leave."""

from typing import Any

import numpy as np

from edtk.calibration.compensate import Compensation
from edtk.calibration.correct_program import CorrectedProgram
from edtk.calibration.model_left import SHARE
from edtk.calibration.tasks_in_use import refused_in_words
from edtk.measure.expected_error import JointPart
from edtk.measure.pose_table import ROW_COLUMN, pose_columns, pose_factors
from edtk.report.figures import BLUE, ORANGE, panels
from edtk.report.shown import plain
from edtk.report.tables import MOST_LINES, notebook_table, text_table
from edtk.report.views.calibration import assumed_joint
from edtk.robots.frames import MM
from edtk.system.typing import Array

MOST_BARS = 20  # poses up to which each has bars of its own
SHIFT = 0.2  # of the two bars of a pose, which are twice as wide


def compensation_text(found: Compensation) -> str:
    """A line for each task pose: the command, and the errors before and after."""
    shown = found.robot.shown(found.command) / pose_factors(found.robot)
    errors = _errors(found)
    header = ["pose", *pose_columns(found.robot), *errors]
    rows = [
        [f"{row + 1}", *(f"{x:.5f}" for x in command), *texts]
        for row, command, *texts in zip(found.rows, shown, *errors.values(), strict=True)
    ]
    lines = [text_table(header, rows[:MOST_LINES])]
    if len(rows) > MOST_LINES:
        lines.append(f"... and {len(rows) - MOST_LINES} more, in --json or --out")
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


def corrected_program_text(found: CorrectedProgram) -> str:
    """A line for each target that moves, and one for each that is left."""
    lines = [found.headline()]
    if not found.already:
        lines += _targets(found)
    if found.left:
        lines.append(f"{len(found.left)} left as they are:")
        lines += [f"  {one.text}" for one in found.left[:MOST_LINES]]
    more = len(found.left) - MOST_LINES
    return "\n".join([*lines, f"  and {more} more, in --json"] if more > 0 else lines)


def _targets(found: CorrectedProgram) -> list[str]:
    """The table of what moved by how much."""
    columns = {
        "moved [mm]": MM * found.moved,
        "turned [deg]": np.rad2deg(found.turned),
        "digits [mm]": MM * found.rounded,
        "error before [mm]": MM * found.before,
    }
    if found.remaining is not None:
        columns["after, rms [mm]"] = MM * found.remaining
    literals = [one.target.literal for one in found.targets]
    rows = [
        [str(one.line), one.name, "joints" if one.joints else "pose", *(f"{x:.4f}" for x in row)]
        for one, *row in zip(literals, *columns.values(), strict=True)
    ]
    lines = [text_table(["line", "target", "kind", *columns], rows[:MOST_LINES])]
    if len(rows) > MOST_LINES:
        lines.append(f"... and {len(rows) - MOST_LINES} more, in --json or --table")
    return lines


def corrected_program_notebook(found: CorrectedProgram) -> str:
    """A row for each target."""
    table = found.to_frame()
    rows = [
        [f"{value:.6g}" if isinstance(value, float) else value for value in one]
        for one in table.itertuples(index=False, name=None)
    ]
    notes = [one.text for one in found.left]
    return notebook_table(found.headline(), list(table.columns), rows, notes)


def _errors(found: Compensation) -> dict[str, list[str]]:
    """Texts (t,) of the errors before, and of those after that are known, by header."""
    of = "" if found.left is None else " of the markers"
    columns = {f"error{of} before [mm]": [f"{1e3 * x:.4f}" for x in found.uncompensated]}
    if found.remaining is not None:
        columns["after, rms [mm]"] = [f"{1e3 * x:.4g}" for x in found.remaining]
        if found.band is not None:
            columns["95 % band [mm]"] = [f"{a:.4g} .. {b:.4g}" for a, b in 1e3 * found.band]
    turned = {
        "rotation before [deg]": found.rotation_before,
        "rotation after, rms [deg]": found.rotation,
    }
    return columns | {
        name: [f"{x:.4g}" for x in np.rad2deg(angles)]
        for name, angles in turned.items()
        if angles is not None
    }


def _parts(found: Compensation) -> list[str]:
    """What the remaining error is made of; nothing where it is not known."""
    if found.by_noise is None or found.remaining is None:
        return []
    noise = f"{1e3 * found.by_noise.max():.2g} mm"
    first = f"the error after counts all that is uncertain; the noise alone makes {noise} at most"
    parts = [JointPart(joint, float(error.max())) for joint, error in found.by_joints]
    least = SHARE * found.remaining.max()
    return [first, *(assumed_joint(one) for one in parts if one.error > least)]


def compensation_notebook(found: Compensation) -> str:
    """A row for each task pose."""
    table = found.to_frame().drop(columns=ROW_COLUMN, errors="ignore")
    values = zip(found.rows, table.to_numpy(), strict=True)
    rows = [[row + 1, *(f"{value:.6g}" for value in one)] for row, one in values]
    notes = [*filter(None, (found.rigid, refused_in_words(found.refused)))]
    return notebook_table(found.headline(), ["pose", *table.columns], rows, notes)


def compensation_plot(found: Compensation, ax: Any = None) -> Any:
    """Draw the error before and after compensation by pose, the latter with its 95 % band.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.8, 3.8))[0, 0]
    pose: Array = found.rows.astype(float) + 1
    if len(pose) <= MOST_BARS:
        _bars(found, pose, ax)
    else:
        _lines(found, pose, ax)
    ax.set_yscale("log")
    ax.set_xlabel("task pose")
    of = "tool point" if found.left is None else "markers"
    ax.set_ylabel(f"error of the {of} [mm]")
    ax.set_title(plain(found.headline()), fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def _bars(found: Compensation, pose: Array, ax: Any) -> None:
    """Two bars for each of a few poses."""
    before = 1e3 * found.uncompensated
    ax.bar(pose - SHIFT, before, 2 * SHIFT, color=ORANGE, label="before")
    if found.remaining is not None:
        after = 1e3 * found.remaining
        ax.bar(pose + SHIFT, after, 2 * SHIFT, color=BLUE, label="after, root mean square")
    if found.remaining is not None and found.band is not None:
        ends = 1e3 * found.band.T
        # The root mean square may lie outside a narrow band by rounding.
        reach = np.maximum(np.abs(ends - after), 0.0)
        middle = pose + SHIFT
        ax.errorbar(middle, after, reach, fmt="none", color="black", capsize=4, label="95 % band")
    ax.set_xticks(pose)


def _lines(found: Compensation, pose: Array, ax: Any) -> None:
    """Lines over many poses, which are those of a path."""
    ax.plot(pose, 1e3 * found.uncompensated, color=ORANGE, label="before")
    if found.band is not None:
        low, high = 1e3 * found.band.T
        ax.fill_between(pose, low, high, color=BLUE, alpha=0.18, linewidth=0, label="95 % band")
    if found.remaining is not None:
        ax.plot(pose, 1e3 * found.remaining, color=BLUE, label="after, root mean square")
    ax.set_xlim(pose[0], pose[-1])
