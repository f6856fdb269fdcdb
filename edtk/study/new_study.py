"""What a new study of a robot begins with, and its commented text, which runs as it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.pose_table import in_file_units, of_file_units, pose_factors
from edtk.robots.frames import Frames
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot, motors_in_words, shown_limits
from edtk.robots.robot_file import controller_to_dict
from edtk.robots.rotations import transform
from edtk.study.study_toml import inline, toml_text
from edtk.system.errors import UserError
from edtk.system.typing import Array, Mask

GRAVITY = 9.81  # [m/s^2]
PAYLOADS = (0.2, 1000.0)  # [kg]
HEIGHTS = (0.15, 0.0)  # least heights of the tool point beside the reach, the first that leaves
RADII = (0.25, 0.1)  # room; and least distances from the vertical axis through the base
TYPED = {"revolute": 5.0, "prismatic": 10.0}  # steps of the test pose [deg, mm]
BENT = {"revolute": 1e-3, "prismatic": 2e-4}  # of a gear by a usual load [rad, m]
COLUMN = 33  # characters before comments
DECIDE = "DECIDE:"  # marks what only the engineer knows


TURN = 2 * np.pi  # of a joint that turns on and on, no more than a turn counts


@dataclass(frozen=True)
class SuggestedStudy:
    """How a first study suits a robot of which only the chain is known."""

    samples: int = 4096  # poses within the limits, from which all choices are made
    # Rated payloads beside the cube of the reach [kg/m^3], of data sheets: IRB 4600-20/2.5 1.3, KR
    # 5 arc 1.8, IRB 1600-6/1.45 2.0, UR10 4.6, Panda 4.8, Z1 5, KR 210 L150 5, UR5 8, KR 270 14, KR
    # 6 R700 17, iiwa 14 25. A load that nobody has given is one that the weakest of them carries.
    careful_per_reach: float = 1.3
    typical_per_reach: float = 5.0  # of these, for gears that are made up
    lever: float = 0.12  # of the tool point from the last axis, and along it, beside the reach
    # Motion of the tool by way of a joint, beside the largest: below it an axis is upright but for
    # the digits of its file, as with a quarter turn of 1.5708.
    unloaded: float = 1e-4
    room: float = 0.15  # share of the poses that a constraint has to leave
    middle: float = 0.3  # of a joint's range, to each side of its middle, for the test pose
    best: int = 50  # sampled poses among which the rounded test pose is chosen
    least_size: int = 4  # experiments of a first plan: twice what six compliances need
    least_range: float = 10.0  # of a joint, beside the margin
    wrist: int = 3  # joints at most that turn in a wrist


SUGGESTED = SuggestedStudy()


@dataclass(frozen=True)
class FirstChoices:
    """What suits a robot as far as its geometry tells.

    Attributes:
        reach: Largest distance of the flange from the first joint, of an arm behind slides from
            its own first joint [m].
        payload: Mass whose weight is the load [kg].
        given: Whether somebody said so; otherwise it is a careful guess by the reach.
        tool_mm: Tool point in the frame in which tools are given (3,).
        force: Load (3,), in world axes [N].
        fixed: Joints that the load does not turn, with the value where they stay [deg, mm].
        compliance: Compliance of each other joint that bends as much as gears do [rad/(N m), m/N].
        height_mm: Least height of the tool point; None if that leaves too little room.
        radius_mm: Least distance of the tool point from the world's z-axis; None likewise.
        q_deg: The test pose, as the controller shows it (n,) [deg, mm].
    """

    reach: float
    payload: float
    given: bool
    tool_mm: tuple[float, ...]
    force: tuple[float, ...]
    fixed: dict[str, float]
    compliance: dict[str, float]
    height_mm: float | None
    radius_mm: float | None
    q_deg: tuple[float, ...]


def first_choices(robot: Robot, payload: float | None = None) -> FirstChoices:
    """Choose what a first study of a robot says.

    All is read off poses that are spread evenly over the joint limits: the reach; a tool point
    beside the last axis, so that this joint is seen; a weight that any such arm carries; joints
    that this weight does not turn in any pose, which are fixed; a space with some room; and among
    the poses in the middle of the limits the one in which no joint is idle and the arm is farthest
    from singular.

    Args:
        robot: The robot, whose own tool does not count.
        payload: Mass that it carries, with everything on its flange [kg]; defaults to one that any
            arm of this reach carries.

    Raises:
        UserError: No load turns a joint, or no pose is regular.
    """
    q = _spread(robot)
    flange = robot.with_tool(np.eye(4)).frames(q)
    first = _first_of_arm(robot)
    reach = float(np.linalg.norm(flange.position - flange.origins[first], axis=0).max())
    if not reach > 0:
        raise UserError("the flange does not move; expected a robot with links", where=robot.name)
    tool_mm = _tool(robot, flange, reach)
    robot = robot.with_tool(transform(np.array(tool_mm) / 1e3))
    carried = (
        _rounded_down(SUGGESTED.careful_per_reach * reach**3, 1) if payload is None else payload
    )
    typical = SUGGESTED.typical_per_reach * reach**3 if payload is None else payload
    carried = float(np.clip(carried, *PAYLOADS)) if payload is None else carried
    force = _force(robot, q, carried)
    moved = _moved(robot, q, force)
    idle = moved.max(axis=0) <= SUGGESTED.unloaded * moved.max()
    if idle.all():
        raise UserError("no load turns a joint of this robot", where=robot.name)
    fixed = _fixed(robot, idle)
    q = _with_fixed(robot, q, fixed)
    frames = robot.frames(q)
    room, height = _constraint(np.ones(len(q), bool), frames.position[2], HEIGHTS, reach)
    radius = np.hypot(frames.position[0], frames.position[1])
    # An arm on a track may stand aside of that axis, which then keeps the tool away from nothing.
    aside = np.hypot(*frames.origins[first][:2]).max()
    radii = RADII if aside < RADII[0] * reach else ()
    room, least_radius = _constraint(room, radius, radii, reach)
    free = [j for j in range(robot.n) if robot.joint_names[j] not in fixed]
    return FirstChoices(
        reach=reach,
        payload=carried,
        given=payload is not None,
        tool_mm=tool_mm,
        force=tuple(force[:3].tolist()),
        fixed=fixed,
        compliance=_compliance(robot, q, force * typical / carried, free),
        height_mm=height,
        radius_mm=least_radius or None,  # of small arms it may round to 0, which bounds nothing
        q_deg=_test_pose(robot, q[room], force, free),
    )


def _first_of_arm(robot: Robot) -> int:
    """The joint from which the reach counts: the first one that turns, where an arm is behind it.

    How far a track goes says nothing of what the arm on it carries.
    """
    turning = [j for j, joint in enumerate(robot.joints) if _kind(joint) == "revolute"]
    return turning[0] if len(turning) > SUGGESTED.wrist else 0


def _spread(robot: Robot) -> Array:
    """Poses (s, n) that are spread evenly over the limits [rad or m]."""
    from scipy.stats import qmc

    cube = qmc.Sobol(robot.n, seed=0).random(SUGGESTED.samples)
    middle, half = _range(robot)
    q = np.asarray(middle + half * (2 * cube - 1))
    possible = robot.bounds.coupled.hold(q)
    return q[possible] if possible.any() else q


def _range(robot: Robot) -> tuple[Array, Array]:
    """Middle and half width (n,) of the limits, a turn at most [rad or m]."""
    lower, upper = robot.limits
    turns = np.array([_kind(joint) == "revolute" for joint in robot.joints])
    half = (upper - lower) / 2
    wide = turns & (half > TURN / 2)
    # A joint that turns several times is as good at zero as in the middle of its limits.
    inside = (lower < 0) & (upper > 0)
    middle = np.where(wide & inside, 0.0, (lower + upper) / 2)
    return middle, np.where(wide, np.minimum(TURN / 2, half), half)


def _tool(robot: Robot, flange: Frames, reach: float) -> tuple[float, ...]:
    """A tool point as far from the last axis as along it, away from the arm (3,) [mm]."""
    step = 10.0 if reach > 0.3 else 1.0
    lever = max(step, step * round(1e3 * SUGGESTED.lever * reach / step))
    last = robot.flange[:3, :3].T @ robot.joints[-1].axis
    across = np.eye(3)[int(np.abs(last).argmin())]
    along = np.eye(3)[int(np.abs(last).argmax())]
    # Outwards is where the tool point gets away from the joints before.
    direction = np.tensordot(along, flange.rotation, axes=1)
    outwards = ((flange.position - flange.origins) * direction).sum(axis=1)
    sign = 1.0 if outwards.mean() >= 0 else -1.0
    return tuple((lever * (sign * along + across) + 0.0).tolist())


def _rounded_down(value: float, digits: int) -> float:
    """A positive number with so many digits, none of which makes it larger."""
    step = 10.0 ** (np.floor(np.log10(value)) + 1 - digits)
    return float(f"{np.floor(value / step) * step:.{digits}g}")


def _force(robot: Robot, q: Array, payload: float) -> Array:
    """The payload's weight (6,), or a pull as large sideways if few joints feel the weight."""
    size = _rounded_down(GRAVITY * payload, 3)
    down = np.array([0, 0, -size, 0, 0, 0])
    moved = _moved(robot, q, down).max(axis=0)
    felt = (moved > SUGGESTED.unloaded * moved.max()) & (moved > 0)
    if 2 * felt.sum() >= robot.n:
        return down
    return np.array([size, 0, 0, 0, 0, 0])


def _moved(robot: Robot, q: Array, force: Array) -> Array:
    """Motion (s, n) of the tool point by a unit of each joint's compliance [m]."""
    return np.asarray(np.linalg.norm(ElastostaticModel(robot).regressor(q, force), axis=1))


def _fixed(robot: Robot, idle: Mask) -> dict[str, float]:
    """The idle joints, in the middle of their limits, or at zero as the controller shows it."""
    middle, _ = _range(robot)
    shown = in_file_units(robot, middle)
    lower, upper = robot.limits
    at_zero = np.where(idle, 0.0, shown)
    zero = of_file_units(robot, at_zero)
    inside = (lower < zero) & (zero < upper)
    found = {}
    for j in np.flatnonzero(idle).tolist():
        leaders = () if robot.controller is None else robot.controller.leaders(j)
        if all(idle[leader] for leader in leaders):  # a joint cannot stay if its leader moves
            found[robot.joint_names[j]] = 0.0 if inside[j] else float(np.round(shown[j], 1))
    return found


def _with_fixed(robot: Robot, q: Array, fixed: dict[str, float]) -> Array:
    """The poses (s, n) with the fixed joints where they stay."""
    shown = in_file_units(robot, q)
    for name, value in fixed.items():
        shown[:, robot.joint_names.index(name)] = value
    stay = of_file_units(robot, shown)
    columns = [robot.joint_names.index(name) for name in fixed]
    q = q.copy()
    q[:, columns] = stay[:, columns]
    return q


def _constraint(
    room: Mask, values: Array, shares: tuple[float, ...], reach: float
) -> tuple[Mask, float | None]:
    """The largest round bound below `values` that leaves room, and the poses within it [mm]."""
    step = 50.0 if reach > 1 else 10.0
    for share in shares:
        bound = step * round(1e3 * share * reach / step)
        left = room & (1e3 * values > bound)
        if left.mean() >= SUGGESTED.room:
            return left, bound
    return room, None


def _compliance(robot: Robot, q: Array, force: Array, free: list[int]) -> dict[str, float]:
    """Compliances with which the largest load turns each gear by minutes of arc, two digits."""
    J = robot.jacobian(q)
    torque = np.abs(np.einsum("sij,i->sj", J, force)).max(axis=0)
    return {
        robot.joint_names[j]: float(f"{BENT[_kind(robot.joints[j])] / torque[j]:.2g}")
        for j in free
        if torque[j] > 0
    }


def _kind(joint: Joint) -> str:
    """Whether a joint slides or turns, be it on and on."""
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def _test_pose(robot: Robot, q: Array, force: Array, free: list[int]) -> tuple[float, ...]:
    """A pose (n,) in the middle of the limits, rounded, in which the task loads every joint.

    Its score is the smaller one of two shares: of the largest smallest singular value of the
    Jacobian, in which lengths count beside the reach, and for the joint that is the least loaded,
    of the most that it is loaded anywhere.
    """
    middle, half = _range(robot)
    central = (np.abs(q - middle)[:, free] <= 2 * SUGGESTED.middle * half[free]).all(axis=1)
    chosen = q[central] if central.any() else q
    most = _moved(robot, q, force)[:, free].max(axis=0)
    best = chosen[np.argsort(-_score(robot, chosen, force, free, most))[: SUGGESTED.best]]
    steps = np.array([TYPED[_kind(joint)] for joint in robot.joints])
    shown = in_file_units(robot, best)
    rounded = shown.copy()
    rounded[:, free] = (np.round(shown / steps) * steps + 0.0)[:, free]
    typed = of_file_units(robot, rounded)
    lower, upper = robot.limits
    allowed = ((typed >= lower) & (typed <= upper)).all(axis=1)
    allowed &= robot.bounds.coupled.hold(typed)
    if allowed.any():
        typed = typed[allowed]
        rounded = rounded[allowed]
    score = _score(robot, typed, force, free, most)
    return tuple(in_file_units(robot, typed)[int(score.argmax())].tolist())


def _score(robot: Robot, q: Array, force: Array, free: list[int], most: Array) -> Array:
    """How regular and how well loaded poses (s, n) are, from 0 to 1."""
    J = robot.jacobian(q)[..., free]
    lever = np.array([robot.reach] * 3 + [1.0] * 3)[:, None]
    least = np.linalg.svd(J / lever, compute_uv=False)[:, -1]
    loaded = (_moved(robot, q, force)[:, free] / np.where(most > 0, most, 1.0)).min(axis=1)
    return np.asarray(np.minimum(least / max(least.max(), 1e-300), loaded))


# Key, margin from limits, and its unit in SI, by kind of joint.
MARGINS = {"revolute": ("margin_deg", 2.0, np.pi / 180), "prismatic": ("margin_mm", 5.0, 1e-3)}
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
    least = max(SUGGESTED.least_size, -(-len(found.compliance) // 3) + 1)
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
        "",
        _comment("# [noise]", "with both lines, plans count friction, bearings and links, too;"),
        _comment("# model_error_percent = 10", "a search then takes three times as long"),
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
    return [*lines, *(f"# In poses {sentence}." for sentence in motors_in_words(robot))]


def _margins(robot: Robot, found: FirstChoices) -> dict[str, float]:
    """How far plans keep away from limits, for each kind of joint that moves."""
    margins = {}
    for kind, (key, margin, unit) in MARGINS.items():
        moving = [j for j in robot.joints if j.kind == kind and j.name not in found.fixed]
        least = min((joint.limits[1] - joint.limits[0] for joint in moving), default=0.0)
        if least > SUGGESTED.least_range * margin * unit:
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
