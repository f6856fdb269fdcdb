"""How near poses are to the limits of the joints."""

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Array

ON_LIMIT = {"revolute": np.deg2rad(0.05), "prismatic": 5e-5}  # [rad, m], as people read a display
MOST_NAMED = 4  # rows of a joint


def within_margin(robot: Robot, margin: dict[str, float], fixed: frozenset[int]) -> Robot:
    """The same chain, whose moving joints stay away from their limits.

    Joints without limits have no margin, and neither have joints that stay where they are.

    Args:
        robot: The chain.
        margin: Distance from each limit by kind of joint [rad, m].
        fixed: Indices of joints that do not move.

    Raises:
        ValueError: A joint has no range left; names it.
    """
    limits = {}
    for j, joint in enumerate(robot.joints):
        by = margin.get(joint.kind, 0.0)
        if not by or joint.continuous or j in fixed:
            continue
        lower, upper = joint.limits
        if not upper - lower > 2 * by:
            raise ValueError(f"leaves no range for joint {joint.name!r}")
        limits[joint.name] = (lower + by, upper - by)
    return robot.with_limits(limits)


def joints_on_limits(
    robot: Robot, q: Array, fixed: frozenset[int] = frozenset()
) -> dict[str, list[int]]:
    """Which rows of poses (k, n) [rad or m] have a joint on its limit, by joint; from 0.

    Args:
        robot: The chain, with the limits at which its joints stop.
        q: The poses.
        fixed: Indices of joints that do not move, and do not count.
    """
    lower, upper = robot.hard_limits
    near = np.array([ON_LIMIT[joint.kind] for joint in robot.joints])
    there = (q - lower < near) | (upper - q < near)
    names = enumerate(robot.joint_names)
    return {
        name: np.flatnonzero(there[:, j]).tolist()
        for j, name in names
        if j not in fixed and there[:, j].any()
    }


def on_limits_in_words(found: dict[str, list[int]]) -> str:
    """Which joints stand on their limits in which rows, counted from 1; empty for none."""
    if not found:
        return ""
    parts = []
    for name, rows in found.items():
        more = f" and {len(rows) - MOST_NAMED} more" if len(rows) > MOST_NAMED else ""
        plural = "s" * (len(rows) > 1)
        listed = ", ".join(str(row + 1) for row in rows[:MOST_NAMED])
        parts.append(f"{name} in row{plural} {listed}{more}")
    return f"on their limits: {'; '.join(parts)} ([joints] margin_deg keeps plans away from limits)"
