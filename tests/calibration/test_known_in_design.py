"""Known compliances with a standard deviation count in plans, and are measured too."""

from dataclasses import replace

import numpy as np
import pytest
from arm import arm

from edtk.calibration.calibrate import calibrate
from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import compensate
from edtk.calibration.planned import SpringDesigns
from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.plan import Plan
from edtk.findings.causes.find_causes import find_causes
from edtk.findings.fitted_data import HowFitted
from edtk.fit.measurements import Measurements, simulate
from edtk.measure.compliances import Compliances
from edtk.measure.expected_error import AssumedJoint
from edtk.study.plan_study import plan_study
from edtk.verbs.evaluate import evaluate

K = np.array([3e-6, 5e-6])  # of q1 and q2
LOADS = {"list_F_N": [[0, 0, -100], [100, 0, 0]]}
TEST_POSE = {"q_deg": [10, 40], "tool": {"position_mm": [400, 0, 0]}, "load": {"F_N": [0, 0, -50]}}


def study(known, **keys):
    """An arm of two joints of which the first is known."""
    return arm(
        joints={"unknown": ["q2"], "known_rad_per_Nm": {"q1": known}},
        simulation={"compliance_rad_per_Nm": {"q2": K[1]}},
        load=LOADS,
        measurement={"sigma_mm": 0.01},
        test_pose=TEST_POSE,
        optimise=["rho0"],
        **keys,
    )


KNOWN = study({"value": K[0], "std": 1e-6})
EXACT = study({"value": K[0], "std": 0.0})


def sheet(asked, plan, k=K, seed=0, sigma=1.0):
    """A sheet of the plan, measured on a robot whose joints have these compliances."""
    rows = np.repeat(np.arange(len(plan.q)), plan.repeats)
    every = replace(asked.model, unknown=(0, 1))
    A = every.regressor(plan.q[rows], plan.wrench[rows])
    table = plan.to_frame(asked.robot).drop(columns="repeats").iloc[rows].reset_index(drop=True)
    moved = simulate(A, k, sigma * asked.sigma, np.random.default_rng(seed))[0]
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved
    return table


def random_plan(asked, count=6):
    """A plan of random poses."""
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.2, 1.2, size=(count, 2))
    wrench = np.zeros((count, 6))
    wrench[::2, 2] = -100.0
    wrench[1::2, 0] = 100.0
    return Plan(q, wrench, np.ones(count, dtype=int))


def test_rho0_of_a_plan_is_that_of_the_fit_of_all_joints():
    """It is the trace with the covariance of all joints beside what is known, and the budget's."""
    plan = random_plan(KNOWN)
    model = replace(KNOWN.model, unknown=(1, 0))
    A = model.regressor(plan.q, plan.wrench).reshape(-1, 2) / KNOWN.sigma[0]
    covariance = np.linalg.inv(A.T @ A + np.diag([0, 1e12]))
    A0 = KNOWN.tasks.with_unknown((1, 0)).target
    expected = float(np.sqrt(np.trace(A0 @ covariance @ A0.T)))
    found = evaluate(KNOWN, plan)
    assert found.criteria["rho0"] == pytest.approx(expected, rel=1e-9)
    assert found.std == pytest.approx([np.sqrt(covariance[0, 0])])
    assert found.criteria["A"] == pytest.approx(covariance[0, 0])
    assert evaluate(EXACT, plan).criteria["rho0"] < 0.9 * expected
    budget = SpringDesigns(KNOWN).error_budget(plan)
    assert np.hypot(budget.noise, budget.known_joints) == pytest.approx(expected, rel=1e-9)


def test_a_plan_measures_what_is_badly_known():
    """A plan that counts it is better for the task than one that takes it as exact, and proved."""
    count = plan_study(KNOWN, 4, "rho0")
    exact = plan_study(EXACT, 4, "rho0")
    worth = evaluate(KNOWN, count.whole).criteria["rho0"]
    assert float(count.cost) == pytest.approx(worth, rel=1e-9)
    assert worth < 0.999 * evaluate(KNOWN, exact.whole).criteria["rho0"]
    assert verify_certificate(certificate(KNOWN, count)).valid
    # Of criteria that cannot be about a part of the parameters a known joint counts as exact.
    plan = random_plan(KNOWN)
    assert evaluate(KNOWN, plan).criteria["O2"] == evaluate(EXACT, plan).criteria["O2"]


@pytest.mark.cell("`[joints] known_rad_per_Nm`", "springs")
def test_the_fit_is_that_of_all_joints():
    """A known value that is off by a factor of two is measured, and said; one that is right not."""
    plan = random_plan(KNOWN, 12).repeated(8)
    wrong = study({"value": K[0] / 2, "std": 0.2 * K[0] / 2})
    found = calibrate(wrong, sheet(wrong, plan), HowFitted(linear=True))
    table = sheet(KNOWN, plan)
    right = calibrate(KNOWN, table, HowFitted(linear=True))
    model = replace(KNOWN.model, unknown=(1, 0))
    A = model.regressor(
        np.deg2rad(table[["q1_deg", "q2_deg"]].to_numpy()),
        table[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]].to_numpy(),
    )
    y = table[["dx_mm", "dy_mm", "dz_mm"]].to_numpy().ravel() / 1e3 / KNOWN.sigma[0]
    X = A.reshape(-1, 2) / KNOWN.sigma[0]
    joint = np.linalg.solve(X.T @ X + np.diag([0, 1e12]), X.T @ y + [0, K[0] * 1e12])
    assert [right.fit.k[0], right.study.known[0]] == pytest.approx(joint, rel=1e-9)
    assert found.study.known[0] == pytest.approx(K[0], rel=0.1)
    kinds = [[one.kind for one in each.findings] for each in (found, right)]
    assert "known_contradicted" in kinds[0]
    assert found.verdict != "good"
    assert "known_contradicted" not in kinds[1]


def test_compensation_takes_what_was_measured():
    """Commands and bands rest on the measured value, and on how well it is known then."""
    plan = random_plan(KNOWN, 12).repeated(8)
    found = calibrate(KNOWN, sheet(KNOWN, plan), HowFitted(linear=True))
    names = KNOWN.robot.joint_names
    read = Compliances.from_dict(found.to_dict(), names, ("q2",))
    task = Plan(KNOWN.task.q[None], KNOWN.task.wrench[None], np.ones(1, dtype=int))
    done = compensate(CalibratedSprings(KNOWN, read), task, "task")
    (one,) = read.assumed
    assert one.joint.compliance == found.study.known[0]
    assert one.joint.std < 0.5e-6
    bend = replace(KNOWN.task.model, unknown=(1, 0)).regressor(task.q, task.wrench)[0]
    taken = np.array([found.fit.k[0], one.joint.compliance])
    assert done.uncompensated[0] == pytest.approx(np.linalg.norm(bend @ taken), rel=1e-2)
    assert done.remaining[0] == pytest.approx(found.budget.total, rel=1e-6)


def test_another_compliance_of_a_joint_is_a_cause():
    """A joint that counts as rigid and bends is named with its size; a good sheet names none."""
    plan = random_plan(KNOWN, 20)
    rigid = AssumedJoint("q1", 0, 0.0, 3e-6, "assumed")
    sheets = []
    for k in (K, np.array([0.0, K[1]])):
        A = replace(KNOWN.model, unknown=(0, 1)).regressor(plan.q, plan.wrench)
        moved = simulate(A, k, KNOWN.sigma, np.random.default_rng(3))[0]
        sigma = np.tile(KNOWN.sigma, (20, 1))
        sheets.append(Measurements(plan.q, plan.wrench, moved, sigma, np.zeros((20, 3))))
    bent, good = (
        find_causes(KNOWN.model, data, data.deflection, assumed=(rigid,)).named for data in sheets
    )
    assert (bent[0].cause, bent[0].joint) == ("compliance", "q1")
    assert abs(bent[0].size - K[0]) < 3 * bent[0].std
    assert good == ()
