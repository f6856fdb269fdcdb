"""Inverse kinematics of chains of any kind, on all branches."""

import numpy as np
import pytest

from edtk.robots.inverse import Posture, is_nearest, solutions, solve
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_from_dict

KR270 = load_robot("kuka_kr270").with_tool(
    np.array([[0, 0, 1, 0.2], [0, 1, 0, 0.1], [-1, 0, 0, 0.1], [0, 0, 0, 1]])
)


@pytest.mark.slow
def test_all_branches_of_an_arm_are_found() -> None:
    """Each of 20 poses is found again, with its mirror images, all to 1e-9 and within limits."""
    rng = np.random.default_rng(0)
    for q in rng.uniform(*KR270.limits, (20, 6)):
        goal = KR270.forward(q)
        found = solutions(KR270, goal)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-6
        assert np.abs(KR270.forward(found.q) - goal).max() < 3e-9
        assert KR270.bounds.excess(found.q).max() < 1e-8
        flipped = q * [1, 1, 1, 1, -1, 1] + np.array([0, 0, 0, np.pi, 0, np.pi])
        apart = np.mod(found.q - flipped + np.pi, 2 * np.pi) - np.pi
        assert np.abs(apart).max(axis=1).min() < 1e-6


@pytest.mark.slow
def test_the_nearest_is_that_of_the_least_motion() -> None:
    """A start near a pose gives that pose, also where the wrist is stretched."""
    for degrees in (
        [20, -60, 80, 10, 40, 100],
        [0, -90, 90, 0, 0, 0],
        [10, -60, 60, 200, 30, -300],
    ):
        q = np.deg2rad(degrees).astype(float)
        near = q + 0.01
        nearest = solutions(KR270, KR270.forward(q), near).nearest(near)
        assert nearest is not None
        assert np.abs(nearest - near).max() < 0.03
        assert np.abs(KR270.forward(nearest) - KR270.forward(q)).max() < 3e-9


@pytest.mark.slow
def test_what_is_called_the_nearest_is_so() -> None:
    """Along a dense path, also through a stretched wrist, where it is left to a search."""
    said = []
    for fifth in np.deg2rad([-0.4, 0.0, 0.4, 40.0, 60.0, 80.0]):
        start = np.array([0.2, -1.0, 1.2, 0.4, fifth, 0.3])
        goal = KR270.forward(start + 5e-4 * np.array([1, -1, 1, 1, 1, -1]))
        q, reached = solve(KR270, goal[None], start[None])
        said.append(bool(reached[0]) and is_nearest(KR270, q[0], start))
        nearest = solutions(KR270, goal, start).nearest(start)
        assert nearest is not None
        if said[-1]:
            assert np.abs(q[0] - nearest).max() < 1e-8
    assert said == [False, False, False, True, True, True]


@pytest.mark.slow
def test_what_cannot_be_reached_has_no_solution() -> None:
    """Too far away, or beyond the limits, which is told."""
    far = KR270.forward(np.zeros(6))
    far[:3, 3] *= 5
    assert (len(solutions(KR270, far).q), solutions(KR270, far).beyond) == (0, False)
    narrow = KR270.with_limits({"q2": (-0.1, 0.0)})
    found = solutions(narrow, KR270.forward(np.deg2rad([0, -90.0, 90, 0, 40, 0])))
    assert (len(found.q), found.beyond) == (0, True)


@pytest.mark.parametrize("seed", range(3))
def test_gantries_and_seven_axes_are_solved(seed: int) -> None:
    """Sliding joints, and arms with a joint too many, reach the places of their own poses."""
    rng = np.random.default_rng(seed)
    axes = "xyz" + "zyx" if seed == 0 else "zyzyzyz"
    kinds = ["prismatic"] * 3 + ["revolute"] * 3 if seed == 0 else ["revolute"] * 7
    joints = []
    for i, (axis, kind) in enumerate(zip(axes, kinds, strict=True), 1):
        limits = {"limits_m": [-0.9, 0.9]} if kind == "prismatic" else {"limits_deg": [-170, 170]}
        vector = [float(axis == one) for one in "xyz"]
        origin = [0.1 * (i % 2), 0, 0.3 * (i > 1)]
        joints.append({"name": f"q{i}", "kind": kind, "origin_m": origin, "axis": vector} | limits)
    robot: Robot = robot_from_dict({"name": "a chain", "source": "tests", "joints": joints})
    q = rng.uniform(*(0.8 * robot.limits), (5, robot.n))
    near, reached = solve(robot, robot.forward(q), q + 0.05)
    assert reached.all()
    assert np.abs(robot.forward(near) - robot.forward(q)).max() < 3e-9
    assert len(solutions(robot, robot.forward(q[0])).q) > 0


def test_a_posture_tells_branches_apart() -> None:
    """Two solutions of one place never have all sides in common, and turns as well."""
    found = solutions(KR270, KR270.forward(np.deg2rad([20, -60.0, 80, 10, 40, 100]))).q
    sides = set()
    for q in found:
        posture = Posture.of(KR270, q)
        assert posture is not None
        assert posture.shown == pytest.approx(q)
        sides.add((posture.ahead > 0, posture.elbow > 0, *(x < 0 for x in q)))
    assert len(sides) == len(found)
