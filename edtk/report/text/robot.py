"""Text of a robot."""

from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.report.text_table import text_table
from edtk.tables.pose_table import pose_factors

UNITS = {"revolute": "deg", "prismatic": "mm"}


def robot(result: Robot) -> str:
    """A line for each joint."""
    source = f"\nsource: {result.source}" if result.source else ""
    return f"{result.name}\n{text_table(*robot_rows(result))}{source}"


def robot_rows(result: Robot) -> tuple[list[str], list[list[str]]]:
    """Header and rows: joint, kind, limits, axis, and origin relative to the joint before."""
    factors = pose_factors(result)
    rows = []
    for joint, factor, shown in zip(result.joints, factors, shown_limits(result), strict=True):
        low, high = (f"{limit / factor:g}" for limit in shown.range(joint.limits))
        axis = " ".join(f"{component:g}" for component in joint.axis.round(6) + 0.0)
        origin = " ".join(f"{1e3 * length:g}" for length in joint.origin[:3, 3].round(9) + 0.0)
        of = "" if shown.label == joint.name else f" for {shown.label}"
        limits = f"{low} .. {high} {UNITS[joint.kind]}{of}"
        rows.append([joint.name, joint.kind, limits, axis, origin])
    return ["joint", "kind", "limits", "axis", "origin [mm]"], rows
