"""What in a study or in the promise of a plan is hard to believe: a unit, most of the time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice

import numpy as np

import criteria
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.plan import Plan
from edtk.findings.finding import Data, Finding, Severity, Wording
from edtk.fit.least_squares import SingularPlanError, covariance
from edtk.measure.expected_error import SOFTEST, WITHIN, ExpectedError, compensation_accuracy
from edtk.measure.pose_table import of_file_units
from edtk.robots.weights import GRAVITY
from edtk.robots.workspace import neighbourhood
from edtk.study.study_model import on_robot, own_scale
from edtk.study.study_objects import StudyObjects
from edtk.study.tables_of_task import Tool
from edtk.system.typing import Array, Indices

MOST_NAMED = 4


# Radians of a test pose are within one turn, and have digits that nobody types in degrees.
ONE_TURN = 2 * np.pi


@dataclass(frozen=True)
class Plausible:
    """What arms, tools, loads and noises are like; beyond that a study is hard to believe."""

    # The longest serial arms reach 5 m, painting and erection robots 15 m; in millimetres already a
    # desk-top arm would have links of 200.
    longest_links: float = 50.0  # [m]
    # The smallest reflector of a laser tracker has a radius of 6.35 mm: nearer no marker gets. In
    # metres a tool of up to 3 m would be given by so small a number.
    shortest_tool: float = 3e-3  # [m]
    small_arm: float = 0.3  # total length of links up to which a tool may be so small [m]
    longest_tool: float = 3.0  # length of a tool beside that of all links
    typed_step: float = 0.05  # step of angles that people type [deg]
    least_angle: float = 0.5  # the largest angle of a pose in radians that is not a pose at rest
    # Gears are chosen so that full load turns them by minutes of arc: 1e-3 rad a joint, and the
    # tool by up to three such turns times the reach.
    sag: float = 3e-3  # deflection beside the reach
    interferometer: float = 1e-7  # no device measures displacements of a robot better, in air [m]
    on_axis: float = 5e-3  # least lever of a joint, below the radius of the smallest reflector [m]
    judged_poses: int = 255  # poses within the joint limits in which loads are judged
    upright: float = 0.5  # share of a load along z, from which it counts as up or down
    # Times the error in the test pose: plans for all parameters have about the same.
    poor_around: float = 3.0
    # A plan that suits all parameters gives each a standard deviation of two to ten times the best
    # that it could have alone; thirty times is that of a thousandth of the experiments.
    hardly_excited: float = 30.0
    uncertain: float = 0.5  # standard deviation beside the parameter itself, where that is known
    tried_experiments: int = 300  # among which the best experiment for each parameter is looked for


PLAUSIBLE = Plausible()


def plausibility(study: StudyObjects) -> tuple[Finding, ...]:
    """Find what a study says that is physically hard to believe.

    Args:
        study: The study.

    Returns:
        The findings, whose words name the key.
    """
    length = length_of_links(study)
    if length > PLAUSIBLE.longest_links:
        # Nothing else can be judged by such an arm.
        return (Finding.of(Severity.WARNING, WORDING, "long_links", length=length),)
    checks = (_tools, _markers, _pose_unit, _upwards, _in_cell, *study.kind.hard_to_believe)
    return tuple(one for check in checks for one in check(study))


def length_of_links(study: StudyObjects) -> float:
    """Total length of the links between the joints [m]."""
    origins = (joint.origin[:3, 3] for joint in study.robot.joints)
    return float(sum(np.linalg.norm(origin) for origin in origins))


def _tools(study: StudyObjects) -> Iterator[Finding]:
    """Tools in metres, and tools that are longer than the robot."""
    given = study.specification
    tables: dict[str, Tool | None] = {"tool": given.tool}
    for i, pose in enumerate(given.test_poses):
        tables[f"{study.key_of(i)}.tool"] = pose.tool
    if given.task is not None:
        tables["task.tool"] = given.task.tool
    tools = {key: one.build() for key, one in tables.items() if one is not None}
    links = length_of_links(study)
    seen: list[Array] = []
    for key, tool in tools.items():
        # Many poses share a tool, whose mistake is one.
        if any(np.array_equal(tool, other) for other in seen):
            continue
        seen.append(tool)
        length = float(np.linalg.norm(tool[:3, 3]))
        there = {"key": key, "length": length, "place": study.robot.tool_is_from}
        if 0 < length < PLAUSIBLE.shortest_tool and links > PLAUSIBLE.small_arm:
            yield Finding.of(Severity.WARNING, WORDING, "short_tool", **there)
        elif length > PLAUSIBLE.longest_tool * links > 0:
            yield Finding.of(Severity.WARNING, WORDING, "long_tool", links=links, **there)


def _markers(study: StudyObjects) -> Iterator[Finding]:
    """Markers that are counted from the flange, as the tool point is."""
    tool = study.specification.tool
    for marker, name in on_robot(study):
        if tool is None or marker.joint is not None or not any(marker.position_mm):
            continue
        if tuple(marker.position_mm) == tuple(tool.position_mm):
            yield Finding.of(Severity.WARNING, WORDING, "marker_as_tool", name=name)


def _pose_unit(study: StudyObjects) -> Iterator[Finding]:
    """The first test pose whose angles look like radians."""
    poses = enumerate(study.specification.test_poses)
    odd = (_unit_of_pose(study, np.array(p.q_deg), f"{study.key_of(i)}.q_deg") for i, p in poses)
    yield from islice(chain.from_iterable(odd), 1)


def _unit_of_pose(study: StudyObjects, q_deg: Array, key: str) -> Iterator[Finding]:
    """A pose (n,) whose angles look like radians."""
    angles = q_deg[~study.robot.slides]
    if is_like_radians(angles):
        yield Finding.of(
            Severity.WARNING, WORDING, "angle_unit", key=key, largest=float(np.abs(angles).max())
        )


def is_like_radians(angles: Array) -> bool:
    """Whether the angles (n,) of one pose are small, and of more digits than people type [deg]."""
    moved = angles[angles != 0]
    odd = np.abs(moved / PLAUSIBLE.typed_step - np.round(moved / PLAUSIBLE.typed_step)) > 1e-6
    small = bool((np.abs(angles) <= ONE_TURN).all())
    # Three joints at least: with fewer, small odd angles may well be degrees.
    many = odd.sum() >= max(3, len(moved) / 2)
    return small and bool(many) and float(np.abs(moved).max()) >= PLAUSIBLE.least_angle


def _upwards(study: StudyObjects) -> Iterator[Finding]:
    """A load that pulls upwards, where weights pull down."""
    load = study.specification.load
    force = getattr(load, "F_N", None)
    if not isinstance(force, list | tuple) or len(force) != 3:
        return
    up = force[2]
    if (
        isinstance(up, int | float)
        and up >= PLAUSIBLE.upright * np.linalg.norm(np.array(force, float)) > 0
    ):
        yield Finding.of(Severity.WARNING, WORDING, "upward_load", force=up)


def _in_cell(study: StudyObjects) -> Iterator[Finding]:
    """Test poses in which something touches, with the calibration tool and what hangs on it."""
    if study.cell is None or not study.specification.test_poses:
        return
    given = np.array([pose.q_deg for pose in study.specification.test_poses])
    found = study.cell.clearance(of_file_units(study.robot, given))
    for i in np.flatnonzero(~found.free).tolist():
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "test_pose_touches",
            key=study.key_of(i),
            pair=found.names(i),
            clearance=float(found.least[i]),
            margin=study.cell.margin,
        )


def doubtful_noise(study: StudyObjects) -> Iterator[Finding]:
    """Noise beside the deflection under load, which is what is measured."""
    sigma = study.least_error(anywhere(study)[:, : study.robot.n])
    name = "measurement.sigma_mm" if study.noise is None else "noise"
    if sigma < PLAUSIBLE.interferometer:
        yield Finding.of(Severity.WARNING, WORDING, "fine_noise", key=name, sigma=sigma)
    A, _ = _sampled(study)
    k = own_scale(study)
    known = bool(np.isfinite(k).all())
    if known:
        bent = float(np.linalg.norm(A @ k, axis=1).max())
    else:
        soft = float((SOFTEST * np.linalg.norm(A, axis=1)).sum(axis=-1).max())
        bent = min(PLAUSIBLE.sag * length_of_links(study), soft)
    if 0 < bent <= sigma:
        yield Finding.of(
            Severity.WARNING, WORDING, "coarse_noise", key=name, sigma=sigma, bent=bent, known=known
        )


def idle_axes(study: StudyObjects) -> Iterator[Finding]:
    """Joints whose axis runs through the tool point, or that no load turns."""
    if any(_tools(study)):
        return  # the cause is named already
    A, size = _sampled(study)
    # A column is torque times lever, of order force times lever squared.
    lever = np.sqrt(np.linalg.norm(A, axis=1).max(axis=0) / size)
    names = np.array(study.specification.joints.unknown)[lever < PLAUSIBLE.on_axis]
    if len(names):
        yield Finding.of(Severity.WARNING, WORDING, "no_lever", joints=tuple(names.tolist()))


def _sampled(study: StudyObjects) -> tuple[Array, float]:
    """Regressors of experiments anywhere within limits, and the largest load [N].

    Of the tool point they have the position rows alone (s, 3, p).
    """
    plan = study.space.plan(anywhere(study), np.ones(PLAUSIBLE.judged_poses, dtype=int))
    force = np.linalg.norm(plan.wrench[:, :3], axis=1)
    torque = np.linalg.norm(plan.wrench[:, 3:], axis=1)
    load = float((force + torque / study.robot.reach).max())
    if study.model.weights is not None:
        load += GRAVITY * float(study.model.weights.carried.max())
    # Without any load nothing is excited, which the design itself reports.
    A = study.model.regressor(plan.q, plan.wrench)
    return A[:, :3] if study.model.is_plain else A, load or 1.0


def anywhere(study: StudyObjects) -> Array:
    """Experiments (s, v) anywhere within the limits, feasible or not."""
    space = study.space
    return space.draw(np.random.default_rng(0).random((PLAUSIBLE.judged_poses, len(space.drawn))))


def listed(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{', '.join(names[:MOST_NAMED])}{more}"


def poor_around(expected: ExpectedError) -> tuple[Finding, ...]:
    """A finding where the error around the test poses is several times that in them.

    Args:
        expected: Errors to expect of the plan.
    """
    # What is told exactly in a test pose is compared with nothing.
    if not 0 < PLAUSIBLE.poor_around * expected.test_pose < expected.mean:
        return ()
    return (
        Finding.of(
            Severity.WARNING,
            WORDING,
            "poor_around",
            poses=expected.poses,
            within=expected.within,
            mean=expected.mean,
            test_pose=expected.test_pose,
        ),
    )


def plan_plausibility(
    study: StudyObjects, plan: Plan, expected: ExpectedError | None = None
) -> tuple[Finding, ...]:
    """Find what is hard to believe, or a pity, in what a plan promises.

    Args:
        study: The study.
        plan: All experiments.
        expected: Errors to expect in the test poses and around them; None where they are unknown.

    Returns:
        The findings.
    """
    try:
        cov = covariance(study.information(plan), study.model.parameters)
    except SingularPlanError as error:
        return tuple(_untold(study, error.parameters))
    if length_of_links(study) > PLAUSIBLE.longest_links:
        return ()
    around = () if expected is None else poor_around(expected)
    return (*_useless(study, cov), *_hardly_excited(study, cov, plan.experiments), *around)


def _untold(study: StudyObjects, parameters: Sequence[str]) -> Iterator[Finding]:
    """Parameters that a plan leaves open, as the criterion does not ask for them."""
    bad = np.array([study.model.parameters.index(name) for name in parameters])
    yield Finding.of(
        Severity.WARNING, WORDING, "not_told", parameters=tuple(parameters), cure=_cure(study, bad)
    )


def _useless(study: StudyObjects, cov: Array) -> Iterator[Finding]:
    """An error after compensation that is larger than the one before."""
    if not study.tasks:
        return
    A = study.tasks.regressor
    after = float(compensation_accuracy(A, cov))
    k = own_scale(study)
    known = bool(np.isfinite(k).all())
    before = float(np.linalg.norm(A @ k)) if known else PLAUSIBLE.sag * length_of_links(study)
    if 0 < before < after:
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "useless",
            poses=len(study.tasks),
            after=after,
            before=before,
            known=known,
        )


def _hardly_excited(study: StudyObjects, cov: Array, experiments: int) -> Iterator[Finding]:
    """Parameters about which a plan says much less than it could."""
    std = np.sqrt(np.diag(cov))
    share = std / own_scale(study)
    ratio = std / _best_alone(study, anywhere(study), experiments)
    # Feasible poses tell less than any poses do; they are drawn, which may take seconds, only where
    # they could make a difference.
    if (ratio[np.isnan(share)] > PLAUSIBLE.hardly_excited).any():
        ratio = std / _best_alone(study, _candidates(study), experiments)
    # Beside its own size a parameter is judged by that, and else by what plans could do.
    bad = np.flatnonzero(
        np.where(np.isfinite(share), share > PLAUSIBLE.uncertain, ratio > PLAUSIBLE.hardly_excited)
    )
    if not len(bad):
        return
    yield Finding.of(
        Severity.WARNING,
        WORDING,
        "hardly_told",
        parameters=tuple(study.model.parameters[i] for i in bad),
        of_itself=tuple(float(x) if np.isfinite(x) else None for x in share[bad]),
        of_best=tuple(ratio[bad].tolist()),
        cure=_cure(study, bad),
    )


def _cure(study: StudyObjects, bad: Indices) -> str:
    """What helps against parameters (indices) that are hardly excited."""
    tasks = study.tasks
    if tasks and criteria.get(study.main_criterion).needs_target:
        around = (neighbourhood(one.robot, one.q, one.within or WITHIN) for one in tasks)
        harms = (one.harm(poses) for one, poses in zip(tasks, around, strict=True))
        # rho0 asks for a parameter only if it does harm in the task.
        if not any(A[..., bad].any() for A in harms):
            return "the task does not load it; for other tasks optimise another criterion such as D"
        if not any(one.within for one in tasks):
            return "set robust_deg in [test_pose], or optimise another criterion such as D"
    return "plan more experiments, or optimise another criterion such as D"


def _round(number: float) -> str:
    """Two digits, without an exponent where people would not write one."""
    return f"{float(f'{number:.2g}'):,.0f}" if number < 1e6 else f"{number:.1e}"


def _candidates(study: StudyObjects) -> Array:
    """Feasible experiments (k, v); none where none turn up."""
    given = study.specification
    source = CandidateSource(study.space, (given.seed, 0), given.sampling)
    try:
        return source.take(min(PLAUSIBLE.tried_experiments, given.candidates)).x
    except EmptyFeasibleSetError:
        return np.empty((0, study.space.size))


def _best_alone(study: StudyObjects, x: Array, experiments: int) -> Array:
    """Standard deviations (p,) that no plan of the experiments x can beat, each for itself.

    ``(M^-1)_jj >= 1 / M_jj``, and M_jj is at most m times the largest that an experiment has. Inf
    where there are none to compare with.
    """
    if not len(x):
        return np.full(study.model.p, np.inf)
    blocks = study.space.problem(x).blocks()
    largest = np.diagonal(blocks, axis1=1, axis2=2).max(axis=0)
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(experiments * largest))


def _of_tool(data: Data) -> str:
    """Where a tool point is."""
    far = f"{1e3 * data['length']:.3g} mm"
    return f"{data['key']}.position_mm: the tool point is {far} from the {data['place']}"


def _coarse_noise(data: Data) -> str:
    """Noise beside which the deflection is small."""
    by = "in [simulation] or [prior]" if data["known"] else "of usual size"
    return (
        f"{data['key']}: {1e3 * data['sigma']:.3g} mm is more than the load bends the robot: "
        f"{1e3 * data['bent']:.2g} mm at most with compliances {by}; check "
        f"{data['key'].split('.')[-1]} and load"
    )


def _poor_around(data: Data) -> str:
    """Errors around the test poses that are larger than in them."""
    one = data["poses"] == 1
    where = "the test pose" if one else f"the {data['poses']} test poses"
    return (
        f"errors are {data['mean'] / data['test_pose']:.2g} times as large around {where} as "
        f"there: {1e3 * data['mean']:.2g} mm within {np.rad2deg(data['within']):.3g} deg on "
        f"average, {1e3 * data['test_pose']:.2g} mm in {'it' if one else 'them'}; give more test "
        "poses where the robot shall work, or optimise another criterion such as A"
    )


def _useless_words(data: Data) -> str:
    """A compensation that promises nothing."""
    place = "in the test pose" if data["poses"] == 1 else f"in {data['poses']} test poses"
    usual = "" if data["known"] else ", as robots go"
    return (
        f"the expected error {place}, {1e3 * data['after']:.3g} mm, is larger than what the "
        f"load bends the robot there, {1e3 * data['before']:.2g} mm{usual}; check tools, loads and "
        "sigma_mm, or measure more"
    )


def _hardly_told(data: Data) -> str:
    """Parameters, each beside how uncertain it stays."""
    shares = data["of_itself"]
    how = [
        f"+-{_round(100 * share)} % of itself"
        if share is not None
        else f"+-{_round(ratio)} times the best"
        for share, ratio in zip(shares, data["of_best"], strict=True)
    ]
    each = [f"{name} ({one})" for name, one in zip(data["parameters"], how, strict=True)]
    return f"hardly told by this plan: {listed(each)}; {data['cure']}"


WORDING: Wording = {
    "long_links": lambda data: (
        f"robot: its links add up to {data['length']:.4g} m; lengths in a robot's file are in "
        "metres, are these in millimetres?"
    ),
    "short_tool": lambda data: f"{_of_tool(data)}; is it given in metres?",
    "long_tool": lambda data: (
        f"{_of_tool(data)}, and all links together are {1e3 * data['links']:.3g} mm long"
    ),
    "marker_as_tool": lambda data: (
        f"marker {data['name']}: its position_mm is that of the tool, but is counted from the tool "
        "point; expected [0, 0, 0] where the marker is at the tool point"
    ),
    "angle_unit": lambda data: (
        f"{data['key']}: all angles are within {data['largest']:.3g} deg of zero; are they in "
        "radians?"
    ),
    "upward_load": lambda data: (
        f"load.F_N: {data['force']:g} N along z pulls the tool upwards; a weight pulls along -z, "
        "is the sign meant?"
    ),
    "test_pose_touches": lambda data: (
        f"{data['key']}: in the cell, with the calibration tool, {data['pair'][0]} and "
        f"{data['pair'][1]} are {1e3 * (data['clearance'] + data['margin']):.0f} mm apart, less "
        f"than the margin of {1e3 * data['margin']:g} mm; is the scene that of the test pose?"
    ),
    "fine_noise": lambda data: (
        f"{data['key']}: {1e3 * data['sigma']:.3g} mm is finer than any instrument; is it given "
        "in metres?"
    ),
    "coarse_noise": _coarse_noise,
    "no_lever": lambda data: (
        "tool.position_mm, load: in no pose does the load move the tool point by way of "
        f"{listed(data['joints'])}; the tool point lies on the axis, or the load passes through it"
    ),
    "poor_around": _poor_around,
    "not_told": lambda data: (
        f"not told by this plan: {listed(data['parameters'])}; what the sheet does not tell, edtk "
        f"identify takes from a [prior] alone; {data['cure']}"
    ),
    "useless": _useless_words,
    "hardly_told": _hardly_told,
}
