"""The commented text of a new study, which runs as it is."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from edtk.model.controller_table import controller_to_dict
from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.study.first_choices import FirstChoices
from edtk.study.toml_text import inline, toml_text
from edtk.tables.pose_table import pose_factors

COLUMN = 33  # characters before comments
DECIDE = "DECIDE:"  # marks what only the engineer knows
LEAST_SIZE = 4
# Key, margin from limits, and its unit in SI, by kind of joint.
MARGINS = {"revolute": ("margin_deg", 2.0, np.pi / 180), "prismatic": ("margin_mm", 5.0, 1e-3)}
LEAST_RANGE = 10.0  # of a joint, beside the margin
Links = tuple[str | None, str | None]


def new_study_text(
    robot: Robot,
    found: FirstChoices,
    name: str,
    file: str,
    links: Links = (None, None),
    limits: Mapping[str, tuple[float, float]] | None = None,
    own_controller: bool = False,
    left_out: Sequence[str] = (),
) -> str:
    """Write a study that runs as it is, with what is to be decided marked.

    Args:
        robot: The robot.
        found: What suits it.
        name: How the study names the robot.
        file: Name of the study's file, for the commands in its comments.
        links: Base and tip link of a URDF, where they are given.
        own_controller: Whether the study itself says how the controller counts, and not the
            robot's file.
        limits: Lower and upper limits by joint that take the place of the file's [deg, mm].
        left_out: Joints of the end effector, that tip_link leaves out.
    """
    sections = (
        _head(robot, found, name, file, links, left_out),
        _controller(robot, own_controller),
        _circumstances(found),
        _joints(robot, found, limits or {}),
        _workspace(found),
        _task(found),
        _simulation(found),
    )
    return "\n".join(line for section in sections for line in (*section, ""))


def _head(
    robot: Robot,
    found: FirstChoices,
    name: str,
    file: str,
    links: Links,
    left_out: Sequence[str],
) -> list[str]:
    """Title, robot, and what is searched for."""
    title = " ".join(robot.name.split())
    least = max(LEAST_SIZE, -(-len(found.compliance) // 3) + 1)
    ends = {f"{end}_link": link for end, link in zip(("base", "tip"), links, strict=True) if link}
    return [
        f"# {title}: which poses to measure under load, to find the joints' compliances.",
        "# The numbers suit the robot's size, and the study runs as it is:",
        f"#   edtk plan {file} --size {least} --out plan.csv",
        f"#   edtk run {file}",
        f'# "{DECIDE}" marks what only you know. docs/reference/study.md explains all keys.',
        _line("title", f"Calibration of {title}"),
        _line("robot", name),
        *(_line(key, link) for key, link in ends.items()),
        *([f"# Left out as the end effector's: {_listed(left_out)}."] if left_out else []),
        _line("seed", 1),
        _line("sizes", [least, least + 2], "numbers of experiments to compare"),
        _line("optimise", ["rho0"], "the error to expect in the test pose"),
        _line("criteria", ["rho0", "D"]),
        _line("candidates", 1000),
        _line("starts", 8),
    ]


def _controller(robot: Robot, own: bool) -> list[str]:
    """How the controller counts: the table, where it stands, or in comments."""
    if own:
        return toml_text({"controller": controller_to_dict(robot)}).strip().splitlines()
    if robot.controller is not None:
        return ["# How the controller counts the joints stands in the robot's file."]
    joint = robot.joints[min(1, robot.n - 1)]
    zero = "zero_mm" if joint.kind == "prismatic" else "zero_deg"
    return [
        f"# {DECIDE} does the controller count the joints as the robot's file does? If not:",
        "# [controller]",
        _comment(f"# sign = {inline({joint.name: -1})}", "it counts the other way round"),
        _comment(f"# {zero} = {inline({joint.name: -90})}", "it shows this at the file's zero"),
        "# Poses below then have to be written anew; `edtk new --controller` does that.",
    ]


def _circumstances(found: FirstChoices) -> list[str]:
    """Tool, load and noise of the calibration."""
    careful = f"{found.payload:g} kg, careful for {found.reach:.2g} m of reach; see --payload KG"
    load = f"here {found.payload:g} kg, as you say" if found.given else careful
    return [
        "[tool]",
        _line("position_mm", found.tool_mm, f"{DECIDE} where the load acts and the marker is"),
        "",
        "[load]",
        _line("F_N", found.force, f"{DECIDE} {load}"),
        "",
        "[measurement]",
        _line("rows", "position"),
        _line("sigma_mm", 0.03, f"{DECIDE} noise of a displacement, per coordinate"),
    ]


def _joints(
    robot: Robot, found: FirstChoices, limits: Mapping[str, tuple[float, float]]
) -> list[str]:
    """Unknown compliances and joints that stay."""
    lines = ["[joints]", _line("unknown", list(found.compliance))]
    for key, slides in (("fixed_deg", False), ("fixed_mm", True)):
        fixed = {
            joint.name: found.fixed[joint.name]
            for joint in robot.joints
            if joint.name in found.fixed and (joint.kind == "prismatic") == slides
        }
        if fixed:
            text = f"{key} = {inline(_plain(fixed))}"
            lines.append(_comment(text, "the load turns none of these in any pose"))
    for key, slides in (("limits_deg", False), ("limits_mm", True)):
        own = {
            joint.name: list(limits[joint.name])
            for joint in robot.joints
            if joint.name in limits and (joint.kind == "prismatic") == slides
        }
        if own:
            lines.append(f"{key} = {inline(_plain(own))}")
    lines += [
        _line(key, margin, "plans keep so far from limits, at which controllers stop")
        for key, margin in _margins(robot, found).items()
    ]
    lines.append("# Limits; limits_deg and limits_mm in this table would take their place:")
    rows = zip(robot.joints, shown_limits(robot), pose_factors(robot), strict=True)
    for joint, shown, factor in rows:
        low, high = (limit / factor for limit in shown.range(joint.limits))
        unit = "mm" if joint.kind == "prismatic" else "deg"
        lines.append(f"#   {shown.label}: {low:.6g} .. {high:.6g} {unit}")
    return lines


def _margins(robot: Robot, found: FirstChoices) -> dict[str, float]:
    """How far plans keep away from limits, for each kind of joint that moves."""
    margins = {}
    for kind, (key, margin, unit) in MARGINS.items():
        moving = [j for j in robot.joints if j.kind == kind and j.name not in found.fixed]
        least = min((joint.limits[1] - joint.limits[0] for joint in moving), default=0.0)
        if least > LEAST_RANGE * margin * unit:
            margins[key] = margin
    return margins


def _workspace(found: FirstChoices) -> list[str]:
    """Where the tool point may go."""
    lines = [_comment("[workspace]", f"{DECIDE} where the arm may go in your cell")]
    if found.height_mm is not None:
        lines.append(_line("height_min_mm", found.height_mm, "of the tool point, above z = 0"))
    if found.radius_mm is not None:
        lines.append(_line("radius_min_mm", found.radius_mm, "of the tool point, from the z-axis"))
    return [*lines, _comment("# tilt_max_deg = 30", "of the tool's z-axis, if need be")]


def _task(found: FirstChoices) -> list[str]:
    """The test pose."""
    return [
        _comment("[test_pose]", f"{DECIDE} pose, tool and load of the robot's task"),
        _line("q_deg", found.q_deg),
        _line("robust_deg", 10, "accurate so far around it, too"),
        f"tool = {inline(_plain({'position_mm': found.tool_mm}))}",
        f"load = {inline(_plain({'F_N': found.force}))}",
    ]


def _simulation(found: FirstChoices) -> list[str]:
    """Made-up compliances."""
    return [
        f"# {DECIDE} made up, for simulations and the budget of errors: gears that the load turns",
        "# by some minutes of arc. Compliances of your kind of robot make both more honest.",
        "[simulation.compliance_rad_per_Nm]",
        *(_line(joint, compliance) for joint, compliance in found.compliance.items()),
    ]


def _listed(joints: Sequence[str]) -> str:
    """The first joints, and how many more there are, as a comment may hold them."""
    shown = ", ".join("".join(c if c.isprintable() else "?" for c in name) for name in joints[:4])
    return shown + (f" and {len(joints) - 4} more" if len(joints) > 4 else "")


def _line(key: str, value: Any, comment: str = "") -> str:
    """A key with its value, and perhaps a comment, in one line."""
    text = toml_text({key: _plain(value)}).strip()
    return _comment(text, comment) if comment else text


def _comment(text: str, comment: str) -> str:
    """A line with a comment in the column of all comments, or behind a longer line."""
    return f"{text:{COLUMN}} # {comment}"


def _plain(value: Any) -> Any:
    """Whole numbers without a decimal point, as people write them."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
