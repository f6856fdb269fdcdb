"""Keys of a study: each number has a range, so that no square of it overflows or vanishes."""

import json
import traceback

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.design.plan import Plan
from edtk.study.schema import read_specification
from edtk.study.study import Study, load_study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate

NAMES = REQUIRED["joints"]["unknown"]


def with_value(path, value):
    """The study's keys with another value of one of them."""
    content = json.loads(json.dumps(REQUIRED | {"test_pose": TEST_POSE}))
    table = content
    *tables, last = path.split(".")
    for name in tables:
        table = table.setdefault(name, {})
    table[last] = value
    return content


@pytest.mark.parametrize("value", [1e154, -1e300, 1.1e6, float("nan"), float("inf"), 10**400])
@pytest.mark.parametrize(
    "path",
    [
        "measurement.sigma_mm",
        "load.F_N",
        "load.T_Nm",
        "load.F_max_N",
        "tool.position_mm",
        "tool.rpy_deg",
        "test_pose.q_deg",
        "test_pose.load.F_N",
        "test_pose.tool.position_mm",
        "joints.fixed_deg.q1",
        "workspace.height_min_mm",
        "workspace.radius_min_mm",
        "workspace.tilt_max_deg",
        "workspace.plan_resolution_deg",
        "workspace.excluded_within_deg",
        "simulation.compliance_rad_per_Nm.q2",
        "prior.nu",
        "prior.sigma_factor",
        "prior.earlier.mean_rad_per_Nm.q2",
        "starts",
    ],
)
def test_no_number_can_overflow(path, value):
    """A number beyond all robots is one line that names the key; so is one that is not finite."""
    vector = path.endswith(("F_N", "T_Nm", "position_mm", "rpy_deg", "q_deg"))
    given = [0, value, 0] if vector else value
    if path == "prior.sigma_factor" and value == float("inf"):
        return
    if path == "prior.earlier.mean_rad_per_Nm.q2":
        content = with_value("prior.earlier", {"mean_rad_per_Nm": {"q2": value}, "covariance": []})
    else:
        content = with_value(path, given)
    with pytest.raises(UserError) as caught:
        read_specification(content, "study.toml")
    assert caught.value.key.startswith(path)
    assert str(caught.value).startswith(f"study.toml: {path}")
    assert len(str(caught.value)) <= 290


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("workspace.tilt_max_deg", 120, "expected at most 90 (got 120); it is: Largest angle"),
        ("measurement.sigma_mm", 1e-10, "expected at least 1e-09 (got 1e-10); it is: Standard"),
        ("measurement.sigma", 1, "unknown key; known are rows, sigma_mm, sigma_deg"),
        ("workspace.radius_min_mm", 1e-200, "expected at least 1e-12"),
        ("simulation.compliance_rad_per_Nm", {"q2": 1e-200}, "expected at least 1e-15"),
        ("prior.sigma_factor", 1e300, "expected a number from 1 to 1e6, or inf"),
        ("prior.nu", 1e-300, "expected a number from 0.1 to 1e6, 'normal' or 'sampled'"),
        ("candidates", 10**10, "expected at most 1e+09 (got 10000000000)"),
        ("sizes", [10**12], "expected at most 1e+06"),
        ("title", "two\nlines", "expected one line, without control characters"),
        ("robot", 3, "expected a name, a path or a table"),
    ],
)
def test_a_message_says_what_is_expected(path, value, expected):
    """The line has the rule, the value and the meaning of the key with its unit."""
    with pytest.raises(UserError) as caught:
        read_specification(with_value(path, value), "study.toml")
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        ({"F_N": [0, 0, 0]}, "a test pose without load has nothing to compensate"),
        ({"F_N": [0, 0, 0], "T_Nm": [0, 0, 0]}, "a test pose without load has nothing to compens"),
        ({"F_N": [1e-20, 0, 0]}, "the load turns no joint of joints.unknown"),
    ],
)
def test_a_test_pose_has_a_load_that_does_harm(load, expected):
    """Without load rho0 is undefined: every verb says so before it begins."""
    with pytest.raises(UserError, match=rf"^Study: test_pose\.load: {expected}"):
        Study(**REQUIRED, test_pose=TEST_POSE | {"load": load})


def test_a_load_along_the_axes_does_no_harm():
    """A vertical force at a vertical axis is a load, but turns nothing."""
    joints = {"unknown": ["q1"]}
    vertical = TEST_POSE | {"load": {"F_N": [0, 0, -500]}}
    with pytest.raises(UserError, match=r"turns no joint of joints\.unknown in the test pose"):
        Study(**REQUIRED | {"joints": joints}, test_pose=vertical)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("sigma_mm", [1e-9, 1e6])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_what_is_allowed_stays_finite(sigma_mm, size):
    """All criteria are finite for the largest and the least numbers that a study may hold."""
    study = Study(
        **REQUIRED
        | {
            "load": {"F_N": [0, 0, -size]},
            "tool": {"position_mm": [size, 0, -size]},
            "measurement": {"sigma_mm": sigma_mm},
        },
        test_pose=TEST_POSE | {"load": {"F_N": [0, size, -size]}},
    )
    rng = np.random.default_rng(1)
    lower, upper = study.robot.limits
    q = lower + rng.random((8, 6)) * (upper - lower)
    plan = Plan(q, np.tile([0.0, 0, -size, 0, 0, 0], (8, 1)), np.ones(8, dtype=int))
    found = evaluate(study, plan)
    numbers = [*found.criteria.values(), *found.std, *found.covariance.ravel()]
    assert np.isfinite(numbers).all()
    assert (np.array(list(found.criteria.values())) > 0).all()


def test_all_missing_keys_are_said_at_once(tmp_path):
    """One run names them all, with a key that is not known, and shows nothing of pydantic."""
    path = tmp_path / "study.toml"
    path.write_text('robot = "kuka_kr270"\nsizes = [4]\nmesure = 3\n[joints]\n', encoding="utf-8")
    with pytest.raises(UserError) as error:
        load_study(path)
    assert str(error.value) == (
        f"{path}: these keys are required: tool, load, measurement, joints.unknown; there is no "
        "key mesure"
    )
    shown = "".join(traceback.format_exception(error.value))
    assert "pydantic" not in shown


def test_a_slip_in_the_name_of_a_table_is_told_beside_the_key_that_it_leaves_out(tmp_path):
    """A study with [parameters] needs no [joints]; one with [parameter] is asked for them."""
    path = tmp_path / "study.toml"
    text = 'robot = "kuka_kr270"\n[parameter]\n[measurement]\nsigma_mm = 0.1\n'
    path.write_text(f"{text}[tool]\nposition_mm = [0, 0, 0]\n[load]\nF_N = [0, 0, -1]\n")
    with pytest.raises(
        UserError, match=r"joints: this key is required.*; there is no key parameter$"
    ):
        load_study(path)
