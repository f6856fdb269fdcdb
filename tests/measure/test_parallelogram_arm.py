"""An arm with a parallelogram against its own mechanics: a closed loop, and energies by scipy."""

import numpy as np
import pytest
from palletiser import MASSES, TOOL, UPPER, at_rest, point, slope
from scipy.optimize import brentq

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest, equilibrium, torque_and_derivative
from edtk.measure.measured_model import Load, MeasuredModel
from edtk.measure.parameters import all_parameters
from edtk.robots.frames import BodyPoint
from edtk.robots.load_robot import load_robot
from edtk.robots.rotations import transform
from edtk.robots.weights import DeadWeights, Loading

ROBOT = load_robot("palletiser").with_tool(transform(TOOL))
K = np.array([8e-7, 9e-7, 1.2e-6, 4e-6])
FORCE = np.array([400.0, -300.0, -2500.0])
Q = np.random.default_rng(3).uniform(
    *np.deg2rad([[-150, -20, 0, -150], [150, 60, 60, 150]]), (6, 4)
)


@pytest.mark.parametrize("q", Q[:3])
def test_a_rod_between_crank_and_forearm_turns_the_joint_so(q):
    """The forearm's angle by the loop that a rod closes is the drive's; the joint has the rest."""

    def leaning(angle):
        return np.array([np.cos(angle), -np.sin(angle)])

    elbow = UPPER * np.array([np.sin(q[1]), np.cos(q[1])])
    crank = -0.3 * leaning(q[2])

    def slack(angle):
        return np.linalg.norm(elbow - 0.3 * leaning(angle) - crank) - UPPER

    forearm = brentq(slack, q[2] - 0.1, q[2] + 0.1, xtol=1e-14)
    np.testing.assert_allclose(forearm, q[2], atol=1e-12)
    x = ROBOT.ties.variables(q)
    np.testing.assert_allclose(x, [q[0], q[1], forearm - q[1], -forearm, q[3]], atol=1e-12)
    np.testing.assert_allclose(ROBOT.forward(q)[:3, 3], point(q), atol=1e-12)
    assert ROBOT.forward(q)[2, 2] == pytest.approx(-1, abs=1e-12)  # the flange stays level


def links():
    """The weights of the links, as a study takes them."""
    centers = tuple(BodyPoint(link.center, j) for j, link in enumerate(ROBOT.links))
    return DeadWeights(tuple(link.mass for link in ROBOT.links), centers, 5)


@pytest.mark.parametrize("weighs", [False, True])
def test_the_arm_rests_where_its_energy_is_least(weighs):
    """Springs of drives, a load and weights: tool points agree to a nanometre."""
    loading = Loading(weights=links() if weighs else None)
    found = equilibrium(ROBOT, Q, np.append(FORCE, np.zeros(3)), K, loading=loading)
    truth = np.array([at_rest(q, K, FORCE, masses=weighs * MASSES) for q in Q])
    there = np.array([point(a) for a in truth])
    np.testing.assert_allclose(ROBOT.forward(Q + found)[:, :3, 3], there, rtol=0, atol=1e-9)
    moved = there - np.array([point(q) for q in Q])
    assert np.linalg.norm(moved, axis=1).min() > 2e-3


def test_differences_of_loaded_and_unloaded_rest_agree():
    """With the weights on before and after, as a sheet of displacements has it."""
    model = ElastostaticModel(ROBOT, own_weights=links())
    rest = Rest.of(model, Q, np.append(FORCE, np.zeros(3)), K)
    found = ROBOT.forward(rest.end)[:, :3, 3] - ROBOT.forward(rest.start)[:, :3, 3]
    truth = [point(at_rest(q, K, FORCE)) - point(at_rest(q, K, np.zeros(3))) for q in Q]
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-9)


def test_rows_are_those_of_the_springs_of_drives():
    """Motion by each drive times its torque: the derivative of position and energy by its angle."""
    A = ElastostaticModel(ROBOT).regressor(Q, np.append(FORCE, np.zeros(3)))
    for q, rows in zip(Q, A, strict=True):
        by_drives = slope(point, q).T
        torque = slope(lambda a: FORCE @ point(a), q)
        np.testing.assert_allclose(rows, by_drives * torque, rtol=1e-7, atol=1e-7)


@pytest.mark.slow
def test_rows_at_rest_are_differences_of_the_least_energy():
    """What instruments read of the bent arm moves with each spring as two rests of the truth do."""
    springs = all_parameters(ROBOT, ("M",), [], ROBOT.joint_names, base=False, tool=False)
    model = MeasuredModel(ROBOT, np.zeros((1, 3)), ("M",), springs)
    wrench = np.tile(np.append(FORCE, np.zeros(3)), (len(Q), 1))
    loading = Loading(weights=links())
    theta = equilibrium(ROBOT, Q, wrench, K, loading=loading)
    torque, H = torque_and_derivative(ROBOT, Q + theta, wrench, loading)
    gives = np.linalg.inv(np.eye(4) - K[:, None] * H)
    found = model.see(K, Q, Load(torque, gives)).jacobian[:, 0]
    for q, rows in zip(Q[:3], found, strict=False):
        for j, k in enumerate(K):
            step = 1e-3 * k * np.eye(4)[j]
            ends = [point(at_rest(q, K + s * step, FORCE)) for s in (-2, -1, 1, 2)]
            # Fourth order: the error of this difference is far below a ten millionth.
            quotient = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * 1e-3 * k)
            np.testing.assert_allclose(
                rows[:, j], quotient, rtol=0, atol=1e-7 * np.abs(found).max()
            )
