"""Signs, zeros and coupling of a controller from measured positions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.fit.controller.find_controller import FoundController, find_controller
from edtk.fit.controller.fits import Fits, Positions, descend, jacobian, moved, place_frames
from edtk.fit.controller.ways_to_count import same_arms, ways_to_count
from edtk.robots.joint import TiedJoint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_from_dict, robot_to_dict
from edtk.system.errors import UserError
from edtk.system.parsing import json_text
from edtk.system.typing import Array

MARKERS = np.array([[0.15, 0.05, 0.2], [-0.1, 0.12, 0.15], [0.02, -0.14, 0.18]])


def arm(*joints: tuple[list[float], list[float]], **table: Any) -> Robot:
    """A robot of turning joints (origin, axis), and how its controller counts."""
    listed = [
        {"name": f"q{i + 1}", "origin_m": origin, "axis": axis, "limits_deg": [-170, 170]}
        for i, (origin, axis) in enumerate(joints)
    ]
    content = {"name": "arm", "source": "made up", "joints": listed}
    return robot_from_dict(content | ({"controller": table} if table else {}))


ELBOW = (
    ([0, 0, 0.4], [0, 0, 1]),
    ([0.1, 0, 0], [0, 1, 0]),
    ([0, 0, 0.7], [0, 1, 0]),
    ([0.5, 0, 0.1], [1, 0, 0]),
)
SHORT = ELBOW[:3]


def measured(
    robot: Robot, poses: int, markers: int = 1, noise: float = 5e-5, seed: int = 0
) -> Positions:
    """Positions in the frame of a tracker that stands somewhere, of poses of the controller."""
    rng = np.random.default_rng(seed)
    lower, upper = robot.limits
    q = lower + (upper - lower) * rng.uniform(0.15, 0.85, (poses, robot.n))
    T = robot.with_tool(np.eye(4)).forward(q)
    points = (T[:, None, :3, :3] @ MARKERS[:markers, :, None])[..., 0] + T[:, None, :3, 3]
    turn = Rotation.from_rotvec([0.02, -0.03, 1.0]).as_matrix()
    seen = points @ turn.T + [1.0, -2.0, 0.5] + noise * rng.standard_normal(points.shape)
    names = [f"m{k}" for k in range(markers)] * poses
    shown = np.repeat(robot.shown(q), markers, axis=0)
    return Positions.of_rows(shown, seen.reshape(-1, 3), names)


def table_of(robot: Robot) -> dict[str, Any]:
    """The robot's table as a study has it."""
    return dict(robot_to_dict(robot).get("controller", {}))


def assert_found(found: FoundController, robot: Robot) -> None:
    """The table is the robot's, but for zeros that are not told."""
    for key, value in found.best.table().items():
        if key == "zero_deg":
            told = {n: z for n, z in table_of(robot)[key].items() if n not in found.untold}
            assert value == pytest.approx(told, abs=0.1)
        elif key == "sign":
            assert value == table_of(robot)[key]


@pytest.mark.slow
def test_signs_zeros_and_coupling_are_found() -> None:
    """Six poses of one marker tell them; first and last zero go with base and tool."""
    table = {
        "sign": {"q2": -1, "q3": -1},
        "zero_deg": {"q1": 20, "q2": 88.5, "q3": -31.25},
        "follows": {"q3": {"joint": "q2", "factor": -1}},
    }
    robot = arm(*ELBOW, **table)
    found = find_controller(robot, measured(robot, 8))
    assert found.clear
    assert found.best.rms < 1e-4
    assert_found(found, robot)
    follows = found.best.way.follows
    assert follows is not None
    assert (follows.joint, follows.leader, follows.factor) == (2, 1, -1)
    assert set(found.untold) == {"q1", "q4"}
    assert "base" in found.untold["q1"]
    assert "tool" in found.untold["q4"]
    assert found.second is not None
    assert found.second.rms > 20 * found.best.rms
    assert (found.coordinates, found.unknowns) == (24, 11)


def with_ties(robot: Robot, *ties: tuple[str, str, float, float]) -> Robot:
    """The same chain, of which some joints follow others by a factor and an offset."""
    followers = []
    for name, master, factor, offset in ties:
        place = robot.joint_names.index(name)
        one = robot.joints[place]
        followers.append(
            TiedJoint(name, one.origin, one.axis, one.kind, place, ((master, factor),), offset)
        )
    names = [one.name for one in followers]
    joints = tuple(joint for joint in robot.joints if joint.name not in names)
    return replace(robot, joints=joints, tied=tuple(followers))


@pytest.mark.slow
@pytest.mark.parametrize(
    "ties",
    [
        [("q3", "q2", -1.0, 0.5)],  # a parallelogram
        [("q5", "q3", -1.0, 0.3)],  # the tip follows
        [("q4", "q1", 0.5, 0.2)],  # a whole turn of the first joint makes a difference
        [("q3", "q2", 2.0, -0.3), ("q5", "q4", 1.0, 0.0)],
    ],
)
def test_joints_that_follow_others_move_with_them(
    ties: list[tuple[str, str, float, float]],
) -> None:
    """Signs and zeros of the free joints are found, and followers need none of their own."""
    robot = with_ties(arm(*ELBOW, ([0.2, 0, 0], [0, 1, 0])), *ties)
    names = robot.joint_names
    zeros = dict(zip(names, (20.0, -38.6, 57.3, -21.0), strict=False))
    table = {"sign": {names[1]: -1}, "zero_deg": zeros}
    robot = robot_from_dict(robot_to_dict(robot) | {"controller": table})
    found = find_controller(robot, measured(robot, 9, 2))
    assert found.clear
    assert found.best.rms < 1.2e-4
    assert_found(found, robot)
    assert set(found.best.table()["zero_deg"]) == set(names) - set(found.untold)
    assert names[1] not in found.untold


@pytest.mark.slow
def test_a_controller_that_shows_the_elbow_of_a_parallelogram_is_found() -> None:
    """Poses of the model are the motors'; what is counted from the upper arm has `follows`."""
    content = robot_to_dict(load_robot("palletiser"))
    table = {"zero_deg": {"q2": 88.5}, "follows": {"q3": "q2"}}
    robot = robot_from_dict(content | {"controller": table})
    found = find_controller(robot, measured(robot, 9, 2))
    assert found.clear
    assert found.best.table()["follows"] == {"q3": "q2"}
    assert found.best.table()["zero_deg"]["q2"] == pytest.approx(88.5, abs=0.01)


@pytest.mark.slow
def test_nothing_to_say_where_the_controller_counts_as_the_model() -> None:
    """The table is empty, and the summary says that none is needed."""
    robot = arm(*SHORT)
    found = find_controller(robot, measured(robot, 6, noise=0))
    assert found.best.table() == {}
    assert found.best.rms < 1e-9
    assert "no table [controller] is needed" in found.summary()
    assert np.allclose(found.marker[0], MARKERS[0], atol=1e-6)
    assert np.allclose(found.base[:3, 3], [1.0, -2.0, 0.5], atol=1e-6)


@pytest.mark.slow
def test_a_joint_that_stands_still_tells_nothing() -> None:
    """Its sign is not searched, and the result says why."""
    robot = arm(*SHORT, sign={"q1": -1, "q2": -1})
    moving = measured(robot, 8, markers=2)
    still = replace(moving, shown=moving.shown.copy())
    q = robot.of_shown(still.shown)
    q[:, 0] = 0.3
    T = robot.with_tool(np.eye(4)).forward(q)[still.pose]
    points = (T[:, :3, :3] @ MARKERS[still.marker, :, None])[..., 0] + T[:, :3, 3]
    found = find_controller(robot, replace(still, shown=robot.shown(q), measured=points))
    assert found.clear
    assert "stands still" in found.untold["q1"]
    signs = [one.table()["sign"] for one in (found.best, *found.same)]
    assert sorted(map(str, signs)) == ["{'q2': -1}", "{'q3': -1}"]  # the second turned over


def test_too_few_poses_are_refused() -> None:
    """There have to be more coordinates than unknowns."""
    robot = arm(*ELBOW)
    with pytest.raises(UserError, match=r"^9 coordinates are too few for .* expected more poses$"):
        find_controller(robot, measured(robot, 3))


@pytest.mark.slow
def test_another_robot_is_noticed() -> None:
    """Positions that no way to count explains leave more than nominal arms are wrong by."""
    other = arm(*SHORT[:2], ([0.4, 0.2, 0.4], [0, 1, 0]))
    found = find_controller(arm(*SHORT), measured(other, 10))
    assert found.far_off


@pytest.mark.slow
def test_json_is_strict_and_says_all() -> None:
    """Every entry is plain data."""
    robot = arm(*SHORT, sign={"q3": -1})
    found = find_controller(robot, measured(robot, 6))
    data = found.to_dict()
    tables = [data["controller"], *(one["controller"] for one in data["same"])]
    assert any(table["sign"] == {"q3": -1} for table in tables)
    assert "NaN" not in json_text(found.to_dict())


def test_repeated_positions_are_averaged() -> None:
    """The mean of equal poses and markers counts, with how often it was measured."""
    shown = np.array([[0.1, 0.2], [0.3, 0.4], [0.1, 0.2], [0.1, 0.2]])
    seen = np.arange(12.0).reshape(4, 3)
    found = Positions.of_rows(shown, seen, ["a", "a", "b", "a"])
    assert len(found) == 3
    assert found.names == ("a", "b")
    assert found.measured.tolist() == [[4.5, 5.5, 6.5], [6, 7, 8], [3, 4, 5]]
    assert found.count.tolist() == [2, 1, 1]


def tied() -> Robot:
    """The KUKA whose third joint follows the second one, as in a parallelogram."""
    content = robot_to_dict(load_robot("kuka_kr270"))
    third = {key: value for key, value in content["joints"][2].items() if "limits" not in key}
    content["joints"][2] = third | {"mimic": {"joint": "q2", "factor": -0.7, "offset_rad": 0.4}}
    return robot_from_dict(content)


@pytest.mark.parametrize(("markers", "robot"), [(1, tied()), (3, load_robot("kuka_kr270"))])
def test_derivatives_are_those_of_differences(markers: int, robot: Robot) -> None:
    """Columns of the Jacobian are central differences, where a joint is tied to another too."""
    robot = robot.with_tool(np.eye(4))
    n = robot.n
    positions = measured(robot, 4, markers)
    rng = np.random.default_rng(3)
    free = [1, 2, 4]
    fits = Fits.at(np.eye(n)[None], rng.uniform(-1, 1, (1, n)), markers)
    turn = Rotation.from_rotvec([[0.3, -0.2, 0.5]]).as_matrix()
    fits = replace(fits, turn=turn, marker=rng.uniform(-1, 1, (1, markers, 3)))

    def residual(step: Array) -> Array:
        other = moved(fits, step[None], free)
        _, points = other.arms(other.frames(robot, positions), positions)
        return other.residual(points, positions).ravel()

    frames = fits.frames(robot, positions)
    J = jacobian(fits, positions, frames, *fits.arms(frames, positions), free)
    J = J.reshape(-1, J.shape[-1])
    for column, unit in enumerate(1e-6 * np.eye(J.shape[1])):
        slope = (residual(unit) - residual(-unit)) / 2e-6
        assert J[:, column] == pytest.approx(-slope, abs=1e-7)


def test_frames_are_found_in_closed_form() -> None:
    """With the true way to count, a few rounds and steps lead to the truth."""
    robot = load_robot("kuka_kr270").with_tool(np.eye(4))
    positions = measured(robot, 6, markers=2, noise=0)
    begun = place_frames(robot, Fits.at(np.eye(6)[None], np.zeros((1, 6)), 2), positions)
    assert begun.rms[0] < 0.3
    found = descend(robot, begun, positions, [], 10)
    assert found.rms[0] < 1e-9
    assert found.marker[0] == pytest.approx(MARKERS[:2], abs=1e-8)


def test_arms_that_are_the_same() -> None:
    """Parallel upright axes may be turned over; sliding axes may be turned in pairs."""
    upright = arm(([0, 0, 1], [0, 0, 1]), ([0.4, 0, 0], [0, 0, 1]), ([0.3, 0, 0], [0, 0, 1]))
    signs = [one.sign.tolist() for one in same_arms(upright)]
    assert signs == [[1, 1, 1], [-1, -1, -1]]
    _, over = same_arms(arm(*ELBOW))
    assert over.sign.tolist() == [-1, -1, -1, -1]
    assert over.turn[2, 2] == pytest.approx(-1)


def test_a_plane_may_lie_upside_down() -> None:
    """Where parallel axes alone move, the arm is the same after half a turn about a line."""
    along = np.array([np.cos(0.1), 0, -np.sin(0.1)])
    joints = (
        ([0, 0, 0.5], [0, 0, 1]),
        ([0.1, 0, 0.3], [0, 1, 0]),
        ((0.7 * along).tolist(), [0, 1, 0]),
        ((0.6 * along).tolist(), [0, 0, 1]),
    )
    own, over = same_arms(arm(*joints), [1, 2])
    assert own.sign.tolist() == [1, 1, 1, 1]
    assert over.sign.tolist() == [1, -1, -1, 1]
    assert over.turn[1, 1] == pytest.approx(-1)


@pytest.mark.slow
def test_a_spherical_wrist_turned_by_half_a_turn() -> None:
    """The classical case: the middle joint reversed, its neighbours half a turn away."""
    same = same_arms(load_robot("kuka_kr270").with_tool(np.eye(4)))
    ways = [(one.sign.tolist(), np.rad2deg(one.offset).round().tolist()) for one in same]
    assert ([1, 1, 1, 1, -1, 1], [0, 0, 0, 180, 0, 0]) in ways
    assert len(ways) == 4


def test_of_ways_that_make_the_same_arm_one_is_tried() -> None:
    """Copies are left out, and so are other signs of joints that stand still."""
    upright = arm(([0, 0, 1], [0, 0, 1]), ([0.4, 0, 0], [0, 0, 1]), ([0.3, 0, 0], [0, 0, 1]))
    same = same_arms(upright)
    everything = ways_to_count(upright, (), [0, 1, 2])
    fewer = ways_to_count(upright, same, [0, 1, 2])
    still = ways_to_count(upright, (), [1, 2])
    assert len(everything) == 8 * 7  # no coupling, or one of three pairs with factor 1 or -1
    assert len(fewer) == 4 * 7
    assert len(still) == 4 * 3


@pytest.mark.slow
def test_a_heavy_robot_by_five_poses() -> None:
    """Of the 192 ways to count a KR 270, 48 differ, and five poses of one marker tell which."""
    table = {"sign": {"q1": -1, "q2": -1, "q4": -1}, "zero_deg": {"q2": -90, "q3": 90}}
    robot = robot_from_dict(
        robot_to_dict(load_robot("kuka_kr270")) | {"controller": table | {"follows": {"q3": "q2"}}}
    )
    found = find_controller(robot, measured(robot, 6, seed=4))
    assert found.clear
    tables = [one.table() for one in (found.best, *found.same)]
    assert any(one.get("sign") == table["sign"] for one in tables)
    assert all(one["follows"] == {"q3": "q2"} for one in tables)
    assert len(found.same) == 3


def test_too_many_joints_are_refused() -> None:
    """Signs double with each joint; the message says what to do."""
    joints = [([0.3, 0, 0.1], [float(i % 3 == axis) for axis in range(3)]) for i in range(9)]
    robot = arm(*joints)
    with pytest.raises(UserError, match=r"^9 joints move, .* expected 8 at most, with the others"):
        find_controller(robot, measured(robot, 10))
