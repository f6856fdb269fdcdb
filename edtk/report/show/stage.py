"""What is to be seen of a plan: the arm, what stands around it, poses, loads, marks and beams."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from criteria import Criterion
from edtk.calibration.calibration import Calibration
from edtk.calibration.result_file import MeasuredPoses
from edtk.calibration.timetable import day_of, has_day
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Mesh, Shape
from edtk.cell.sight import Sight
from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.design.tours import visiting_order
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.measure.pose_table import in_file_units, rounded
from edtk.robots.frames import BodyPoint, Frames
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.system.typing import Array, Indices

POSES_OF_PAGE = 2000  # poses of a page: its file stays small, and nobody looks at more
MOST_SHARES = 200  # poses up to which it is told what each brings: a plan without each is looked at
LINK = (0.040, 0.018)  # radius of the first and of the last link, over the length of the chain
DRUM = (1.25, 1.15)  # radius and half length of a joint, over the radius of its link
TOOL = 0.6  # radius of the tool over that of the last link
MOST_TRIANGLES = 4000  # of a body that is drawn as such: a page stays small
SHORTEST = 1e-3  # of a link that is drawn, over the length of the chain
FOOT = (1.9, 0.4)  # radius and height of the base, over the radius of the first link
TIP = -2  # carrier of what is given in the tool frame; -1 is the world
WORLD = -1
MEASURED = "in the order of measuring"
OF_SHEET = "in the order of the sheet"
NO_SPRINGS = "No compliance is known: [simulation] may guess some, and a k.json has them."


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the picture.

    Attributes:
        name: Name for people.
        kind: "link", "joint", "tool" or "load" of the arm, and "around" for what does not move.
        carrier: Index of the joint among all of the chain that moves it; `WORLD`, or `TIP`.
        shapes: Its shapes, in the frame of the carrier [m].
        hangs_at: The point (3,) of the carrier from which it hangs [m]: its shapes are then given
            from there on, in world axes. None for a part that the carrier turns.
    """

    name: str
    kind: str
    carrier: int
    shapes: tuple[Shape | Mesh, ...]
    hangs_at: Array | None = None


@dataclass(frozen=True, eq=False)
class Mark:
    """A point of the arm that an instrument looks at.

    Attributes:
        name: Name for people.
        point: Where it is.
        anchor: The fixed end (3,) of a wire that ends there [m]; None for a marker.
        normal: Where its reflector looks (3,), in the frame of its body; None for all around.
    """

    name: str
    point: BodyPoint
    anchor: Array | None = None
    normal: Array | None = None


@dataclass(frozen=True, eq=False)
class Shade:
    """A number of each pose, by which it is coloured.

    Attributes:
        name: What it is, with its unit: "share of information [%]".
        words: The same in a sentence.
        values: The numbers (m,); NaN where there is none.
        beside: What is said beside each number (m,); none by default.
        alarm: Below which something touches; None for numbers that say nothing of that.
    """

    name: str
    words: str
    values: Array
    beside: tuple[str, ...] = ()
    alarm: float | None = None


@dataclass(frozen=True, eq=False)
class Stage:
    """All that a page or a plate shows.

    Attributes:
        title: Heading.
        robot: The robot with its tool.
        q: Poses (m, n) in the order in which they are measured [rad or m].
        wrench: Their loads (m, 6 or 9) [N, N m].
        repeats: How often each is measured (m,).
        names: What each is called (m,).
        left_out: How many more poses there are that are not shown.
        marks: Markers and ends of wires.
        load_point: Where loads act.
        parts: The arm and its surroundings.
        turns: By how much the load turns each joint of the chain (m, N) [rad or m]; None where no
            compliance is known.
        springs: Whose compliances these turns have, in words.
        shades: Numbers by which poses may be coloured.
        ordered: Whether the order is that of measuring, in words.
        ways: Via poses (k, n) between each two poses that follow each other; none where joints go
            straight from one to the next.
        blocked: Poses, counted from 0, to which no free way was found.
        eyes: Names and places (3,) of what must see the markers [m].
        hidden: Why each mark is not read in each pose; empty where it is.
    """

    title: str
    robot: Robot
    q: Array
    wrench: Array
    repeats: Indices
    names: tuple[str, ...]
    left_out: int = 0
    marks: tuple[Mark, ...] = ()
    load_point: BodyPoint = field(default_factory=BodyPoint)
    parts: tuple[Part, ...] = ()
    turns: Array | None = None
    springs: str = ""
    shades: tuple[Shade, ...] = ()
    ordered: str = ""
    ways: tuple[Array, ...] = ()
    blocked: tuple[int, ...] = ()
    eyes: tuple[tuple[str, Array], ...] = ()
    hidden: tuple[tuple[str, ...], ...] = ()

    @cached_property
    def frames(self) -> Frames:
        """The chain with all its bodies in all poses."""
        return self.robot.frames(self.q, bodies=range(len(self.robot.chain)))

    @cached_property
    def shown(self) -> Array:
        """Poses (m, n) as the controller shows them [deg or mm]."""
        return in_file_units(self.robot, self.q)


def place_of(stage: Stage, part: Part, pose: int) -> tuple[Array, Array]:
    """Rotation (3, 3) and origin (3,) of the frame of a part's shapes in a pose [m]."""
    rotation, origin = place(stage, part.carrier, pose)
    if part.hangs_at is None:
        return rotation, origin
    return np.eye(3), origin + rotation @ part.hangs_at


def place(stage: Stage, carrier: int, pose: int) -> tuple[Array, Array]:
    """Rotation (3, 3) and origin (3,) of a carrier's frame in a pose [m]."""
    if carrier == WORLD:
        return np.eye(3), np.zeros(3)
    frames = stage.frames
    rotation, origin = (
        (frames.rotation, frames.position) if carrier == TIP else frames.bodies[carrier]
    )
    return rotation[..., pose].T, origin[..., pose]


def carrier_of(point: BodyPoint) -> int:
    """The carrier in whose frame a point's offset is."""
    return TIP if point.joint is None else point.joint


def marks_of(model: ElastostaticModel) -> tuple[Mark, ...]:
    """The points that the instruments of a model look at."""
    found = []
    for i, sensor in enumerate(model.instruments):
        anchor = sensor.anchor if isinstance(sensor, Distance) else None
        name = sensor.name or (f"marker {i + 1}" if len(model.instruments) > 1 else "marker")
        found.append(Mark(name, sensor.point, anchor))
    return tuple(found)


def skeleton(robot: Robot) -> tuple[Part, ...]:
    """An arm where nobody says what its bodies look like: capsules from joint to joint.

    Lengths and axes are those of the drawing; radii are made up, and grow smaller to the tip.
    """
    chain = robot.chain
    steps = [np.linalg.norm(joint.origin[:3, 3]) for joint in chain]
    length = float(sum(steps) + np.linalg.norm(robot.tool[:3, 3])) or 1.0
    radii = length * np.linspace(*LINK, len(chain) + 1)
    least = SHORTEST * length
    parts = [_foot(robot, radii[0])]
    for i, joint in enumerate(chain):
        before = robot.base if i == 0 else transform()
        carrier = i - 1 if i else WORLD
        origin = before @ joint.origin
        link: list[Shape] = [*_capsule(before[:3, 3], origin[:3, 3], radii[i], least)]
        if i == 0:
            link = [_column(one) for one in link if isinstance(one, Capsule)]
        if joint.kind == "prismatic":
            low, high = (x * origin[:3, :3] @ joint.axis for x in _travel(joint.limits))
            middle = origin[:3, 3]
            link += _capsule(middle + low, middle + high, 0.55 * radii[i], least)
        if link:
            parts.append(Part(f"link {i}" if i else "base", "link", carrier, tuple(link)))
        parts.append(Part(joint.name, "joint", i, (_drum(joint.axis, joint.kind, radii[i]),)))
    return (*parts, *_tool(robot, TOOL * radii[-1], least))


def _travel(limits: tuple[float, float]) -> tuple[float, float]:
    """Where a slide begins and ends [m], of which there is no picture without limits."""
    low, high = limits
    return (low, high) if np.isfinite([low, high]).all() else (0.0, 0.0)


def _capsule(start: Array, end: Array, radius: float, least: float) -> Iterator[Capsule]:
    """A capsule between two points, unless they are one."""
    if np.linalg.norm(end - start) > least:
        yield Capsule(start, end, float(radius))


def _column(capsule: Capsule) -> Cylinder:
    """The same with flat ends, one of which stands on the floor."""
    pose = transform((capsule.start + capsule.end) / 2)
    pose[:3, :3] = _along((capsule.end - capsule.start) / capsule.length)
    return Cylinder(pose, capsule.radius, capsule.length / 2)


def _drum(axis: Array, kind: str, radius: float) -> Shape:
    """A joint: a drum along its axis, or a block if it slides."""
    pose = transform()
    pose[:3, :3] = _along(axis)
    wide, half = (factor * radius for factor in DRUM)
    if kind == "prismatic":
        return Box(pose, np.array([wide, wide, half]))
    return Cylinder(pose, wide, half)


def _foot(robot: Robot, radius: float) -> Part:
    """A disc under the base."""
    pose = robot.base.copy()
    wide, high = (factor * radius for factor in FOOT)
    pose[:3, 3] += 0.5 * high * pose[:3, 2]
    return Part("foot", "link", WORLD, (Cylinder(pose, wide, 0.5 * high),))


def _tool(robot: Robot, radius: float, least: float) -> Iterator[Part]:
    """The way from the last joint by the flange to the tool point."""
    last = len(robot.chain) - 1
    points = [np.zeros(3), robot.flange[:3, 3], robot.tool[:3, 3]]
    shapes = [one for a, b in pairwise(points) for one in _capsule(a, b, radius, least)]
    if shapes:
        yield Part("tool", "tool", last, tuple(shapes))


def _along(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is an axis."""
    aside = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    aside /= np.linalg.norm(aside)
    return np.stack([aside, np.cross(axis, aside), axis], axis=1)


def parts_of(study: Study) -> tuple[Part, ...]:
    """The bodies of a study's cell; a sketch of the arm where they have none of it."""
    bodies = () if study.cell is None else study.cell.bodies
    around = _names_of_scene(study)
    parts = tuple(_part_of(body, study.robot, around) for body in bodies)
    if not any(part.carrier != WORLD and part.kind == "link" for part in parts):
        return (*skeleton(study.robot), *parts)
    parts += tuple(_rods(study.robot, {part.carrier for part in parts if part.kind == "link"}))
    return parts if any(part.kind == "tool" for part in parts) else (*parts, *_thin_tool(study))


def _rods(robot: Robot, drawn: set[int]) -> Iterator[Part]:
    """Links of the sketch that lead on where a link has no body, in the colour of joints."""
    for one in skeleton(robot):
        if one.kind == "link" and one.carrier not in drawn | {WORLD}:
            yield replace(one, kind="joint")


def _names_of_scene(study: Study) -> frozenset[str]:
    """Names of the bodies that `[scene]` adds to the robot's own."""
    scene = study.specification.scene
    if scene is None:
        return frozenset()
    tables = (scene.box, scene.cylinder, scene.capsule, scene.plane, scene.mesh)
    return frozenset(one.name for group in tables for one in group)


def _part_of(body: Body, robot: Robot, around: frozenset[str]) -> Part:
    """A body as a part; triangles, where there are any, in place of what contains them."""
    last = len(robot.chain) - 1
    kind = "link"
    if body.hangs_at is not None:
        kind = "load"
    elif body.carrier is None and body.name in around:
        kind = "around"
    elif body.name == "tool" or (body.carrier == last and body.name in around):
        kind = "tool"
    carrier = WORLD if body.carrier is None else body.carrier
    small = sum(len(mesh.faces) for mesh in body.meshes) <= MOST_TRIANGLES
    shapes = body.meshes if body.meshes and small else body.shapes
    return Part(body.name, kind, carrier, tuple(shapes), body.hangs_at)


def _thin_tool(study: Study) -> Iterator[Part]:
    """The way to the tool point, where no body has it."""
    lengths = [np.linalg.norm(joint.origin[:3, 3]) for joint in study.robot.chain]
    length = float(sum(lengths)) or 1.0
    return _tool(study.robot, TOOL * LINK[1] * length, SHORTEST * length)


def clearances(study: Study, q: Array) -> Shade | None:
    """How far the arm is from touching something in each pose; None without a `[scene]`."""
    if study.cell is None:
        return None
    found = study.cell.clearance(q)
    words = "Least distance of two bodies in each pose, less the margin; below zero they touch."
    pairs = tuple(
        " and ".join(names) if names else "" for names in (found.names(i) for i in range(len(q)))
    )
    return Shade("clearance [mm]", words, 1e3 * found.least, pairs, alarm=0.0)


def turned(model: ElastostaticModel, q: Array, wrench: Array, k: Array) -> Array:
    """By how much loads turn each joint of the chain (m, N): ``k_j tau_j`` [rad or m].

    Args:
        model: The model, which says where loads act.
        q: Poses (m, n).
        wrench: Their loads (m, 6 or 9) [N, N m].
        k: Compliances (n,) of the free joints [rad/(N m)].
    """
    frames = model.frames(q)
    turns = np.asarray(k)[:, None] * model.torque_of(frames, wrench)
    return np.asarray(frames.spread(turns).T)


def shares(information: Callable[[Plan], Array], criterion: Criterion, plan: Plan) -> Shade | None:
    """What share of what a plan tells each of its poses brings, all of its repetitions together.

    With the gradient G of the cost at the information M of the plan, and ``M_i`` of the plan
    without pose i, that is ``<G, M - M_i> / <G, M>``: to first order the part of the cost that
    hangs on the pose. For A and rho0 these are the sensitivities of the design, over their sum.

    Args:
        information: Information (p, p) of a plan, with what is known besides.
        criterion: The criterion.
        plan: The plan.

    Returns:
        The shares [%]; None where the plan tells too little, or has a single pose or very many.
    """
    if not 1 < len(plan.q) <= MOST_SHARES:
        return None
    M = information(plan)
    if not np.isfinite(criterion.cost(M)):
        return None
    slope = criterion.gradient(M)
    every = np.arange(len(plan.q))
    others = (
        Plan(plan.q[every != i], plan.wrench[every != i], plan.repeats[every != i]) for i in every
    )
    lost = np.array([np.sum(slope * (M - information(one))) for one in others])
    whole = np.sum(slope * M)
    if not np.isfinite(lost).all() or not whole:
        return None
    words = f"Share of what the plan tells about {criterion.label} that hangs on each pose."
    return Shade("share of information [%]", words, np.maximum(100 * lost / whole, 0.0))


def residuals(found: MeasuredPoses) -> Shade:
    """How far the fit is from what was read in each pose."""
    words = "Distance of what was measured from the fit, root mean square in each pose."
    return Shade("residual [mm]", words, 1e3 * found.residual)


def stage_of(
    study: Study,
    plan: Plan,
    *,
    ordered: str,
    compliances: Mapping[str, float] | None = None,
    shades: Iterable[Shade | None] = (),
) -> Stage:
    """The poses of a plan for a study, in the order in which they are given.

    Args:
        study: The study.
        plan: The experiments.
        ordered: What order it is, in words.
        compliances: Those by name of joint [rad/(N m)]; by default what the study knows or guesses.
        shades: Numbers of the poses; None where there is none.
    """
    table = study.specification.noise
    tracker = None if table is None else table.tracker()
    k, springs = _springs(study, compliances)
    shades = (*shades, clearances(study, plan.q[:POSES_OF_PAGE]))
    found = _stage(
        study.model,
        plan,
        parts_of(study),
        title=study.specification.title,
        tracker=None if tracker is None else tracker.position,
        k=k,
        springs=springs,
        shades=shades,
        ordered=ordered,
    )
    return found if study.sight is None else _seen(found, study.sight)


def _seen(stage: Stage, sight: Sight) -> Stage:
    """The same with what the instruments see."""
    eyes = tuple((eye.name, eye.position) for eye in sight.eyes)
    if len(sight.reflectors) != len(stage.marks):
        return replace(stage, eyes=eyes)
    marks = tuple(
        mark if one is None else replace(mark, normal=one.normal)
        for mark, one in zip(stage.marks, sight.reflectors, strict=True)
    )
    why = tuple(
        tuple("" if one is None else str(one) for one in pose) for pose in sight.hidden(stage.q)
    )
    return replace(stage, eyes=eyes, marks=marks, hidden=why)


def stage_of_space(space: DesignSpace, plan: Plan, shade: Shade | None) -> Stage:
    """The same of a plan that knows its design space, and no study."""
    robot = space.model.robot
    tracker = None if space.noise is None else space.noise.tracker
    return _stage(
        space.model,
        plan,
        skeleton(robot),
        title=f"Plan for {robot.name}",
        tracker=None if tracker is None else tracker.position,
        k=None,
        springs=NO_SPRINGS,
        shades=(shade,),
        ordered=MEASURED,
    )


def by_travel(robot: Robot, plan: Plan) -> Plan:
    """The experiments of a plan in an order of little travel."""
    lower, upper = robot.limits
    return _chosen(plan, visiting_order(plan.q, upper - lower))


def stage_of_plan(
    study: Study, plan: Plan, shade: Callable[[Plan], Shade | None] | None = None
) -> Stage:
    """The experiments of a plan as its sheet has them: in its order, rounded, and each once.

    Args:
        study: The study.
        plan: The plan, in any order.
        shade: Numbers of the poses of the plan that is shown, such as their shares.
    """
    from edtk.calibration.template import sheet_order  # loads searches, which results do without

    plan = Plan(rounded(study.robot, plan.q), plan.wrench, plan.repeats)
    order = list(dict.fromkeys(sheet_order(study, plan).tolist()))
    chosen = _chosen(plan, np.array(order))
    shades = () if shade is None else (shade(chosen),)
    found = stage_of(study, chosen, ordered=MEASURED, shades=shades)
    ways, blocked = _ways(study, plan, order)
    return replace(found, ways=ways[: len(found.q) - 1], blocked=blocked)


def _ways(study: Study, plan: Plan, order: list[int]) -> tuple[tuple[Array, ...], tuple[int, ...]]:
    """Where the arm goes between first visits (k, n), and to which no free way was found.

    Between these poses joints go in step. Nothing is known where the study says neither how long
    things take nor what stands around the robot.
    """
    if not has_day(study):
        return (), ()
    day = day_of(study, plan)
    found: dict[int, Array] = {}
    passed: list[Array] = []
    for step in day.steps:
        passed += [] if step.way is None else list(step.way.via)
        if step.row is None or step.row in found:
            passed.append(step.q)
            continue
        found[step.row] = np.reshape(passed, (-1, study.robot.n))
        passed = []
    if list(found) != order:
        return (), ()
    rows = {step.row for step in day.blocked}
    blocked = tuple(i for i, row in enumerate(order) if row in rows)
    return tuple(found.values())[1:], blocked


def _chosen(plan: Plan, order: Indices) -> Plan:
    return Plan(plan.q[order], plan.wrench[order], plan.repeats[order])


def _springs(study: Study, given: Mapping[str, float] | None) -> tuple[Array | None, str]:
    """Compliances (n,) of all joints, and whose they are; None where none is known."""
    names = study.robot.joint_names
    k = np.zeros(study.robot.n)
    k[list(study.known)] = list(study.known.values())
    words = "Bent by the compliances that were identified."
    if given is None:
        simulation = study.specification.simulation
        given = {} if simulation is None else simulation.compliance_rad_per_Nm
        words = "Bent by the compliances that [simulation] assumes."
    for name, value in given.items():
        if name in names:
            k[names.index(name)] = value
    return (k, words) if k.any() else (None, NO_SPRINGS)


def _stage(
    model: ElastostaticModel,
    plan: Plan,
    parts: tuple[Part, ...],
    *,
    title: str,
    tracker: Array | None,
    k: Array | None,
    springs: str,
    shades: Iterable[Shade | None],
    ordered: str,
) -> Stage:
    """The stage of a model, of whose poses the first ones are shown."""
    shown = slice(0, POSES_OF_PAGE)
    q, wrench = plan.q[shown], plan.wrench[shown]
    loaded = k is not None and bool(wrench.any())
    return Stage(
        title=title,
        robot=model.robot,
        q=q,
        wrench=wrench,
        repeats=plan.repeats[shown],
        names=tuple(str(i + 1) for i in range(len(q))),
        left_out=len(plan.q) - len(q),
        marks=marks_of(model),
        eyes=() if tracker is None else (("tracker", tracker),),
        load_point=model.load_point,
        parts=parts,
        turns=turned(model, q, wrench, k) if loaded and k is not None else None,
        springs=springs,
        shades=tuple(
            replace(one, values=one.values[shown], beside=one.beside[shown])
            for one in shades
            if one is not None
        ),
        ordered=ordered,
    )


def stage_of_calibration(found: Calibration) -> Stage:
    """The poses of a calibration, with the springs that it found and the residuals."""
    poses = found.measured_poses
    study = found.study
    return stage_of(
        study, poses.plan, ordered=OF_SHEET, compliances=found.k, shades=[residuals(poses)]
    )


def stage_of_robot(robot: Robot, q: Array) -> Stage:
    """A robot in some poses (m, n), and nothing else."""
    plan = Plan(q, np.zeros((len(q), 6)), np.ones(len(q), dtype=int))
    found = _stage(
        ElastostaticModel(robot),
        plan,
        skeleton(robot),
        title=robot.name,
        tracker=None,
        k=None,
        springs=NO_SPRINGS,
        shades=(),
        ordered="",
    )
    return replace(found, marks=())
