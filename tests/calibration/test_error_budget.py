"""Each part of the error budget is the error that simulation shows."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY
from scipy.spatial.transform import Rotation

from edtk.calibration import propagation as module
from edtk.calibration.propagation import Propagation, Uncertainty
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import AssumedJoint, compensation_accuracy
from edtk.measure.task import Tasks

MODEL = STUDY.model
K = STUDY.compliances
SETS = 500
WRENCH = PLAN.wrench
A = MODEL.regressor(PLAN.q, WRENCH)
DATA = Measurements(
    PLAN.q,
    WRENCH,
    np.zeros((len(WRENCH), 3)),
    np.tile(STUDY.sigma, (len(WRENCH), 1)),
    np.zeros((len(WRENCH), 3)),
)
FIT = Whitened.of(A, DATA.sigma, MODEL.parameters)
# Joint q1 is not turned by a vertical load, and so not seen by the calibration at all.
SURE = Uncertainty(0, 0, 0, 0, 0)


def budget(**uncertain):
    """The parts for one source of uncertainty."""
    sizes = replace(SURE, **uncertain)
    return Propagation.of(MODEL, DATA, K, FIT.covariance, sizes).budget(STUDY.tasks)


def noise(rng):
    """Readings with noise."""
    return A @ K + DATA.sigma * rng.standard_normal(DATA.sigma.shape)


def load(rng):
    """Readings under a load of another size and direction."""
    turn = np.deg2rad(1) * np.array([*rng.standard_normal(2), 0])
    wrench = WRENCH.copy()
    wrench[:, :3] = Rotation.from_rotvec(turn).apply(WRENCH[:, :3])
    return MODEL.regressor(PLAN.q, wrench * (1 + 0.01 * rng.standard_normal())) @ K


def tool(rng):
    """Readings with a tool point elsewhere."""
    where = MODEL.robot.tool.copy()
    where[:3, 3] += where[:3, :3] @ (1e-3 * rng.standard_normal(3))
    other = replace(MODEL, robot=MODEL.robot.with_tool(where))
    return other.regressor(PLAN.q, WRENCH) @ K


def drift(rng):
    """Readings that are all off by the same shift."""
    return A @ K + 5e-5 * rng.standard_normal(3)


def repeatability(rng):
    """Readings that are each off by a shift of their own."""
    return A @ K + 2e-5 * rng.standard_normal(DATA.sigma.shape)


@pytest.mark.parametrize(
    ("simulate", "uncertain"),
    [
        (noise, {}),
        (load, {"load_size": 0.01, "load_direction": np.deg2rad(1)}),
        (tool, {"tool": 1e-3}),
        (drift, {"drift": 5e-5}),
        (repeatability, {"repeatability": 2e-5}),
    ],
)
def test_part_is_what_500_simulated_calibrations_show(simulate, uncertain):
    """The part is the root mean square error in the test pose within 10 %."""
    rng = np.random.default_rng(0)
    k = FIT.solve(np.stack([simulate(rng) for _ in range(SETS)]))
    error = (k - K) @ STUDY.target.T
    simulated = np.sqrt((error**2).sum(axis=1).mean())
    assert budget(**uncertain).parts[simulate.__name__] == pytest.approx(simulated, rel=0.1)


def test_joint_that_counts_as_rigid():
    """A joint that the calibration does not see leaves its whole displacement in the task."""
    alone = ElastostaticModel(STUDY.task.model.robot, (0,))
    moved = alone.regressor(STUDY.task.q, STUDY.task.wrench)[:, 0] * 1e-7
    found = budget(joints=(AssumedJoint("q1", 0, 0.0, 1e-7, "stated"),))
    assert found.rigid_joints == pytest.approx(np.linalg.norm(moved), rel=1e-9)
    assert found.joints[0].error == found.rigid_joints
    assert found.joints[0].told == np.inf  # no vertical load turns it
    assert found.uncompensated > np.linalg.norm(STUDY.target @ K)


def test_total():
    """Squares of the parts add up to the total's, in JSON in millimetres; the largest is named."""
    found = budget(load_size=0.1, drift=5e-5)
    parts = found.to_dict()
    total = parts.pop("total")
    assert total == pytest.approx(np.sqrt(sum(part**2 for part in parts.values())))
    assert list(parts) == [
        "noise",
        "model",
        "load",
        "tool",
        "rigid_joints",
        "known_joints",
        "drift",
        "repeatability",
    ]
    # Compliances that are 10 % off leave 10 % of the displacement.
    assert parts["load"] == pytest.approx(1e2 * found.uncompensated)
    assert found.largest == "load"
    assert "by load" in repr(found)


def test_budget_of_very_many_measurements(monkeypatch):
    """Of many measurements some stand for all: each part stays within a few per cent."""
    rng = np.random.default_rng(4)
    poses = 2000
    q = rng.uniform(-1.5, 0, size=(poses, STUDY.robot.n))
    wrench = np.tile(STUDY.space.load.always, (poses, 1))
    A = STUDY.model.regressor(q, wrench)
    noise = STUDY.sigma * rng.standard_normal(A.shape[:2])
    sigma = np.tile(STUDY.sigma, (poses, 1))
    data = Measurements(q, wrench, A @ STUDY.compliances + noise, sigma, np.zeros((poses, 3)))
    uncertain = STUDY.replace(uncertainty={"drift_mm": 0.05, "repeatability_mm": 0.02})
    fitted = FittedData.of(uncertain, data, HowFitted(linear=True))
    whole = module.calibration_budget(fitted, None).parts
    monkeypatch.setattr(module, "MOST_ROWS", 500)
    some = module.calibration_budget(fitted, None).parts
    assert some["noise"] == whole["noise"]
    for name, part in whole.items():
        assert some[name] == pytest.approx(part, rel=0.15, abs=1e-9), name


def test_each_of_several_poses_has_a_budget_of_its_own():
    """The squares of the poses' totals have the total of all of them as their mean."""
    pose = STUDY.to_dict()["test_pose"]
    poses = [pose, pose | {"q_deg": [0, -60, 90, 10, 45, 30], "weight": 3}]
    tasks = STUDY.replace(test_pose=poses, published=None).tasks
    found = Propagation.of(MODEL, DATA, K, FIT.covariance, Uncertainty())
    each = [found.budget(Tasks([task])).total for task in tasks]
    together = found.budget(tasks).total
    assert together == pytest.approx(np.sqrt((each[0] ** 2 + 3 * each[1] ** 2) / 4), rel=1e-9)


def test_a_known_joint_is_measured_too():
    """With a joint known, estimates and errors are those of a fit of all joints with its prior."""
    std = 0.1 * float(K[0])
    known = AssumedJoint("q2", MODEL.joints[0], float(K[0]), std, "known")
    rest = replace(MODEL, unknown=MODEL.joints[1:])
    fit = Whitened.of(DATA.regressor(rest), DATA.sigma, rest.parameters)
    uncertain = replace(SURE, load_size=0.01, joints=(known,))
    propagation = Propagation.of(rest, DATA, K[1:], fit.covariance, uncertain)
    found = propagation.budget(STUDY.tasks.with_unknown(rest.joints))
    before = PriorRows(np.eye(1, len(K)) / std, K[:1] / std)
    joint = Whitened.of(before.below(A), before.noise_below(DATA.noise, 3), MODEL.parameters)
    error = joint.solve(before.measured_below(1.01 * A @ K)) - K
    assert found.load == pytest.approx(float(np.linalg.norm(STUDY.target @ error)))
    assert found.uncompensated == pytest.approx(float(np.linalg.norm(STUDY.target @ K)))
    accuracy = compensation_accuracy(STUDY.target, joint.covariance)
    assert np.hypot(found.noise, found.known_joints) == pytest.approx(float(accuracy))
    (left,) = propagation.assumed
    assert left.std == pytest.approx(np.sqrt(joint.covariance[0, 0]))
    assert left.std < 0.2 * std  # the measurements tell it
    (shift,) = propagation.errors
    assert -shift.shifts * left.std == pytest.approx(joint.covariance[0, 1:])


def test_a_prior_takes_its_part():
    """With a prior of an estimate, drift moves it as it moves the fit of all rows."""
    prior = PriorRows(np.diag(10 / K), np.full(len(K), 10.0))
    uncertain = replace(SURE, drift=5e-5)
    propagation = Propagation.of(MODEL, DATA, K, FIT.covariance, uncertain, prior=prior)
    found = propagation.budget(STUDY.tasks)
    X = np.concatenate([(A / DATA.sigma[..., None]).reshape(-1, len(K)) * K, 10 * np.eye(len(K))])
    moved = []
    for axis in np.eye(3):
        shift = np.tile(5e-5 * axis / STUDY.sigma, len(A))
        moved.append(K * np.linalg.lstsq(X, np.append(shift, np.zeros(len(K))))[0])
    assert found.drift == pytest.approx(float(np.linalg.norm(STUDY.target @ np.transpose(moved))))
