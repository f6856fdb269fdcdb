"""Joints that drives turn against other bodies: parallelograms and hollow wrists."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.controller import Controller, Follows
from edtk.robots.joint import Coupling, Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Beyond, Robot
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict
from edtk.robots.rotations import transform
from edtk.robots.workspace import Workspace, joints_on_limits, within_margin

PALLETISER = load_robot("palletiser")
DEGREES = {"q4": 350, "q5": 125, "q6": 350}
AXES = {"z": [0.0, 0, 1], "y": [0.0, 1, 0], "x": [1.0, 0, 0]}
LENGTHS = [(0, 0, 0.4), (0.2, 0, 0), (0, 0, 0.6), (0.5, 0, 0), (0.1, 0, 0), (0.1, 0, 0.02)]


def wrist(*couplings: Coupling) -> Robot:
    """Six joints, of which the last ones are driven through those before."""
    joints = tuple(
        Joint(f"q{j}", transform(origin), np.array(AXES[axis]), (-2.0, 2.0))
        for j, (origin, axis) in enumerate(zip(LENGTHS, "zyyxyx", strict=True), start=1)
    )
    return Robot("6R", joints, tool=transform((0.1, 0.03, -0.02)), couplings=couplings)


HOLLOW = wrist(
    Coupling("q5", "q4", 0.0125),
    Coupling("q6", "q5", -0.98, (-1.5, 1.5)),
    Coupling("q6", "q4", 0.02),
)
Q = np.random.default_rng(0).uniform(-1.2, 1.2, size=(4, 6))


def turned(q):
    """What the motors of a hollow wrist turn: each passes the joints before its own."""
    x5 = q[4] + 0.0125 * q[3]
    return np.array([*q[:4], x5, q[5] + 0.02 * q[3] - 0.98 * x5])


def tip(q):
    """The tool point, by rotations of scipy."""
    place = np.zeros(3)
    frame = Rotation.identity()
    for x, origin, axis in zip(turned(q), LENGTHS, "zyyxyx", strict=True):
        place = place + frame.apply(origin)
        frame = frame * Rotation.from_rotvec(x * np.array(AXES[axis]))
    return place + frame.apply([0.1, 0.03, -0.02])


def test_a_chain_of_couplings_is_followed_through(derivative):
    """Joint 6 follows joint 5, which follows joint 4: positions, columns, rows and slopes."""
    model = ElastostaticModel(HOLLOW)
    wrench = np.array([100.0, -50.0, -200.0, 3.0, 2.0, 1.0])
    B = np.random.default_rng(1).normal(size=(3, 6))
    for q in Q:
        np.testing.assert_allclose(HOLLOW.forward(q)[:3, 3], tip(q), atol=1e-14)
        J = derivative(tip, q)
        np.testing.assert_allclose(HOLLOW.jacobian(q)[:3], J, atol=1e-9)
        rows = model.regressor(q, [100, -50, -200, 0, 0, 0])
        np.testing.assert_allclose(rows, J * (J.T @ [100, -50, -200]), atol=1e-6)
        numeric = derivative(lambda x: (B * model.regressor(x, wrench)).sum(), q)
        np.testing.assert_allclose(model.regressor_slope(q, wrench, B), numeric, atol=1e-6)


def test_the_level_follows_both_arms_and_so_one_motor():
    """Of joints, the wrist head follows two; of motors, that of the forearm alone."""
    level = PALLETISER.ties.matrix[3]
    np.testing.assert_array_equal(level, [0, 0, -1, 0])
    assert PALLETISER.tied[0].masters == ("q2", "q3")
    np.testing.assert_allclose(PALLETISER.chain[3].limits, np.deg2rad([-110, 20]))


def test_limits_of_motors_and_of_the_joint_itself_hold():
    """A pose within all motors' limits may fold the elbow too far: feasible, refused, named."""
    q = np.deg2rad([[0, 0, 0, 0], [0, 80, -10, 0], [0, 80, -10.001, 0], [0, 0, 111, 0]])
    workspace = Workspace(PALLETISER)
    assert workspace.contains(q + 1e-12).tolist() == [True, False, False, False]
    np.testing.assert_allclose(np.rad2deg(PALLETISER.bounds.excess(q)[1, 4]), 20)
    told = Beyond.of(PALLETISER, q[1], 4)
    assert (told.name, told.joint, round(told.value)) == ("q3 itself", 2, -90)
    labels = [text for text in workspace.labels if "itself" in text]
    assert labels == ["joint limit q3 itself > -70 deg", "joint limit q3 itself < 65 deg"]
    on = joints_on_limits(PALLETISER, np.deg2rad([[0, 70, 0, 0], [0, 0, 40, 0]]))
    assert on == {"q3 itself": [0]}
    assert joints_on_limits(PALLETISER, np.deg2rad([[0, 70, 0, 0]]), frozenset([1, 2])) == {}


def test_slacks_of_sums_have_their_gradients(derivative):
    """A descent in the poses of an arm with a parallelogram runs along the limit of its elbow."""
    workspace = Workspace(PALLETISER)
    q = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(workspace.gradient(q), derivative(workspace.slack, q), atol=1e-9)
    margin = within_margin(PALLETISER, {"revolute": np.deg2rad(5)}, frozenset())
    np.testing.assert_allclose(np.rad2deg(margin.couplings[0].limits), [-65, 60])
    tight = replace(PALLETISER, couplings=(Coupling("q3", "q2", -1.0, (0.0, 0.1)),))
    with pytest.raises(ValueError, match="leaves no range for joint 'q3' itself"):
        within_margin(tight, {"revolute": 0.06}, frozenset())


def test_a_controller_may_show_the_joint_itself():
    """Where it counts q3 from the upper arm, `follows` says so: the model keeps the motor's."""
    counts = Controller(np.ones(4), np.zeros(4), PALLETISER.units, (Follows(2, 1, 1.0),))
    robot = replace(PALLETISER, controller=counts)
    shown = np.deg2rad([0, 30, -20, 0])  # the elbow 20 deg more open than a right angle
    np.testing.assert_allclose(np.rad2deg(robot.of_shown(shown)), [0, 30, 10, 0], atol=1e-12)
    np.testing.assert_allclose(robot.ties.variables(robot.of_shown(shown))[2], shown[2])


def test_couplings_are_written_and_read():
    """Names, factors and limits come back bit by bit, of files and of dictionaries."""
    for robot in (PALLETISER, HOLLOW):
        content = robot_to_dict(robot)
        again = robot_from_dict(json.loads(json.dumps(content)))
        assert again.couplings == robot.couplings
        assert robot_to_dict(again) == content
    assert PALLETISER.digest != replace(PALLETISER, couplings=()).digest


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ([("q3", "q3", -1)], "joint q3 is coupled to itself; expected another joint"),
        ([("q9", "q2", -1)], "no free joint 'q9'; this robot has q1, q2, q3, q4, slide"),
        ([("q3", "level", -1)], "no free joint 'level'; this robot has"),
        ([("q3", "q2", -1), ("q2", "q3", 1)], "coupled in a circle, among q3, q2; expected none"),
        ([("q3", "q2", -1), ("q3", "q2", 1)], "joint q3 is coupled to q2 twice"),
        ([("q3", "slide", -1)], "joint slide is prismatic; expected couplings of joints that turn"),
        ([("q3", "q2", 0)], "coupled to q2 with the factor 0; expected a number that is not zero"),
        ([("q3", "q4", 1)], "joint q4 turns without end, and q3 would with it; expected limits"),
        ([("q3", "q2", -1, [80, 20])], "expected the lower limit of its own angle below the upper"),
        (
            [("q3", "q2", -1, [160, 170])],
            "there is no pose: q3 itself is to be within 160 .. 170 deg, and the limits of the "
            "drives leave -105 .. 150 deg",
        ),
    ],
)
def test_wrong_couplings_are_one_line(tables, message):
    """Itself, unknown, not free, circles, twice, a slide, no end, and limits that leave no pose."""
    content = robot_to_dict(PALLETISER)
    content["joints"][-1] |= {"continuous": True}
    del content["joints"][-1]["limits_deg"]
    slide = {"kind": "prismatic", "limits_m": [0, 1], "mass_kg": 0, "center_m": [0, 0, 0]}
    content["joints"].append({"name": "slide", "origin_m": [0, 0, 0], "axis": [0, 0, 1]} | slide)
    content["coupling"] = [
        dict(zip(("joint", "follows", "factor", "joint_limits_deg"), table, strict=False))
        for table in tables
    ]
    with pytest.raises(RobotFileError) as caught:
        robot_from_dict(content, "robot arm.toml")
    assert caught.value.key == "coupling"
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
