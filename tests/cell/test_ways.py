"""Ways: free legs, by the home pose or by what the planner finds, the same with the same seed."""

from itertools import permutations

import numpy as np
import pytest
from crowded import crowded, free_poses

from edtk.cell.cell import Cell
from edtk.cell.legs import TOLERANCE, prove_legs
from edtk.cell.shapes import Body, Box, Capsule
from edtk.cell.ways import Roadmap, Speeds, _quickest
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

SPEEDS = Speeds(np.array([0.5, 1.0]))
LEFT, RIGHT = np.array([-0.7, 0.0]), np.array([0.7, 0.0])


def planar(*boxes):
    """An arm with two links of a metre in a plane, among boxes (x, y, half x, half y) [m]."""
    axis = np.array([0, 0, 1.0])
    joints = (
        Joint("q1", np.eye(4), axis, (-3.0, 3.0)),
        Joint("q2", transform([1, 0, 0]), axis, (-2.8, 2.8)),
    )
    robot = Robot("planar", joints, np.eye(4), transform([1, 0, 0]))
    link = Capsule(np.zeros(3), np.array([1.0, 0, 0]), 0.05)
    bodies = [Body("upper", 0, (link,)), Body("fore", 1, (link,))]
    bodies += [
        Body(f"box{i}", None, (Box(transform([x, y, 0]), np.array([a, b, 1])),))
        for i, (x, y, a, b) in enumerate(boxes)
    ]
    pairs = tuple((one.name, box.name) for one in bodies[:2] for box in bodies[2:])
    return Cell(robot, tuple(bodies), 0.01, pairs)


POST = planar((1.6, 0, 0.1, 0.1))
BETWEEN_BARS = planar((0, 0.4, 3, 0.1), (0, -0.4, 3, 0.1))


def test_a_way_about_a_post_is_free():
    """The arm bends to pass it; all of the way is far enough from it, and it is planned alike."""
    assert prove_legs(POST, LEFT, RIGHT).verdict.tolist() == ["touches"]
    ways = [
        Roadmap(POST, np.stack([LEFT, RIGHT]), SPEEDS, [POST.robot.limits], seed).way(0, 1)
        for seed in (0, 0, 1)
    ]
    for way in ways:
        assert way is not None
        assert len(way.via) > 0
        assert (way.q[0] == LEFT).all()
        assert (way.q[-1] == RIGHT).all()
        t = np.linspace(0, 1, 500)[:, None, None]
        q = way.q[:-1] + t * np.diff(way.q, axis=0)
        least = POST.clearance(q).least.min()
        assert least >= -TOLERANCE
        assert way.clearance - 0.1 * way.clearance - 1e-3 <= least <= way.clearance + 1e-9
        assert way.seconds == pytest.approx(SPEEDS.seconds(way.q[:-1], way.q[1:]).sum())
        assert POST.robot.limits[0].min() <= way.q.min()
    assert (ways[0].q == ways[1].q).all()
    assert ways[0].q.shape != ways[2].q.shape or (ways[0].q != ways[2].q).any()


def test_a_home_pose_serves_where_it_helps():
    """No planner is asked where two free legs meet at home."""
    home = np.array([-1.2, 2.7])
    q = np.stack([LEFT, RIGHT, home])
    way = Roadmap(POST, q, SPEEDS, [POST.robot.limits]).way(0, 1)
    assert way is not None
    assert way.via.tolist() == [home.tolist()]
    back = Roadmap(POST, q, SPEEDS, [POST.robot.limits]).way(1, 0)
    assert back is not None
    assert back.q[::-1].tolist() == way.q.tolist()


def test_what_is_shut_in_is_not_reached():
    """Between two bars the arm cannot turn about; that is found, and not asked twice."""
    q = np.array([[0.0, 0.0], [np.pi - 0.2, 0.2], [0.05, -0.05], [0.0, 1.5]])
    roadmap = Roadmap(BETWEEN_BARS, q, SPEEDS, [BETWEEN_BARS.robot.limits])
    assert roadmap.way(0, 1) is None
    assert roadmap.way(0, 2) is not None
    known = len(roadmap.q)
    assert roadmap.way(2, 1) is None
    assert roadmap.way(0, 3) is None  # the last pose touches a bar itself
    assert len(roadmap.q) == known


def test_the_quickest_way_on_a_grid():
    """Dijkstra's way is the best of all, and takes the fewest legs among equals."""
    rng = np.random.default_rng(0)
    times = rng.uniform(1, 9, (6, 6))
    times = np.triu(times, 1) + np.triu(times, 1).T

    for b in range(1, 6):
        best = min(
            sum(times[i, j] for i, j in zip((0, *mid), (*mid, b), strict=True))
            for k in range(5)
            for mid in permutations([i for i in range(1, 6) if i != b], k)
        )
        places = _quickest(times, 0, b)
        assert times[places[:-1], places[1:]].sum() == pytest.approx(best)
    line = np.abs(np.arange(4.0)[:, None] - np.arange(4.0))
    assert _quickest(line, 0, 3) == [0, 3]
    cut = np.where(line > 0, np.inf, 0.0)
    assert _quickest(cut, 0, 3) is None


def test_without_a_cell_every_leg_is_free():
    """There is nothing to touch, and the direct leg is the quickest."""
    way = Roadmap(None, np.stack([LEFT, RIGHT]), SPEEDS, [POST.robot.limits]).way(0, 1)
    assert way is not None
    assert len(way.via) == 0
    assert way.seconds == pytest.approx(2.8)


def test_all_poses_of_a_crowded_cell_are_reached():
    """An arm of six joints goes from each of some poses to the next one."""
    cell = crowded(load_robot("kuka_kr270"))
    q = free_poses(cell, 8)
    roadmap = Roadmap(cell, q, Speeds(np.full(6, 0.5)), [cell.robot.limits])
    ways = [roadmap.way(i, i + 1) for i in range(7)]
    assert all(way is not None and way.clearance > -TOLERANCE for way in ways)
    assert any(len(way.via) for way in ways if way is not None)
