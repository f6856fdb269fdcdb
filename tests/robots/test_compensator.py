"""Gravity compensators: the potential across a joint, what it does to an arm, and wrong ones."""

from dataclasses import replace

import numpy as np
import pytest

import edtk
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest, why_no_rest
from edtk.robots.compensator import Compensator, GivingWay
from edtk.robots.elastic_robot import ElasticJoint, ElasticRobot, weights_of
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict
from edtk.robots.robot_overview import RobotOverview
from edtk.robots.rotations import rotation
from edtk.robots.weights import DeadWeights

ROBOT = load_robot("kuka_kr270_compensator")
PLAIN = load_robot("kuka_kr270")
K = np.array([4e-7, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
COIL = Compensator("q2", [-0.6, 0.1, -0.2], [0.18, 0.12, 0.05], 6e4, 2e4)
GAS = replace(COIL, medium="gas")
TABLE = {
    "joint": "q2",
    "anchors_mm": [[0, 200, -650], [-180, 200, 0]],
    "stiffness_N_per_mm": 150,
    "preload_N": 70000,
}
Q = np.random.default_rng(0).uniform(*PLAIN.limits, (4, 6))


def on(robot, *compensators):
    return replace(robot, compensators=compensators)


@pytest.mark.parametrize("given", [COIL, GAS], ids=["coil", "gas"])
def test_torque_and_its_derivatives_are_those_of_the_potential(given):
    """By differences, at the joint's angles."""
    pull = on(PLAIN, given).pulls[0]
    q = np.linspace(-2.5, 0, 7)
    h = 1e-5

    def by_angle(function):
        return (function(q + h) - function(q - h)) / (2 * h)

    np.testing.assert_allclose(pull.torque(q), -by_angle(pull.energy), rtol=1e-7, atol=1e-5)
    np.testing.assert_allclose(pull.derivative(q), by_angle(pull.torque), rtol=1e-7, atol=1e-5)
    second = by_angle(pull.derivative)
    np.testing.assert_allclose(pull.second_derivative(q), second, rtol=1e-7, atol=1e-5)
    assert pull.energy(np.zeros(1)) == 0


@pytest.mark.parametrize("given", [COIL, GAS], ids=["coil", "gas"])
def test_torque_moves_with_each_number_of_the_compensator(given):
    """Anchors, stiffness and preload, by differences."""
    q = np.linspace(-2.5, 0.1, 7)
    numbers = np.array(given.numbers())
    exact = on(PLAIN, given).pulls[0].by_numbers(q)
    for i, size in enumerate([1e-5] * 6 + [1.0, 1.0]):
        h = size * np.eye(8)[i]
        more, less = (on(PLAIN, given.with_numbers(numbers + c * h)).pulls[0] for c in (1, -1))
        expected = (more.torque(q) - less.torque(q)) / (2 * size)
        np.testing.assert_allclose(exact[i], expected, atol=1e-7 * np.abs(exact[i]).max())


@pytest.mark.parametrize("given", [COIL, GAS], ids=["coil", "gas"])
def test_elastic_joints_between_the_anchors_are_loaded_as_the_distance_says(given):
    """Loads are slopes of the potential, and their derivatives those of the loads."""
    robot = replace(PLAIN, joints=(PLAIN.joints[0], replace(PLAIN.joints[1], axis=[0.6, 0.8, 0])))
    robot = on(replace(robot, tied=()), given)
    places = [("q2", component) for component in (1, 3, 5)]
    elastic = tuple(ElasticJoint(name, i, f"{name}.{i}") for name, i in places)
    whole = ElasticRobot.of(robot, elastic)
    pull = weights_of(whole, DeadWeights((), (), 2, robot.pulls)).pulls[0]
    assert pull.places == [1, 2, 3, 4]
    x = np.random.default_rng(1).uniform(-0.2, 0.2, (4, 5)) - [[0], [0], [0], [1]]
    a = given.before

    def length(x):
        y, rx, rz, q = x
        turns = [x_rotation(rx), z_rotation(rz), axis_rotation(robot.joints[1].axis, q)]
        carried = np.linalg.multi_dot([*turns, given.behind])
        return np.linalg.norm(carried + np.array([0, y, 0]) - a)

    h = 1e-5
    steps = h * np.eye(4)[:, :, None]
    energy = [[energy_at(pull, length((x + s)[:, i])) for i in range(5)] for s in (*steps, *-steps)]
    by_difference = (np.array(energy[:4]) - energy[4:]) / (2 * h)
    np.testing.assert_allclose(pull.loads(x), -by_difference, rtol=1e-6, atol=1e-4)
    slopes = [(pull.loads(x + s) - pull.loads(x - s)) / (2 * h) for s in steps]
    H = pull.load_derivative(x)
    np.testing.assert_allclose(H, np.stack(slopes, axis=1), rtol=1e-6, atol=1e-2)
    numbers = np.array(given.numbers())
    exact = pull.loads_by_numbers(x)
    for i, size in enumerate([1e-5] * 6 + [1.0, 1.0]):
        step = size * np.eye(8)[i]
        more, less = (replace(pull, given=given.with_numbers(numbers + c * step)) for c in (1, -1))
        expected = (more.loads(x) - less.loads(x)) / (2 * size)
        np.testing.assert_allclose(exact[i], expected, atol=1e-7 * np.abs(exact[i]).max())
    still = np.vstack([np.zeros((3, 5)), x[3:]])
    np.testing.assert_allclose(pull.loads(still)[3], pull.torque(x[3]), rtol=1e-12)
    np.testing.assert_allclose(pull.load_derivative(still)[3, 3], pull.derivative(x[3]), rtol=1e-12)
    np.testing.assert_allclose(
        pull.loads_by_numbers(still)[:, 3], pull.by_numbers(x[3]), rtol=1e-9, atol=1e-9
    )


def energy_at(pull, length):
    """Work of the force from the anchors' first distance."""
    s = np.linspace(pull.rest, length, 2001)
    return np.trapezoid(pull.force(s)[0], s)


def axis_rotation(axis, angle):
    return rotation(angle * np.asarray(axis))


def x_rotation(angle):
    return axis_rotation([1.0, 0, 0], angle)


def z_rotation(angle):
    return axis_rotation([0, 0, 1.0], angle)


def test_distance_of_the_anchors_is_the_law_of_cosines():
    """s^2 = a^2 + L^2 + 2 a L cos(q + phi) in a plane, about any axis; along it squares add up."""
    a, L, phi, apart = 0.65, 0.18, 0.4, 0.07
    q = np.linspace(-2.5, 0, 9)
    rng = np.random.default_rng(3)
    axis, across = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    other = np.cross(axis, across)
    before = -a * across + 0.3 * axis
    behind = L * (np.cos(phi) * across + np.sin(phi) * other) + (0.3 + apart) * axis
    joint = replace(PLAIN.joints[1], axis=axis)
    robot = replace(PLAIN, joints=(PLAIN.joints[0], joint, *PLAIN.joints[2:]))
    pull = on(robot, Compensator("q2", before, behind, 1e4, 1e3)).pulls[0]
    expected = a**2 + L**2 + 2 * a * L * np.cos(q + phi) + apart**2
    np.testing.assert_allclose(pull.reach(q).length ** 2, expected, rtol=1e-13)


def test_loads_of_weights_and_compensators_add_up():
    """Torque, derivative and slope of both together, and of two compensators at one joint."""
    pulls = on(PLAIN, COIL, GAS).pulls
    both = DeadWeights((), (), 6, pulls[:1]).with_more(DeadWeights((), (), 6, pulls[1:]))
    frames = PLAIN.frames(Q)
    torque = both.torque(frames)
    np.testing.assert_allclose(torque[1], sum(pull.torque(Q[:, 1]) for pull in pulls))
    assert not torque[[0, 2, 3, 4, 5]].any()
    H = both.torque_derivative(frames)
    s = np.arange(1.0, 7.0)[:, None] * np.ones(len(Q))
    np.testing.assert_allclose(both.torque_slope(frames, s), np.einsum("jkm,jm->km", H, s))


def test_columns_give_way_as_the_equilibrium_does():
    """With a stiff compensator, which its own torque hardly bends: to the first order of k."""
    stiff = Compensator("q2", [0, 0.2, -0.65], [-0.18, 0.2, 0], 2e7, 0.0)
    robot = on(PLAIN, stiff)
    own = DeadWeights((), (), 6, robot.pulls)
    gives = robot.giving_way(K)
    assert isinstance(gives, GivingWay)
    q = Q.copy()
    q[:, 1] = np.deg2rad([-1, -0.5, 0.5, 1])  # near its rest, where it is stiff and does not pull
    wrench = np.array([2.0, 3.0, -5.0, 0.0, 0.0, 0.0])
    model = ElastostaticModel(robot, own_weights=own, gives=gives)

    def moved(k):
        rest = Rest.of(model, q, wrench, k)
        return robot.forward(rest.end)[:, :3, 3] - robot.forward(rest.start)[:, :3, 3]

    h = 1e-10 * np.eye(6)[1]
    exact = (moved(K + h) - moved(K - h)) / 2e-10
    column = model.regressor(q, wrench)[..., 1]
    plain = replace(model, gives=None).regressor(q, wrench)[..., 1]
    assert np.abs(exact - plain).max() > 0.3 * np.abs(exact).max()
    assert np.abs(exact - column).max() < 0.03 * np.abs(exact).max()


@pytest.mark.parametrize("absolute", [False, True])
def test_slopes_of_columns_that_give_way(absolute):
    """Against differences, about the guess."""
    robot = on(ROBOT, COIL)
    weights = DeadWeights((), (), 6, robot.pulls) if absolute else None
    model = ElastostaticModel(robot, (1, 2), weights=weights, gives=robot.giving_way(20 * K))
    wrench = np.array([0.0, 300.0, -2500.0, 10.0, 0.0, 0.0])
    B = np.random.default_rng(2).normal(size=(len(Q), 3, 2))
    slope = model.regressor_slope(Q, wrench, B)
    for j, h in enumerate(1e-6 * np.eye(6)):
        change = model.regressor(Q + h, wrench) - model.regressor(Q - h, wrench)
        expected = (B * change).sum(axis=(1, 2)) / 2e-6
        np.testing.assert_allclose(slope[:, j], expected, atol=1e-7 * np.abs(slope).max())


def test_file_gives_the_same_robot_again():
    """Numbers to the last bit, millimetres where they can; another compensator, another digest."""
    odd = Compensator("q3", [1 / 3, 0.1, 0.2], [0.3, 0.0, -0.2], 1e4 / 3, -2e3, "gas")
    for robot in (ROBOT, on(ROBOT, *ROBOT.compensators, odd)):
        again = robot_from_dict(robot_to_dict(robot))
        given = [one.numbers() for one in again.compensators]
        assert given == [one.numbers() for one in robot.compensators]
        assert [one.medium for one in again.compensators] == [
            one.medium for one in robot.compensators
        ]
        assert again.digest == robot.digest
    assert robot_to_dict(ROBOT)["compensator"] == [TABLE]
    assert on(ROBOT).digest != ROBOT.digest != on(ROBOT, replace(COIL, preload=1.0)).digest
    assert "EXAMPLE" in ROBOT.source.upper()


WRONG = {
    "joint": ({"joint": "q9"}, "no joint 'q9'; this robot has q1, q2, q3, q4, q5, q6"),
    "axis": (
        {"anchors_mm": [[0, 200, 0], [-180, 200, 0]]},
        "the first anchor lies on the axis of q2, where no force turns the joint",
    ),
    "moved axis": (
        {"anchors_mm": [[0, 200, -650], [0, -80, 0]]},
        "the second anchor lies on the axis of q2",
    ),
    "same": ({"anchors_mm": [[1, 2, 3], [1, 2, 3]]}, "the anchors coincide"),
    "meet": (
        {"anchors_mm": [[0, 0, -180], [-180, 0, 0]]},
        "the anchors meet at q2 = -90 deg",
    ),
    "stiffness": ({"stiffness_N_per_mm": -1}, "stiffness_N_per_mm: expected at least 0"),
    "two units": ({"anchors_m": [[0, 0, 1], [1, 0, 0]]}, "expected anchors_mm, and nothing"),
    "no force": ({"kind": "gas", "preload_N": 0}, "expected a preload that is not 0"),
    "no room": (
        {"kind": "gas", "preload_N": -10000},
        "the gas has no volume left at q2 = -146 deg",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_compensator_is_one_line(case):
    """What is wrong, and of which compensator."""
    change, expected = WRONG[case]
    content = robot_to_dict(PLAIN) | {"compensator": [TABLE, TABLE | change]}
    with pytest.raises(RobotFileError) as error:
        robot_from_dict(content)
    assert str(error.value).startswith("compensator.1")
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_joints_that_slide_or_follow_have_no_compensator():
    """A gantry's beam, and a joint that follows another one."""
    sliding = robot_to_dict(PLAIN)
    sliding["joints"][1] |= {"kind": "prismatic", "limits_m": [0, 1]}
    sliding["joints"][1].pop("limits_deg")
    following = robot_to_dict(PLAIN)
    following["joints"][2] |= {"mimic": {"joint": "q2"}}
    following["joints"][2].pop("limits_deg")
    cases = (
        (sliding, TABLE, "q2 is prismatic; expected a joint that turns"),
        (following, TABLE | {"joint": "q3"}, "q3 follows q2, and has no spring of its own"),
    )
    for content, table, expected in cases:
        with pytest.raises(RobotFileError, match=expected):
            robot_from_dict(content | {"compensator": [table]})


def test_arm_that_would_snap_says_why():
    """A compensator that takes more stiffness than the joint's spring has."""
    soft = np.where(np.arange(6) == 1, 2e-4, K)
    pull = replace(ROBOT.compensators[0], before=np.array([0, 0.2, 0.65]))
    robot = on(PLAIN, pull)
    assert "the arm would snap" in why_no_rest(robot, np.deg2rad([0, -90, 0, 0, 0, 0.0]), soft)
    assert "buckles" in why_no_rest(robot, np.zeros(6), K)


def keys(**more):
    return {
        "tool": {"position_mm": [611.5, 0, -460]},
        "load": {"F_N": [0, 0, -2500]},
        "measurement": {"sigma_mm": 0.03},
        "joints": {"unknown": ["q2", "q3"]},
    } | more


def test_study_names_a_robot_and_its_compensators(tmp_path):
    """A table with a file; a file beside the study too, and the way back."""
    named = edtk.Study(robot={"file": "kuka_kr270", "compensator": [TABLE]}, **keys())
    assert (
        named.robot.digest
        == edtk.Study(robot=on(PLAIN, *ROBOT.compensators), **keys()).robot.digest
    )
    (tmp_path / "study.toml").write_text(named.to_toml())
    assert edtk.load_study(tmp_path / "study.toml").robot.digest == named.robot.digest
    table = {"file": "kuka_kr270", "compensator": [TABLE | {"joint": "q9"}]}
    with pytest.raises(edtk.UserError, match=r"robot: compensator\.0: no joint 'q9'"):
        edtk.Study(robot=table, **keys())
    with pytest.raises(edtk.UserError, match="robot: unknown robot 'r2d2'"):
        edtk.Study(robot={"file": "r2d2", "compensator": [TABLE]}, **keys())


def test_study_whose_arm_would_snap_is_refused():
    """A compensator upside down, and a soft joint: the angle, and both stiffnesses."""
    upside = TABLE | {"anchors_mm": [[0, 200, 650], [-180, 200, 0]]}
    soft = {"compliance_rad_per_Nm": {"q2": 2e-4, "q3": 4e-7}}
    robot = {"file": "kuka_kr270", "compensator": [upside]}
    assert edtk.Study(robot=robot, **keys()).robot.compensators
    with pytest.raises(edtk.UserError, match=r"the arm would snap at q2 = -?\d") as error:
        edtk.Study(robot=robot, **keys(simulation=soft))
    assert str(error.value).startswith("Study: robot.compensator: ")
    assert "from a spring of 5e+03" in str(error.value)


def test_overview_tells_of_compensators():
    """Torque and stiffness in the joint's range, and where the lever is zero."""
    (line,) = [one for one in RobotOverview(ROBOT).summary().splitlines() if "compensator (" in one]
    assert line.startswith("q2 has a gravity compensator (coil): torque -1.214e+04 .. ")
    assert line.endswith("; its line crosses the axis at -90 deg")
