"""Legs: none is called free that touches, bounds of the motion hold, and near misses are proved."""

import numpy as np
import pytest
from chains import coupled_chain, mixed_chain, tied_chain
from crowded import crowded, free_poses

from edtk.cell.cell import Cell
from edtk.cell.legs import ABOUT, SHARE, TOLERANCE, _Motion, prove_legs
from edtk.cell.shapes import Body, Box, Capsule
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

ROBOTS = {
    "kr270": lambda: load_robot("kuka_kr270"),
    "sliding": mixed_chain,
    "tied": tied_chain,
    "coupled": coupled_chain,
}
CELLS = {name: (robot, False) for name, robot in ROBOTS.items()}
CELLS["hanging"] = (ROBOTS["kr270"], True)
BALL = Capsule(np.zeros(3), np.zeros(3), 0.1)


def slider(*shapes, margin=0.0):
    """A ball of 0.1 m that a joint slides along x, among shapes that stand still."""
    slide = Joint("x", np.eye(4), np.array([1.0, 0, 0]), (-5.0, 5.0), "prismatic")
    robot = Robot("slider", (slide,), np.eye(4), np.eye(4))
    bodies = [Body("ball", 0, (BALL,)), Body("wall", None, shapes)]
    return Cell(robot, tuple(bodies), margin, (("ball", "wall"),))


@pytest.mark.parametrize("name", CELLS)
def test_no_leg_is_called_free_that_touches(name):
    """Along free legs no clearance is below what is told, and a leg that touches says where."""
    robot, weights = CELLS[name]
    cell = crowded(robot(), weights=weights, apart=2 if weights else 3)
    q = free_poses(cell, 24)
    a, b = q[:12], q[12:]
    b[::2] = a[::2] + 0.2 * (b - a)[::2]  # short ones are often free
    legs = prove_legs(cell, a, b)
    t = np.linspace(0, 1, 400)[:, None]
    least = cell.clearance(a[:, None] + t * (b - a)[:, None]).least.min(axis=1)
    assert legs.free.any()
    assert (legs.verdict == "touches").any()
    short_of = np.maximum(ABOUT, SHARE * legs.clearance)
    assert (least >= np.maximum(legs.clearance - short_of, -TOLERANCE))[legs.free].all()
    there = cell.clearance(a + legs.t[:, None] * (b - a))
    assert there.least == pytest.approx(legs.clearance, abs=1e-9)
    assert there.pair.tolist() == legs.pair.tolist()
    assert (legs.clearance < -TOLERANCE).tolist() == (legs.verdict == "touches").tolist()


@pytest.mark.parametrize("name", CELLS)
def test_velocities_are_differences_and_accelerations_bounded(name):
    """Along a leg the ends of capsules move as fast as differences say, and turn no faster."""
    robot, weights = CELLS[name]
    cell = crowded(robot(), weights=weights, apart=1)
    motion = _Motion.of(cell)
    rng = np.random.default_rng(3)
    lower, upper = cell.robot.limits
    a, b = lower + (upper - lower) * rng.random((2, 5, cell.robot.n))
    ties = cell.robot.ties
    rates = (b - a) if ties is None else (b - a) @ ties.matrix.T

    def ends(t):
        """Ends of each view (2, 3, w, m) in the frame of the joint from which it is seen."""
        frames = cell.frames(a + t * (b - a))
        at = np.stack(cell.solids.placed(frames))[:, :, motion.capsule]
        for w, joint in enumerate(motion.seen_from):
            if joint >= 0:
                rotation, origin = frames.bodies[int(joint)]
                at[:, :, w] = np.einsum("kcm,ecm->ekm", rotation, at[:, :, w] - origin)
        return at

    h = 1e-4
    frames = cell.frames(a + 0.5 * (b - a))
    here = np.stack(cell.solids.placed(frames))
    velocity = motion.velocities(frames, here, rates.T)
    differences = (ends(0.5 + h) - ends(0.5 - h)) / (2 * h)
    seen = motion.capsule >= 0
    speed = np.linalg.norm(velocity, axis=1)
    expected = np.where(seen[:, None], np.linalg.norm(differences, axis=1), 0.0)
    assert speed == pytest.approx(expected, rel=1e-4, abs=1e-5)
    bends = motion.bends(rates)
    for t in (0.1, 0.5, 0.9):
        second = (ends(t + h) - 2 * ends(t) + ends(t - h)) / h**2
        assert (np.linalg.norm(second, axis=1).max(axis=0) <= bends + 1e-6)[seen].all()


def test_a_plate_between_two_free_poses_is_found():
    """It is thinner than any step, and the ball is far from it at both ends."""
    cell = slider(Box(transform([0.123, 0, 0]), np.array([1e-4, 1, 1])))
    legs = prove_legs(cell, np.array([[-3.0]]), np.array([[3.0]]))
    assert legs.verdict.tolist() == ["touches"]
    assert abs(-3 + 6 * legs.t[0] - 0.123) < 0.1 + 1e-4


@pytest.mark.parametrize("gap", [1e-4, 1e-2, 0.5])
def test_a_near_miss_is_proved(gap):
    """The ball passes an edge; its clearance is known within what is promised."""
    cell = slider(Box(transform([0.2, 1.1 + gap, 0]), np.array([0.3, 1, 1])))
    legs = prove_legs(cell, np.array([[-3.0]]), np.array([[3.1]]))
    assert legs.free.all()
    assert gap - 1e-9 <= legs.clearance[0] <= gap + max(ABOUT, SHARE * gap)


def test_a_pose_at_the_margin_is_left_by_a_free_leg():
    """A search stops at the margin, and rounding goes beyond; without one, nothing may overlap."""
    wall = Box(transform([1, 0, 0]), np.array([0.5, 1, 1]))
    for margin, verdict in ((0.02, "free"), (0.0, "touches")):
        at = np.array([[0.4 - margin + 1e-5]])
        legs = prove_legs(slider(wall, margin=margin), at, np.array([[-1.0]]))
        assert legs.verdict.tolist() == [verdict]
        assert legs.clearance[0] == pytest.approx(-1e-5, abs=1e-9)


@pytest.mark.parametrize(("gap", "verdict"), [(1e-4, "free"), (1e-12, "not proved")])
def test_what_hardly_misses_is_proved_down_to_the_resolution(gap, verdict):
    """A ball at the end of an arm swings by a wall, as near as nothing is told from touching."""
    turning = Joint("q", np.eye(4), np.array([0, 0, 1.0]), (-2.0, 2.0))
    robot = Robot("arm", (turning,), np.eye(4), np.eye(4))
    ball = Body("ball", 0, (BALL.moved(transform([1, 0, 1])),))
    wall = Body("wall", None, (Box(transform([1.6 + gap, 0, 1]), np.array([0.5, 1, 1])),))
    cell = Cell(robot, (ball, wall), 0.0, (("ball", "wall"),))
    legs = prove_legs(cell, np.array([[-1.0]]), np.array([[1.3]]))
    assert legs.verdict.tolist() == [verdict]
    assert legs.clearance[0] >= gap - 1e-9


def test_many_legs_are_proved_as_few_are():
    """They are looked at a part at a time."""
    cell = slider(Box(transform([2, 0, 0]), np.array([0.5, 1, 1])))
    count = 1200
    legs = prove_legs(cell, np.full((count, 1), -1.0), np.linspace(0, 3, count)[:, None])
    touching = np.linspace(0, 3, count) > 1.4
    assert (legs.free == ~touching).all()


def test_nothing_to_look_at_is_free():
    """A cell without pairs has no distances."""
    cell = slider(Box(transform([1, 0, 0]), np.ones(3)))
    legs = prove_legs(Cell(cell.robot, cell.bodies, 0.0, ()), np.zeros((2, 1)), np.ones((2, 1)))
    assert legs.free.all()
    assert np.isinf(legs.clearance).all()
