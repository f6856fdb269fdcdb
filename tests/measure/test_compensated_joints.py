"""Commands that compensate the deflection under load."""

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from tasks import K0, TASK, TASK_WRENCH, TEST_POSE, model_of

from edtk.fit.equilibrium import equilibrium_deflection
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import compensated_joints, equilibrium
from edtk.measure.expected_error import remaining_error
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform


def seven_joints():
    """A chain on skew axes whose second and fifth joints are prismatic."""
    rng = np.random.default_rng(0)
    kinds = ["prismatic" if i in (1, 4) else "revolute" for i in range(7)]
    origins = [transform(rng.normal(size=3), rng.uniform(-3, 3, size=3)) for _ in kinds]
    joints = [
        Joint(f"q{i}", T, rng.normal(size=3), (-2.0, 2.0), kinds[i]) for i, T in enumerate(origins)
    ]
    return Robot("seven", tuple(joints), tool=transform([0.2, 0.1, -0.3], [1.0, 0.2, -0.5]))


def position_error(model, q0, wrench, k):
    """Distance of the loaded tool point from the desired one, after compensation."""
    q = compensated_joints(model, q0, wrench, k)
    return np.linalg.norm(
        model.robot.forward(q)[..., :3, 3]
        + model.regressor(q, wrench) @ k
        - model.robot.forward(q0)[..., :3, 3],
        axis=-1,
    )


def test_error_by_the_linear_model_is_of_second_order():
    """With deflections linear in the command, halving the load quarters the remaining error."""
    load = 10 * TASK_WRENCH
    whole, half, quarter = (position_error(TASK, TEST_POSE, f * load, K0) for f in (1.0, 0.5, 0.25))
    assert whole / half == pytest.approx(4.0, rel=0.05)
    assert half / quarter == pytest.approx(4.0, rel=0.025)
    assert whole < 0.05 * np.linalg.norm(TASK.deflection(TEST_POSE, load, K0))


def test_compensation_is_equation_15():
    """With six compliant joints the command is q0 - J0^-1 K_C^-1 W, by the Jacobian's inverse."""
    model = model_of((0.986, 0.0, 0.1), unknown=None, rows="pose")
    k = np.r_[3.8e-6, K0]
    turn = np.linalg.solve(
        model.robot.jacobian(TEST_POSE), model.deflection(TEST_POSE, TASK_WRENCH, k)
    )
    np.testing.assert_allclose(
        compensated_joints(model, TEST_POSE, TASK_WRENCH, k), TEST_POSE - turn, atol=1e-13
    )


def test_compensation_is_the_linear_solution_of_equation_14():
    """To first order the command moves the tool point by minus the deflection."""
    dq = compensated_joints(TASK, TEST_POSE, TASK_WRENCH, K0) - TEST_POSE
    moved = TASK.robot.jacobian(TEST_POSE)[:3] @ dq
    np.testing.assert_allclose(
        moved, -TASK.deflection(TEST_POSE, TASK_WRENCH, K0), rtol=1e-8, atol=1e-13
    )


def test_compensation_keeps_rigid_joints_and_its_argument():
    """Joints without compliance are not turned, and the desired pose is left as it was."""
    q0 = TEST_POSE.copy()
    q = compensated_joints(TASK, q0, TASK_WRENCH, K0)
    assert q[0] == q0[0]
    np.testing.assert_array_equal(q0, TEST_POSE)


def test_compensation_holds_in_a_singular_pose():
    """In the stretched arm, where J has no inverse, the command still removes the first order."""
    q0 = np.zeros(6)
    assert np.linalg.matrix_rank(TASK.robot.jacobian(q0)) < 6
    load = 10 * TASK_WRENCH
    errors = [position_error(TASK, q0, f * load, K0) for f in (1.0, 0.5)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_compensation_of_a_batch_equals_the_loop(batch):
    """Poses and wrenches of any batch shape give what they give one by one."""
    rng = np.random.default_rng(1)
    q0 = rng.uniform(*TASK.robot.limits, size=(*batch, 6))
    each = rng.normal(size=(*batch, 6))
    for W in (TASK_WRENCH, each):
        q = compensated_joints(TASK, q0, W, K0)
        assert q.shape == q0.shape
        for i in np.ndindex(*batch):
            expected = compensated_joints(TASK, q0[i], W if W is TASK_WRENCH else W[i], K0)
            np.testing.assert_allclose(q[i], expected, atol=1e-14)


def equation_14(model, q0, wrench, k):
    """The command whose pose plus the deflection in q0 is the desired pose: Eq. (14) to the end."""
    goal = model.robot.forward(q0)
    dt = model.deflection(q0, wrench, k)
    turned = Rotation.from_rotvec(-dt[3:]).as_matrix() @ goal[:3, :3]

    def miss(q):
        T = model.robot.forward(q)
        turn = Rotation.from_matrix(T[:3, :3] @ turned.T).as_rotvec()
        return np.r_[T[:3, 3] + dt[:3] - goal[:3, 3], turn]

    return root(miss, q0, tol=1e-15).x


@pytest.mark.parametrize("q0", [TEST_POSE, np.zeros(6)], ids=["regular", "singular"])
def test_compensation_is_exact_in_the_equilibrium(q0):
    """The loaded robot rests in the desired joints and pose, under ten times the load too."""
    q = compensated_joints(TASK, q0, 10 * TASK_WRENCH, K0)
    theta = equilibrium(TASK.robot, q, 10 * TASK_WRENCH, np.r_[0, K0])
    assert np.abs(theta).max() > 1e-3
    np.testing.assert_allclose(q + theta, q0, atol=1e-14)
    assert np.abs(remaining_error(TASK, q0, 10 * TASK_WRENCH, K0, K0)).max() < 1e-14


def test_compensation_is_exact_with_prismatic_and_more_than_six_joints():
    """A skew chain of seven revolute and prismatic joints is brought to the desired pose too."""
    robot = seven_joints()
    rng = np.random.default_rng(4)
    model = ElastostaticModel(robot)
    k = rng.uniform(1e-6, 1e-4, robot.n)
    q0 = rng.uniform(-1, 1, (5, robot.n))
    W = 30 * rng.normal(size=(5, 6))
    assert np.abs(equilibrium_deflection(ElastostaticModel(robot), q0, W, k)).max() > 1e-3
    assert np.abs(remaining_error(model, q0, W, k, k)).max() < 1e-13


def test_other_readings_of_compensation_are_off_by_the_second_order():
    """Other readings of the equations leave errors of second order.

    They are Eq. (14) solved to the end, and Eq. (15) for the position by a pseudo-inverse. Eq. (15)
    itself, with the inverse of the full Jacobian, is the exact command and leaves rounding.
    """
    model = model_of((0.986, 0.0, 0.1), unknown=None, rows="pose")
    k = np.r_[3.8e-6, K0]
    J = model.robot.jacobian(TEST_POSE)
    sizes = 16 * 2.0 ** -np.arange(6)
    left = []
    for W in np.multiply.outer(sizes, TASK_WRENCH):
        dt = model.deflection(TEST_POSE, W, k)
        commands = [
            TEST_POSE - np.linalg.solve(J, dt),
            TEST_POSE - np.linalg.pinv(J[:3]) @ dt[:3],
            equation_14(model, TEST_POSE, W, k),
        ]
        loaded = [
            model.robot.forward(q + equilibrium(model.robot, q, W, k))[:3, 3] for q in commands
        ]
        left.append(np.linalg.norm(loaded - model.robot.forward(TEST_POSE)[:3, 3], axis=-1))
    exact, *others = np.transpose(left)
    assert exact.max() < 1e-13
    for error in others:
        assert np.polyfit(np.log(sizes), np.log(error), 1)[0] == pytest.approx(2.0, abs=0.05)
