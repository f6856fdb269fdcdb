"""Sensitivities and slacks of robots as polynomials: those of the design space, at any pose."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import criteria
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.boxes import Boxes, Grid, Leaves
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.prove_continuum import enclosed as with_criterion
from edtk.design.enclosure.robot_polynomials import RobotPolynomials
from edtk.design.enclosure.stage import Stage
from edtk.design.enclosure.tracked import TrackedObjective
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import Friction
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.noise import Tracker, VisitNoise
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.radius import Radius
from edtk.robots.frames import BodyPoint
from edtk.robots.joint import Coupling
from edtk.robots.load_robot import load_robot
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.robot import Robot
from edtk.robots.weights import DeadWeights
from edtk.robots.workspace import Workspace
from edtk.study.study import load_study
from edtk.system.typing import Array
from tests.support.chains import mixed_chain
from tests.support.designs import KR270, LOADED

POSES = 60
EXACT = 1e-12  # of the largest sensitivity


def space_of(robot: Robot, **changes: object) -> DesignSpace:
    """A design space of a chain, all of whose joints are free and unknown."""
    given: dict[str, object] = {
        "model": ElastostaticModel(robot),
        "workspace": Workspace(robot, (Height(-0.4), Radius(0.3))),
        "sigma": np.array([3e-5, 4e-5, 5e-5]),
        "load": FixedLoad(np.array([30.0, -20.0, 50.0, 4.0, -7.0, 9.0])),
        "free": list(range(robot.n)),
        "fixed": np.zeros(robot.n),
    }
    return DesignSpace(**(given | changes))  # type: ignore[arg-type]


def whole_gears() -> Robot:
    """A chain in which drives turn other joints by half and whole turns, forwards and backwards."""
    robot = replace(mixed_chain(4), joints=tuple(mixed_chain(4).joints[j] for j in (0, 2, 3, 1)))
    limited = Coupling("q4", "q3", -1.0, limits=(-1.0, 0.5))
    return replace(robot, couplings=(Coupling("q3", "q1", 0.5), limited))


def geared(ratio: float) -> DesignSpace:
    """A chain whose first drive turns its third joint by a ratio."""
    robot = mixed_chain(7)
    return space_of(replace(robot, couplings=(Coupling("q3", "q1", ratio),)))


class Odd(FixedLoad):
    """A load of somebody else's."""

    def __init__(self) -> None:
        super().__init__(np.zeros(6))


def with_weights() -> DesignSpace:
    """A chain that bends under weights of its own, marked at two bodies and loaded at a third."""
    robot = mixed_chain(4)
    hung = DeadWeights((3.0, 5.0), (BodyPoint(np.array([0.1, 0.0, 0.2]), 1), BodyPoint()), 4)
    sensors = (Marker(BodyPoint(np.array([0.1, 0.2, 0.3]), 2)), PoseMarker())
    load_point = BodyPoint(np.array([0.0, -0.1, 0.05]), 2)
    model = ElastostaticModel(robot, sensors=sensors, load_point=load_point, weights=hung)
    return space_of(robot, model=model, sigma=np.linspace(1e-5, 4e-5, 9))


def spaces() -> dict[str, DesignSpace]:
    """Chains, loads and constraints of every kind."""
    excluded = Excluded(np.array([[0.0, -1.0, 1.0, 0.0, 0.5, 0.0]]), 0.6)
    workspace = replace(KR270.workspace, constraints=(*KR270.workspace.constraints, excluded))
    palletiser = load_study("studies/palletiser.toml").space
    small = {name: space for name, space in LOADED.items() if name != "kr270 free"}
    return small | {
        "kr270 excluded": replace(KR270, workspace=workspace),
        "palletiser": palletiser,
        "gears": space_of(whole_gears()),
        "weights": with_weights(),
    }


SPACES = spaces()


def multiplier(space: DesignSpace, x: Array, seed: int = 5) -> Array:
    """A multiplier of full rank whose terms are alike in size at experiments x."""
    A = space.at(x).regressor
    sizes = np.sqrt(np.einsum("mri,mri->i", A, A) / len(x))
    R = np.random.default_rng(seed).normal(size=(space.p, space.p)) / np.maximum(sizes, 1e-300)
    return np.asarray(R.T @ R)


def drawn(space: DesignSpace, m: int = POSES) -> Array:
    """Experiments (m, v) anywhere in the box."""
    return space.draw(np.random.default_rng(7).random((m, len(space.drawn))))


@pytest.mark.parametrize("name", SPACES)
def test_polynomials_are_those_of_the_design_space(name: str) -> None:
    """At any place the numerator is the sensitivity, to twelve digits and within its own error, and
    slacks have the signs of the constraints, and of limits of joints whose angles are summed.
    """
    space = SPACES[name]
    Z = multiplier(space, drawn(space))
    robot = RobotPolynomials(space)
    enclosed = robot.enclosed(Z)
    rng = np.random.default_rng(2)
    low, high = np.array([(axis.low, axis.high) for axis in enclosed.axes]).T
    places = rng.uniform(low, high, size=(POSES, len(low)))
    for k, objective in enumerate(enclosed.objectives):
        x = robot.folded(enclosed.experiments(places, k))
        found = space.at(x)
        expected = np.einsum("ij,mri,mrj->m", Z, found.regressor, found.regressor)
        off = np.abs(objective(places) - expected).max()
        assert off < EXACT * expected.max()
        assert off < objective.numerator.error < 1e-5 * expected.max()
        within = ((x >= space.limits[0]) & (x <= space.limits[1])).all(axis=1)
        beside = enclosed.slacks[len(enclosed.slacks) - len(robot.limits) :]
        assert (within == np.all([slack(places) >= 0 for slack in beside], axis=0)).all()
    assert enclosed.left_out == ()
    allowed = np.array([slack(places) >= 0 for slack in enclosed.slacks]).all(axis=0)
    feasible = within & (found.slack >= 0).all(axis=-1)
    if name in ("kr270 excluded", "gears"):  # of these the slacks are no more than necessary
        assert (allowed >= feasible).all()
        assert 0 < feasible.sum() >= allowed.sum() / 2
    else:
        assert (allowed == feasible).all()


@pytest.mark.parametrize("name", ["kr270 fixed", "odd listed", "gears", "palletiser"])
def test_half_a_box_stands_for_all_of_it(name: str) -> None:
    """Every pose has one in the part of the box that is left which tells as much, for each load,
    and is feasible if it is.
    """
    space = SPACES[name]
    Z = multiplier(space, drawn(space))
    robot = RobotPolynomials(space)
    enclosed = robot.enclosed(Z)
    rng = np.random.default_rng(2)
    low, high = np.array([(axis.low, axis.high) for axis in robot.own_axes]).T
    places = rng.uniform(low, high, size=(POSES, len(low)))
    images = moved_inside(places, robot)
    own_low, own_high = np.array([(axis.low, axis.high) for axis in enclosed.axes]).T
    assert ((images >= own_low - 1e-12) & (images <= own_high + 1e-12)).all()
    for before, after in zip(robot.in_kept(Z), enclosed.objectives, strict=True):
        size = np.abs(before(places)).max()
        assert np.abs(before(places) - after(images)).max() < EXACT * size
    for slack in enclosed.slacks:
        assert np.abs(slack(places) - slack(images)).max() < EXACT * slack.size


def moved_inside(places: Array, robot: RobotPolynomials) -> Array:
    """Places moved by each motion that cut off the part in which they are."""
    found = places.copy()
    axes = list(robot.own_axes)
    for motion, after in zip(robot.halving.motions, robot.halving.steps, strict=True):
        j = next(i for i in range(len(axes)) if after[i] != axes[i])
        turned = np.mod(found[:, j] - after[j].low, 2 * np.pi) + after[j].low
        out = turned > after[j].high
        signs = np.where(motion.mirrors, -1.0, 1.0)
        found[out] = found[out] * signs + np.pi * np.array(motion.turns)
        axes = list(after)
        for i, axis in enumerate(axes):
            if axis.kind == "angle":
                found[:, i] = np.mod(found[:, i] - axis.low + 1e-13, 2 * np.pi) + axis.low - 1e-13
    return found


def test_degrees_follow_from_the_chain() -> None:
    """Of the KR 270 under a vertical force they are those that turning all at once, and the angles
    of links behind parallel axes, leave: three for both, tilt asks the second alone, whose joint's
    limits are a slack of both, and joint 1 counts for nothing.
    """
    space = replace(KR270, free=list(range(6)))
    enclosed = RobotPolynomials(space).enclosed(np.diag([1.0, 2.0, 3.0, 4.0, 5.0]))
    assert enclosed.objectives[0].numerator.degrees == (3, 3, 4, 4, 4)
    assert [slack.degrees for slack in enclosed.slacks] == [
        (1, 1, 1, 1, 1),
        (2, 2, 2, 2, 2),
        (0, 1, 1, 1, 1),
        (0, 1, 1, 1, 1),
        (1, 1, 0, 0, 0),
    ]
    widths = np.rad2deg([axis.high - axis.low for axis in enclosed.axes])
    assert np.allclose(widths, [146, 360, 90, 250, 360])  # a mirror and the wrist's flip, both


def test_a_distance_from_excluded_poses_holds_no_more_than_it_says() -> None:
    """Its slack is not negative wherever the distance is kept, and negative near the pose."""
    space = SPACES["kr270 excluded"]
    robot = RobotPolynomials(space)
    enclosed = robot.enclosed(np.eye(5))
    slack = enclosed.slacks[-1 - len(robot.limits)]
    low, high = np.array([(axis.low, axis.high) for axis in enclosed.axes]).T
    rng = np.random.default_rng(2)
    near = np.array([-1.0, 0.0, 0.0, 0.5, 0.0]) + rng.normal(size=(POSES, 5)) * 0.3
    places = np.concatenate([rng.uniform(low, high, size=(POSES, 5)), near])
    kept = space.at(enclosed.experiments(places)).slack[:, -1] >= 0
    assert (slack(places[kept]) >= 0).all()
    assert (slack(places[~kept]) < 0).mean() > 0.9


BEAMS = {
    "alike": Tracker(np.array([5.0, 1.0, 1.0]), (1e-5, 6e-6), (1e-5, 6e-6)),
    "less along": Tracker(np.array([5.0, 1.0, 1.0]), (2e-6, 1e-6), (1e-5, 6e-6)),
    "less across": Tracker(np.array([5.0, 1.0, 1.0]), (1e-5, 6e-6), (4e-6, 6e-6)),
    "within reach": Tracker(np.array([1.5, 0.0, 1.5]), (2e-6, 1e-6), (1e-5, 6e-6)),
}


def seen_by(tracker: Tracker, **changes: Any) -> DesignSpace:
    """The robot whose marker a tracker sees."""
    white = np.full(3, 1e-5)
    noise = VisitNoise(tracker, ((0, 0),), np.zeros(6), white=white, discrepancy=np.zeros(3))
    return replace(KR270, noise=replace(noise, **changes))


def told_and_enclosed(space: DesignSpace) -> tuple[Array, Array, RobotPolynomials]:
    """Sensitivities of poses, and what their enclosure says."""
    x = drawn(space)
    Z = multiplier(space, x)
    robot = RobotPolynomials(space)
    enclosed = robot.enclosed(Z)
    (objective,) = enclosed.objectives
    A = space.at(x).regressor
    t = (x - enclosed.base[0]) @ np.linalg.pinv(enclosed.matrix).T
    told = np.einsum("ij,mri,mrj->m", Z, A, A)
    return told, objective(robot.halving.inside(t)), robot


@pytest.mark.parametrize("beam", BEAMS)
def test_a_tracker_counts_as_it_errs(beam: str) -> None:
    """Where errors along the beam are the smaller ones, the sensitivity is that of the poses."""
    told, found, robot = told_and_enclosed(seen_by(BEAMS[beam]))
    assert (found >= told * (1 - 1e-10)).all()
    assert found == pytest.approx(told, rel=0.6 if beam == "less across" else 1e-10)
    assert robot.beam is not None
    assert (robot.beam.inline is None) == (beam in ("alike", "less across"))


@pytest.mark.slow
def test_errors_may_grow_from_nothing() -> None:
    """Errors that vanish at a tracker out of reach: a wide box must not count it as that near."""
    tracker = Tracker(np.array([5.0, 1.0, 1.0]), (0.0, 6e-6), (1e-5, 6e-6))
    space = seen_by(tracker, white=np.zeros(3))
    told, found, robot = told_and_enclosed(space)
    assert found == pytest.approx(told, rel=1e-10)
    (objective,) = robot.enclosed(multiplier(space, drawn(space))).objectives
    assert isinstance(objective, TrackedObjective)
    points = space.model.points_of(space.model.frames(drawn(space)[:, : len(space.fixed)]))
    nearest = np.square(points[0] - tracker.position[:, None]).sum(axis=0).min()
    assert 0 < objective.nearest <= nearest
    grid = Grid(objective.numerator.axes)
    assert told.max() <= objective.most(grid) < np.inf
    assert objective.scale(grid)[0] > 0
    (*found, error) = objective.weights(1.0, np.zeros((2, 1)), np.array([50.0]))
    assert np.isfinite(error).all()
    assert all(np.isfinite(one).all() for one in found)


def test_a_looser_noise_counts_more() -> None:
    """Joints that scatter add to a tracker's errors, which alone are enclosed."""
    space = seen_by(BEAMS["alike"], repeatability=np.full(6, 1e-6))
    told, found, robot = told_and_enclosed(space)
    assert (found >= told).all()
    assert (found / told).max() < 1.3
    assert not robot.is_exact


@pytest.mark.slow
@pytest.mark.parametrize("beam", BEAMS)
def test_boxes_bound_what_a_tracker_tells(beam: str) -> None:
    """No place of a box has more than its coefficients say, whose excess falls by its square."""
    space = seen_by(BEAMS[beam])
    enclosed = RobotPolynomials(space).enclosed(multiplier(space, drawn(space)))
    (objective,) = enclosed.objectives
    assert isinstance(objective, TrackedObjective)
    grid = Grid(enclosed.axes)
    rng = np.random.default_rng(6)
    corners = np.array(list(product((-1.0, 1.0), repeat=len(enclosed.axes))))
    excess = []
    for depth in (1, 4, 6):
        places = np.stack([rng.integers(0, n << depth, size=40) for n in grid.parts], axis=1)
        boxes = Boxes(np.full_like(places, depth), places)
        inside = np.concatenate([corners, rng.uniform(-1, 1, (100, places.shape[1]))])
        t = grid.middles(boxes)[:, None] + grid.halves(boxes)[:, None] * inside
        t = t.reshape(-1, t.shape[2])
        values = objective(t)
        level = float(np.median(values))
        stage = Stage(enclosed, objective, grid, level)
        leaves = Leaves.unknown(boxes, np.full(40, np.inf), len(enclosed.slacks))
        above = stage.above(stage.opened(leaves))
        top = above.values.reshape(40, -1).max(axis=1) + above.error
        own = (values - level) * objective.growth.aside(objective.squared(t))
        largest = own.reshape(40, -1).max(axis=1)
        assert (top >= largest).all()
        assert (stage.bound(top) >= values.reshape(40, -1).max(axis=1)).all()
        assert objective.most(grid) >= values.max()
        excess.append(float(np.median(top - largest)) / level)
    assert excess[2] < excess[1] / 6 < excess[0] / 36


def test_parts_are_not_compared_where_each_is_only_bounded() -> None:
    """A criterion of degree zero has no bound where errors depend on the pose, and says so; others
    count a prior beside the quotient.
    """
    tracker = Tracker(np.array([5.0, 1.0, 1.0]), (1e-5, 6e-6), (1e-5, 6e-6))
    white = np.full(3, 1e-5)
    noise = VisitNoise(tracker, ((0, 0),), np.zeros(6), white=white, discrepancy=np.zeros(3))
    robot = RobotPolynomials(replace(KR270, noise=noise, prior=np.eye(5)))
    Z = multiplier(robot.space, drawn(robot.space))
    with pytest.raises(NotEnclosedError, match="no more than a bound of these"):
        with_criterion(robot, criteria.create("O2"), Z)
    plain, lifted = robot.enclosed(Z), with_criterion(robot, criteria.create("D"), Z)
    places = np.array([[axis.middle for axis in plain.axes]])
    before, after = plain.objectives[0](places), lifted.objectives[0](places)
    assert after == pytest.approx(before + np.trace(Z), rel=1e-12)


def test_where_errors_grow_with_an_idle_joint_it_is_a_variable() -> None:
    """A tracker sees the arm turn about its base, which changes nothing else."""
    space = replace(seen_by(BEAMS["alike"]), free=list(range(6)))
    assert RobotPolynomials(space).kept == [0, 1, 2, 3, 4, 5]
    assert RobotPolynomials(replace(space, noise=None)).kept == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: with_pull(), "a compensator's load"),
        (lambda: with_friction(), "what friction holds"),
        (lambda: geared(0.123), "q1 turns a joint by the ratio 0.123; expected one of whole"),
        (lambda: geared(11.0), "coefficients; expected at most 6e.06"),
        (lambda: replace(KR270, load=Odd()), "loads of the kind Odd: no polynomial is known"),
    ],
)
def test_what_is_no_polynomial_says_why(make: object, message: str) -> None:
    """A space without an enclosure ends in one line."""
    with pytest.raises(NotEnclosedError, match=message):
        RobotPolynomials(make()).enclosed(np.eye(7))  # type: ignore[operator]


def with_friction() -> DesignSpace:
    """A robot whose friction holds a part of its loads."""
    p = KR270.model.p
    friction = Friction(np.full(p, 1e-6), np.full(p, 1e3), 0.1)
    return replace(KR270, model=replace(KR270.model, friction=friction))


def with_pull() -> DesignSpace:
    """A robot whose compensator gives way with its joint."""
    robot = load_robot("kuka_kr270_compensator")
    model = replace(KR270.model, robot=robot, gives=robot.giving_way(np.full(6, 1e-6)))
    return replace(KR270, model=model)
