"""The loaded equilibrium: springs, loads and the pose in which they are in balance."""

import numpy as np
import pytest
from chains import mixed_chain
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from edtk.fit.equilibrium import equilibrium_deflection
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import NoEquilibriumError, equilibrium, torque_and_derivative
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

pytestmark = pytest.mark.slow

KR270 = load_robot("kuka_kr270").with_tool(transform((0.6115, 0.0, -0.460)))
K = np.array([4e-7, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
ARM = Robot(
    "arm",
    (Joint("q1", transform(), np.array([0.0, 0.0, 1.0]), (-4.0, 4.0)),),
    tool=transform((2.0, 0.0, 0.0)),
)


def test_derivative_of_the_joint_loads_is_the_difference_quotient(derivative):
    """H is the derivative of J'W by all joints, for both kinds of joint, forces and torques."""
    robot = mixed_chain()
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, robot.n)
    W = rng.normal(size=6)
    tau, H = torque_and_derivative(robot, q[None], W[None])
    np.testing.assert_allclose(tau[0], robot.jacobian(q).T @ W, atol=1e-13)
    np.testing.assert_allclose(H[0], derivative(lambda x: robot.jacobian(x).T @ W, q), atol=1e-9)


def test_springs_and_load_are_in_balance():
    """Theta solves theta = k tau(q + theta), and the displacement is the motion of the tool."""
    rng = np.random.default_rng(1)
    q = rng.uniform(*KR270.limits, (200, 6))
    W = rng.normal(size=(200, 6)) * [2e3, 2e3, 2e3, 500, 500, 500]
    theta = equilibrium(KR270, q, W, K)
    moved = equilibrium_deflection(ElastostaticModel(KR270, rows="pose"), q, W, K)
    tau = np.einsum("nij,ni->nj", KR270.jacobian(q + theta), W)
    np.testing.assert_allclose(theta, K * tau, rtol=1e-11, atol=1e-16)
    before = KR270.forward(q)
    after = KR270.forward(q + theta)
    np.testing.assert_allclose(moved[:, :3], (after - before)[:, :3, 3], atol=1e-15)
    turned = Rotation.from_rotvec(moved[:, 3:]).as_matrix() @ before[:, :3, :3]
    np.testing.assert_allclose(turned, after[:, :3, :3], atol=1e-14)


def test_linear_model_is_the_first_order():
    """Halving the load quarters the distance of equilibrium and Eq. (2), rotation included."""
    model = ElastostaticModel(KR270, rows="pose")
    q = np.deg2rad([10, -60, 80, 40, 70, 50])
    W = np.array([500.0, -900.0, -2500.0, 100.0, 50.0, -80.0])
    sizes = 2.0 ** -np.arange(6)
    off = [
        equilibrium_deflection(model, q, s * W, K) - model.deflection(q, s * W, K) for s in sizes
    ]
    for rows in (slice(0, 3), slice(3, 6)):
        slope = np.polyfit(np.log(sizes), np.log([np.linalg.norm(x[rows]) for x in off]), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("kFL", [-5.0, 0.3, 0.9, 3.0])
def test_one_joint_solves_its_scalar_equation(kFL):
    """A single arm rests where theta = k F L sin(q + theta), on the unloaded pose's branch."""
    q = 0.4
    F = 500.0
    L = 2.0
    theta = equilibrium(ARM, [q], [-F * np.sign(kFL), 0, 0, 0, 0, 0], [abs(kFL) / (F * L)])
    expected = brentq(
        lambda t: t - kFL * np.sin(q + t), *((-q, 0.0) if kFL < 0 else (0.0, np.pi)), xtol=1e-15
    )
    assert theta[0] == pytest.approx(expected, abs=1e-12)


def test_buckling_is_refused_and_the_pose_is_named():
    """A straight arm is accepted just below its buckling load k F L = 1 and rejected beyond it."""
    W = np.array([-500.0, 0, 0, 0, 0, 0])
    assert equilibrium(ARM, [0.0], W, [0.99e-3]) == 0
    with pytest.raises(NoEquilibriumError, match="pose 3 has no stable equilibrium") as error:
        equilibrium(ARM, np.zeros((4, 1)), W, np.array([[0.5e-3], [0.9e-3], [1.01e-3], [2e-3]]))
    assert error.value.pose == 2


def test_absurd_load_is_refused_or_balanced():
    """Loads a thousand times too large end in a stable balance or in the named error."""
    rng = np.random.default_rng(2)
    for q in rng.uniform(*KR270.limits, (20, 6)):
        W = np.array([0, 0, 2.5e6, 0, 0, 0])
        try:
            theta = equilibrium(KR270, q, W, K)
        except NoEquilibriumError:
            continue
        np.testing.assert_allclose(
            theta, K * (KR270.jacobian(q + theta).T @ W), rtol=1e-9, atol=1e-12
        )


def test_rigid_robot_and_no_load():
    """Without compliance, or without load, nothing moves; rigid joints never do."""
    q = np.deg2rad([0, -60, 80, 40, 70, 50])
    W = np.array([0, 0, -2500.0, 0, 0, 0])
    for k, load in ((np.zeros(6), W), (K, np.zeros(6))):
        assert not equilibrium(KR270, q, load, k).any()
    theta = equilibrium(KR270, q, W, K * [1, 0, 1, 0, 1, 1])
    assert not theta[[1, 3]].any()
    assert theta[2] != 0


@pytest.mark.parametrize("batch", [(), (0,), (3,), (2, 3)])
def test_batch_equals_the_loop(batch):
    """Poses, wrenches and compliances of any batch shape give what they give one by one."""
    robot = mixed_chain()
    rng = np.random.default_rng(3)
    q = rng.uniform(-1, 1, (*batch, robot.n))
    W = rng.normal(size=(*batch, 6))
    k = rng.uniform(0, 3e-3, robot.n)
    found = equilibrium(robot, q, W, k)
    assert found.shape == (*batch, robot.n)
    for i in np.ndindex(*batch):
        one = equilibrium(robot, q[i], W[i], k)
        np.testing.assert_allclose(found[i], one, rtol=1e-10, atol=1e-15)
    many = equilibrium(robot, np.zeros(robot.n), np.ones(6), np.multiply.outer([0.0, 1.0, 2.0], k))
    assert many.shape == (3, robot.n)


@pytest.mark.parametrize("bad", [-1e-9, np.nan, np.inf])
def test_bad_compliances_are_refused(bad):
    """A negative or non-finite compliance, and arrays that do not fit, are errors."""
    with pytest.raises(ValueError, match="finite and not negative"):
        equilibrium(ARM, [0.0], np.ones(6), [bad])
    with pytest.raises(ValueError, match="expected q"):
        equilibrium(ARM, [0.0, 0.0], np.ones(6), [1e-6])
