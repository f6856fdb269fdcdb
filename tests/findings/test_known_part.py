"""Compliances that are known bend the robot, and are not identified."""

import numpy as np
import pytest
from arm import arm

from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import compensate
from edtk.calibration.planned import plan_bias
from edtk.design.plan import Plan
from edtk.findings.fitted_data import FittedData
from edtk.findings.nonlinear_part import nonlinear_part
from edtk.findings.readings import explanation
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.measurements import Measurements
from edtk.measure.compliances import Compliances
from edtk.study.study import load_study
from edtk.study.study_model import assumed_joints
from edtk.system.errors import UserError

K = np.array([3e-6, 5e-6])
TEST_POSE = {"q_deg": [10, 40], "tool": {"position_mm": [400, 0, 0]}, "load": {"F_N": [0, 0, -50]}}
BOTH = arm(test_pose=TEST_POSE)
KNOWN = arm(
    joints={"unknown": ["q2"], "known_rad_per_Nm": {"q1": K[0]}},
    test_pose=TEST_POSE,
    simulation={"compliance_rad_per_Nm": {"q2": K[1]}},
)
RIGID = KNOWN.replace(joints={"unknown": ["q2"]})
Q = np.array([[0.1, 0.5], [0.9, -0.6], [-1.2, 1.0], [0.4, 1.5]])
WRENCH = np.tile([0, 0, -100.0, 0, 0, 0], (4, 1))
PLAN = Plan(Q, WRENCH, np.ones(4, dtype=int))


def measured(deflection, marker=0.0):
    """Measurements without noise."""
    return Measurements(Q, WRENCH, deflection, np.full((4, 3), 1e-4), np.full((4, 3), marker))


@pytest.mark.parametrize("marker", [0.0, 0.05])
def test_the_fit_finds_the_others(marker):
    """A linear robot of two compliances gives back the unknown one; as rigid, q1 would spoil it."""
    empty = measured(np.zeros((4, 3)), marker)
    data = measured(empty.regressor(BOTH.model) @ K, marker)
    assert FittedData.of(KNOWN, data).fit.k == pytest.approx(K[1:], rel=1e-12)
    assert abs(FittedData.of(RIGID, data).fit.k[0] / K[1] - 1) > 0.1
    assert FittedData.of(KNOWN, data).unexplained == pytest.approx(
        empty.regressor(KNOWN.model) @ K[1:], abs=1e-18
    )


def test_the_equilibrium_bends_them_too():
    """Measurements at rest, less linear model and nonlinear part, leave nothing."""
    at_rest = equilibrium_deflection(BOTH.model, Q, WRENCH, K)
    data = measured(at_rest)
    fitted = FittedData.of(KNOWN, data)
    left = fitted.unexplained - fitted.A @ K[1:] - nonlinear_part(KNOWN, data, K[1:])
    assert np.abs(left).max() < 1e-15
    assert explanation(KNOWN, measured(at_rest), fitted.fit) is None


def test_the_bias_of_a_plan_is_that_of_the_linear_model_alone():
    """Simulated measurements contain the known joint: only what is nonlinear remains of it."""
    known = plan_bias(KNOWN, PLAN, "plan")
    assert abs(known.bias.percent[0]) < 0.1
    other = KNOWN.replace(simulation={"compliance_rad_per_Nm": {"q1": 2 * K[0], "q2": K[1]}})
    assert abs(plan_bias(other, PLAN, "plan").bias.percent[0]) > 10


def test_compensation_counts_them():
    """Commands and bands are those of a file with both compliances, one without any error."""
    task = Plan(KNOWN.task.q[None], KNOWN.task.wrench[None], np.ones(1, dtype=int))
    one = Compliances(("q2",), K[1:], K[1:], np.array([[1e-14]]))
    two = Compliances(("q2", "q1"), K[::-1], K[::-1], np.diag([1e-14, (0.3 * K[0]) ** 2]))
    found = compensate(CalibratedSprings(KNOWN, one), task, "task")
    expected = compensate(CalibratedSprings(RIGID, two), task, "task")
    for name in ("command", "uncompensated", "remaining"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-12)
    # A band begins at what the noise alone leaves, which is more of two that were measured.
    np.testing.assert_allclose(found.band[:, 1], expected.band[:, 1], rtol=1e-12)
    assert (found.band[:, 0] <= expected.band[:, 0]).all()
    assert found.rigid == ""
    assert "q1" in compensate(CalibratedSprings(RIGID, one), task, "task").rigid


def test_a_file_that_has_the_joint_too_is_believed():
    """A later calibration counts more than the study."""
    two = Compliances(("q2", "q1"), K, K, None)
    (known,) = assumed_joints(KNOWN)
    assert two.including([known]).joints == ("q2", "q1")
    np.testing.assert_array_equal(two.including([known]).k, K)


def test_design_and_round_trip(tmp_path):
    """The regressor is that of the unknown joints alone, and the key survives a file."""
    A, expected = (study.model.regressor(Q, WRENCH) for study in (KNOWN, RIGID))
    np.testing.assert_array_equal(A, expected)
    KNOWN.to_toml(tmp_path / "study.toml")
    read = load_study(tmp_path / "study.toml")
    assert read.known == {0: K[0]}
    assert read.to_dict() == KNOWN.to_dict()


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({"q9": 1e-7}, "joints.known_rad_per_Nm: no joint 'q9'; this robot has q1, q2"),
        ({"q2": 1e-7}, "joints.known_rad_per_Nm.q2: the joint is among joints.unknown too"),
        ({"q1": 0}, "joints.known_rad_per_Nm.q1: expected at least 1e-15 (got 0)"),
        ({"q1": -1e-7}, "joints.known_rad_per_Nm.q1: expected at least 1e-15 (got -1e-07)"),
        ({"q1": 1e9}, "joints.known_rad_per_Nm.q1: expected at most 1000"),
        ({"q1": "soft"}, "joints.known_rad_per_Nm.q1: Input should be a valid number"),
        ([1e-7], "joints.known_rad_per_Nm: Input should be a valid dictionary"),
    ],
)
def test_wrong_ones_are_one_line(known, expected):
    """The line names the key and the joint."""
    with pytest.raises(UserError) as caught:
        arm(joints={"unknown": ["q2"], "known_rad_per_Nm": known})
    assert str(caught.value).startswith(f"Study: {expected}")
