"""`edtk compensate`: commands for task poses, what they leave of the error, and mistakes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from edtk.calibration.calibrate import calibrate
from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import BAND, compensate
from edtk.calibration.tasks_in_use import task_findings
from edtk.cli import main
from edtk.design.plan import Plan
from edtk.findings.fitted_data import HowFitted
from edtk.fit.distributions import error_quantiles
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.identify import identify
from edtk.fit.measurements import simulate
from edtk.measure.compliances import Compliances
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import equilibrium
from edtk.measure.expected_error import remaining_error
from edtk.study.study import load_study
from edtk.study.study_model import assumed_joints
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate
from edtk.verbs.identify import compensate as commands

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PATH = ROOT / "studies" / "kr270_milling.toml"
STUDY = load_study(PATH)
ROBOT = STUDY.robot.with_tool(STUDY.specification.test_pose.tool.build())
K = {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}
# Nothing but the noise is uncertain.
SURE = {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0, "rigid_rad_per_Nm": {"q1": 1e-15}}
HEADER = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSES = f"{HEADER}\n0,-56.9,89.3,45.1,76,57.2\n20,-80,60,10,-40,100\n"


def edtk(*args):
    result = CliRunner().invoke(main, ["compensate", *map(str, args)])
    if not isinstance(result.exception, SystemExit | None):
        raise result.exception
    return result


@pytest.fixture
def given(tmp_path):
    """Files of compliances, with the covariance of a published plan, and of two task poses."""
    result = evaluate(STUDY, STUDY.published_plans()["table_4_3"])
    k = tmp_path / "K.json"
    task = tmp_path / "task.csv"
    k.write_text(json.dumps({"k": K, "covariance": result.covariance.tolist()}), encoding="utf-8")
    task.write_text(POSES, encoding="utf-8")
    return k, task, result


@pytest.mark.cell("`compensate`", "springs")
def test_loaded_robot_is_where_the_task_wants_it(given):
    """Commanded as printed, the loaded robot rests in the desired joints; else it misses."""
    k, task, _ = given
    rows = json.loads(edtk(PATH, k, task, "--json").stdout)
    load = STUDY.specification.test_pose.load.build()
    all_k = np.array([0.0, *K.values()])
    desired = np.deg2rad(np.loadtxt(POSES.split("\n")[1:3], delimiter=","))
    for row, q0 in zip(rows, desired, strict=True):
        q = np.array(row["q"])
        np.testing.assert_allclose(q + equilibrium(ROBOT, q, load, all_k), q0, atol=1e-13)
        np.testing.assert_allclose(row["q_deg"], np.rad2deg(q), rtol=1e-12)
        np.testing.assert_allclose(row["desired_q"], q0)
        np.testing.assert_array_equal(row["wrench"], load)
        moved = equilibrium_deflection(ElastostaticModel(ROBOT), q0, load, all_k)
        (first,) = assumed_joints(STUDY, np.array([*K.values()]))
        (task_of,) = STUDY.tasks
        bent = replace(task_of, q=q0, unknown=(0,)).regressor @ [first.std]
        expected = np.hypot(np.linalg.norm(moved), np.linalg.norm(bent))
        assert row["uncompensated"] == pytest.approx(expected, rel=1e-9)


def test_what_remains_in_the_test_pose_is_rho0(given):
    """With a plan's covariance the error by noise in the test pose is its rho0, of the total."""
    k, task, result = given
    row = json.loads(edtk(PATH, k, task, "--json").stdout)[0]
    assert row["remaining_by_noise"] == pytest.approx(result.criteria["rho0"], rel=1e-9)
    total = np.hypot(row["remaining_by_noise"], row["remaining_by_assumed_joints"])
    assert row["remaining_rms"] == pytest.approx(total, rel=1e-9)
    assert 0 < row["remaining_band"][0] < row["remaining_rms"] < row["remaining_band"][1]


def test_the_rotation_that_remains_is_told_where_a_task_has_a_lever(given, tmp_path):
    """With a lever, rho0 is that of position and rotation together; the band is the position's."""
    k, task, result = given
    study = tmp_path / "lever.toml"
    content = STUDY.to_dict()
    content["test_pose"]["lever_mm"] = 500.0
    STUDY.replace(test_pose=content["test_pose"], published=None, uncertainty=SURE).to_toml(study)
    row = json.loads(edtk(study, k, task, "--json").stdout)[0]
    assert row["remaining_rms"] == pytest.approx(result.criteria["rho0"], rel=1e-9)
    rotation = row["remaining_rotation_rms"]
    target = load_study(study).target
    rho0 = np.sqrt(np.trace(target @ result.covariance @ target.T))
    assert np.hypot(row["remaining_rms"], 0.5 * rotation) == pytest.approx(rho0, rel=1e-9)
    out = tmp_path / "out.csv"
    assert "rotation after, rms [deg]" in edtk(study, k, task, "--out", out).stdout
    written = pd.read_csv(out)["remaining_rotation_rms_deg"]
    assert written[0] == pytest.approx(np.rad2deg(rotation), rel=1e-9)


def test_file_has_what_is_printed(given, tmp_path):
    """The CSV holds degrees and millimetres; the file of compliances may have other joints."""
    k, task, _ = given
    out = tmp_path / "new" / "out.csv"
    rows = json.loads(edtk(PATH, k, task, "--json", "--out", out).stdout)
    table = pd.read_csv(out)
    np.testing.assert_allclose(table[HEADER.split(",")], [row["q_deg"] for row in rows], atol=1e-7)
    np.testing.assert_allclose(
        table["uncompensated_mm"], [1e3 * row["uncompensated"] for row in rows], rtol=1e-9
    )
    np.testing.assert_allclose(
        table["remaining_rms_mm"], [1e3 * row["remaining_rms"] for row in rows], rtol=1e-9
    )
    bands = [np.multiply(1e3, row["remaining_band"]) for row in rows]
    np.testing.assert_allclose(table[["remaining_low_mm", "remaining_high_mm"]], bands, rtol=1e-9)
    k.write_text(json.dumps({"q1": 4e-7, **dict(reversed(K.items()))}), encoding="utf-8")
    turned = json.loads(edtk(PATH, k, task, "--json").stdout)
    assert turned[0]["q"][0] != 0
    np.testing.assert_allclose(turned[0]["q"][1:], rows[0]["q"][1:], atol=1e-14)


def test_without_covariance_nothing_is_said_about_the_rest(given):
    """Plain compliances give commands, nulls in JSON and a sentence in the text."""
    k, task, _ = given
    text = edtk(PATH, k, task).stdout
    assert "after, rms [mm]" in text
    assert "the error after counts all that is uncertain" in text
    k.write_text(json.dumps(K), encoding="utf-8")
    assert "what errors of theirs leave is not known" in edtk(PATH, k, task).stdout
    row = json.loads(edtk(PATH, k, task, "--json").stdout)[0]
    assert (row["remaining_rms"], row["remaining_band"]) == (None, None)


def test_wrench_columns_override_the_test_poses_load(given):
    """Wrench columns of the task act, by component, in place of the test pose's."""
    k, task, _ = given
    task.write_text(f"{HEADER},Fz_N,Tx_Nm\n0,-56.9,89.3,45.1,76,57.2,-1000,7\n", encoding="utf-8")
    row = json.loads(edtk(PATH, k, task, "--json").stdout)[0]
    assert row["wrench"] == [0, 280, -1000, 7, 0, 0]


def test_what_identify_writes_is_read(given, tmp_path):
    """With the k.json of `edtk identify` the error in the test pose is rho0 and the bias."""
    _, task, result = given
    plan = STUDY.published_plans()["table_4_3"]
    table = plan.to_frame(STUDY.robot).drop(columns="repeats")
    table[["dx_mm", "dy_mm", "dz_mm"]] = (
        1e3 * STUDY.model.regressor(plan.q, plan.wrench) @ np.array([*K.values()])
    )
    table.to_csv(tmp_path / "measured.csv", index=False)
    args = ["identify", PATH, tmp_path / "measured.csv", "--linear", "--out", tmp_path]
    done = CliRunner().invoke(main, list(map(str, args)), catch_exceptions=False)
    assert done.exit_code == 0, done.stderr
    row = json.loads(edtk(PATH, tmp_path / "k.json", task, "--json").stdout)[0]
    bias = json.loads((tmp_path / "k.json").read_text())["rho0_bias"]
    assert row["linear_model"] == pytest.approx(bias, rel=1e-3)
    assert row["remaining_by_noise"] == pytest.approx(result.criteria["rho0"], rel=1e-4)
    # The total of the report, of the same parts.
    budget = json.loads((tmp_path / "k.json").read_text())["budget_mm"]
    assert row["remaining_rms"] == pytest.approx(1e-3 * budget["total"], rel=1e-4)
    # Of this displacement the budget takes the linear model.
    found = calibrate(STUDY, tmp_path / "measured.csv", HowFitted(linear=True)).budget
    assert row["uncompensated"] == pytest.approx(found.uncompensated, rel=1e-3)
    assert found.uncompensated > 1.01 * np.linalg.norm(STUDY.target @ [*K.values()])


def test_a_fit_of_the_loaded_equilibrium_leaves_nothing_by_a_linear_model(given):
    """Its bias is zero: neither rounding errors nor words tell of one."""
    k, task, _ = given
    content = json.loads(k.read_text(encoding="utf-8"))
    k.write_text(json.dumps(content | {"k_bias": dict.fromkeys(K, 0.0)}), encoding="utf-8")
    assert [row["linear_model"] for row in json.loads(edtk(PATH, k, task, "--json").stdout)] == [
        0,
        0,
    ]
    assert "linear model" not in edtk(PATH, k, task).stdout


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (POSES.replace("q3_deg", "q7_deg"), "unknown column 'q7_deg'"),
        (POSES.replace("q3_deg,", ""), "row 1: 6 cells; expected 5"),
        (POSES.replace("-80", "x"), "row 2, column q2_deg: 'x' is not a finite number"),
        (
            POSES.replace("-80", "80").replace("-56.9", "56.9"),
            "row 1, column q2_deg: the desired value 56.9 is outside the joint's limits -146 .. 0",
        ),
        (f"{HEADER},Fz_N\n20,0,60,10,-40,100,180\n", "row 1, column q2_deg: the commanded value"),
        (
            f"{HEADER},Fz_N\n0,-90,0,0,0,0,-5e6\n",
            "row 1: the load buckles the arm",
        ),
    ],
)
def test_task_mistakes(given, tmp_path, rows, message):
    """A task that cannot be read or commanded is answered with one line, and nothing is written."""
    k, task, _ = given
    task.write_text(rows, encoding="utf-8")
    result = edtk(PATH, k, task, "--out", tmp_path / "out.csv")
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out.csv").exists()


def test_rows_without_a_command_are_left_out(given, tmp_path):
    """Rows out of limits or that buckle are said, with exit code 1; the others are unchanged."""
    k, task, _ = given
    rows = POSES.split()[1:]
    whole = f"{HEADER},Fz_N\n{rows[0]},-180\n{rows[1]},-180\n"
    mixed = (
        f"{HEADER},Fz_N\n0,80,0,0,0,0,-180\n{rows[0]},-180\n0,-90,0,0,0,0,-5e6\n"
        f"20,0,60,10,-40,100,180\n{rows[1]},-180\n0,-90,0,0,0,200,-5e6\n"
    )
    task.write_text(whole, encoding="utf-8")
    expected = json.loads(edtk(PATH, k, task, "--json").stdout)
    task.write_text(mixed, encoding="utf-8")
    out = tmp_path / "out.csv"
    result = edtk(PATH, k, task, "--json", "--out", out)
    assert result.exit_code == 1
    for word in ("4 rows left out", "row 1, column q2_deg: the desired", "row 3: the load buckles"):
        assert word in result.stderr
    answered = json.loads(result.stdout)
    assert [row.pop("row") for row in answered] == [2, 5]
    assert [row.pop("row") for row in expected] == [1, 2]
    for one, other in zip(answered, expected, strict=True):
        assert one.keys() == other.keys()
        for key in ("q", "desired_q", "wrench", "uncompensated", "remaining_rms"):
            np.testing.assert_allclose(one[key], other[key], rtol=1e-12, atol=1e-15)
    assert pd.read_csv(out)["row"].tolist() == [2, 5]
    text = edtk(PATH, k, task).stdout
    assert [line.split()[0] for line in text.splitlines()[1:3]] == ["2", "5"]
    assert "4 rows left out" in text


@pytest.mark.cell("`compensate` and `predict` name radians, and loads in kilonewtons", "springs")
@pytest.mark.parametrize(
    ("factor", "poses", "load", "words"),
    [
        (1.0, 1.0, 1.0, None),
        (1e3, 1.0, 1.0, "the compliances are 1e+03 times those of the study's [simulation]"),
        (1.0, np.pi / 180, 1.0, "all joint angles of the task are within 6.3 degrees of zero"),
        (1.0, 1.0, 1e-3, "the forces of the task are 0.001 times those of the study's test pose"),
    ],
)
def test_another_unit_is_doubted(factor, poses, load, words):
    """Compliances per kN m, poses in radians and loads in kN are said, and sound ones are not."""
    q = poses * np.deg2rad([[0, -56.9, 89.3, 45.1, 76, 57.2], [20, -80, 60, 10, -40, 100]])
    wrench = load * np.tile(STUDY.tasks[0].wrench, (2, 1))
    found = {name: factor * k for name, k in K.items()}
    for chosen in (slice(0, 2), slice(0, 1)):
        plan = Plan(q[chosen], wrench[chosen], np.ones(len(q[chosen]), dtype=int))
        doubts = task_findings(STUDY, found, plan)
        assert len(doubts) == (words is not None)
        assert all(doubt.words.startswith(words) for doubt in doubts)


def test_a_small_pose_as_people_type_it_is_in_degrees():
    """One pose near zero is doubted where its digits are not those of typed degrees."""
    typed, others = [0, -1, 2, 0.5, 1, 3], [0.12, -0.97, 1.559, 0.82, 1.31, 1]
    for pose, doubted in ((typed, False), (others, True)):
        task = Plan(np.deg2rad([pose]), STUDY.tasks[0].wrench[None], np.ones(1, dtype=int))
        assert bool(task_findings(STUDY, K, task)) == doubted


def test_other_mistakes(given, tmp_path):
    """A joint missing in K.json, and a study without a test pose, are named."""
    k, task, _ = given
    k.write_text(json.dumps({"k": {"q2": 3e-7}}), encoding="utf-8")
    assert "k.q3: expected the compliance of joints 'q3', 'q4', 'q5'" in edtk(PATH, k, task).stderr
    text = PATH.read_text(encoding="utf-8").replace('"rho0", ', "").replace(', "rho0"', "")
    bare = tmp_path / "study.toml"
    bare.write_text(text[: text.index("[test_pose]")], encoding="utf-8")
    result = edtk(bare, k, task)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "test_pose: expected a table" in result.stderr


def test_the_band_holds_where_sigma_was_estimated():
    """Of 310 calibrations that estimate sigma, 95 % leave errors inside their own bands."""
    A = STUDY.model.regressor(*_plan_3())
    A0 = STUDY.target
    rng = np.random.default_rng(4)
    runs = 310  # of fewer all may be inside
    inside = 0
    for moved in simulate(A, STUDY.compliances, STUDY.sigma, rng, runs):
        fit = identify(
            A, moved, np.tile(STUDY.sigma, (len(A), 1)), STUDY.model.parameters, known=False
        )
        low, high = error_quantiles(A0[None], fit.covariance, BAND, fit.covariance_dof)[0]
        inside += low <= np.linalg.norm(A0 @ (fit.unbounded - STUDY.compliances)) <= high
    assert abs(inside - 0.95 * runs) < 4 * np.sqrt(0.95 * 0.05 * runs)


def test_the_band_contains_the_error_of_the_linear_model(tmp_path):
    """Measured at rest without noise, the linear model's error is what the band expects of it."""
    plan = STUDY.published_plans()["table_4_12"]
    table = pd.DataFrame(np.rad2deg(plan.q), columns=HEADER.split(","))
    k = np.array([0.0, *K.values()])
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * equilibrium_deflection(
        STUDY.model, plan.q, plan.wrench, k
    )
    table["sigma_mm"] = 0.003
    sheet = tmp_path / "sheet.csv"
    table.to_csv(sheet, index=False)
    study = STUDY.replace(uncertainty=SURE)
    fit = calibrate(study, sheet, HowFitted(linear=True))
    names = STUDY.robot.joint_names
    known = Compliances.from_dict(fit.to_dict(), names, tuple(K))
    task = Plan(plan.q, plan.wrench, plan.repeats)
    found = compensate(CalibratedSprings(study, known), task, "task")
    model = ElastostaticModel(ROBOT, STUDY.model.joints)
    errors = remaining_error(model, plan.q, plan.wrench, fit.fit.k, k[1:])
    size = np.linalg.norm(errors, axis=-1)
    np.testing.assert_allclose(found.linear, size, rtol=0.03)
    assert ((found.band[:, 0] < size) & (size < found.band[:, 1])).all()
    without = compensate(CalibratedSprings(study, replace(known, bias=None)), task, "task")
    assert (size > without.band[:, 1]).sum() > 6
    np.testing.assert_allclose(np.hypot(without.remaining, found.linear), found.remaining)


def test_degrees_of_freedom_and_bias_of_the_file_count(given):
    """Few degrees of freedom widen the band, none are refused; the linear model's error is said."""
    k, task, _ = given
    study = k.parent / "sure.toml"
    STUDY.replace(uncertainty=SURE, published=None).to_toml(study)
    content = json.loads(k.read_text(encoding="utf-8"))
    before = json.loads(edtk(study, k, task, "--json").stdout)[0]["remaining_band"]
    k.write_text(json.dumps(content | {"covariance_dof": 4, "rho0_bias": 1e-6}), encoding="utf-8")
    after = json.loads(edtk(study, k, task, "--json").stdout)[0]["remaining_band"]
    assert after[1] > 1.3 * before[1]
    # Where an assumed joint is nearly all of the total, degrees of freedom hardly count above.
    of_joint = json.loads(edtk(PATH, k, task, "--json").stdout)[0]["remaining_band"]
    k.write_text(json.dumps(content), encoding="utf-8")
    sure = json.loads(edtk(PATH, k, task, "--json").stdout)[0]["remaining_band"]
    np.testing.assert_allclose(of_joint[1], sure[1], rtol=1e-3)
    k.write_text(json.dumps(content | {"covariance_dof": 4, "rho0_bias": 1e-6}), encoding="utf-8")
    assert "the linear model left 0.001 mm in the test pose" in edtk(PATH, k, task).stdout
    k.write_text(json.dumps(content | {"covariance_dof": 0}), encoding="utf-8")
    assert edtk(PATH, k, task).exit_code == 2


def test_the_band_begins_at_what_the_noise_alone_leaves(given):
    """What is assumed may be absent on the day: it moves the band's upper end, not its lower."""
    k, task, _ = given
    study = k.parent / "surely.toml"
    STUDY.replace(uncertainty=SURE, published=None).to_toml(study)
    sure = json.loads(edtk(study, k, task, "--json").stdout)[0]["remaining_band"]
    assumed = json.loads(edtk(PATH, k, task, "--json").stdout)[0]["remaining_band"]
    assert assumed[1] > 10 * sure[1]
    assert assumed[0] <= sure[0]


def _plan_3():
    plan = STUDY.published_plans()["table_4_3"]
    return plan.q, plan.wrench


def test_a_joint_without_compliance_is_named(given):
    """The load turns joint 1, which has no compliance: what is assumed of it stands beside it."""
    k, task, _ = given
    line = edtk(PATH, k, task).stdout.splitlines()[-1]
    assert "mm by q1, which counts as rigid: 3e-07 rad/(N m) assumed, as q2, the nearest" in line
    desired = np.deg2rad(np.loadtxt(POSES.split("\n")[1:3], delimiter=","))
    load = STUDY.specification.test_pose.load.build()
    bent = np.r_[3e-7, np.zeros(5)]
    moved = equilibrium_deflection(ElastostaticModel(ROBOT), desired, load, bent)
    said = float(line.split(" mm by")[0])
    assert said == pytest.approx(1e3 * np.linalg.norm(moved, axis=1).max(), rel=0.1)
    k.write_text(json.dumps(K), encoding="utf-8")
    bare = edtk(PATH, k, task).stdout.splitlines()[-1]
    assert bare.startswith("without a known compliance, and so taken as rigid: q1 (")
    k.write_text(json.dumps({"q1": 1e-7, **K}), encoding="utf-8")
    assert "rigid" not in edtk(PATH, k, task).stdout


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("covariance_measured", [[1.0]], "covariance_measured: expected 5 rows of 5 numbers"),
        ("assumed_joints", {"q1": 1}, "assumed_joints: expected a list of objects"),
        ("assumed_joints", [{"joint": "q2"}], "assumed_joints.0.joint: expected a joint"),
        ("assumed_joints", [{"joint": "q1"}], "assumed_joints.0.rad_per_Nm: expected a number"),
    ],
)
def test_mistakes_in_what_a_calibration_assumed(given, key, value, message):
    """A file whose assumptions cannot be read is one line."""
    k, task, _ = given
    content = json.loads(k.read_text(encoding="utf-8"))
    k.write_text(json.dumps(content | {key: value}), encoding="utf-8")
    result = edtk(PATH, k, task)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert message in result.stderr


def test_without_a_file_the_poses_are_those_of_the_study(tmp_path):
    """One test pose or several, with their own loads."""
    pose = STUDY.to_dict()["test_pose"]
    other = pose | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [300, -200, 100]}}
    both = STUDY.replace(test_pose=[pose, other], published=None)
    truth = {"k": STUDY.specification.simulation.compliance_rad_per_Nm}
    k = Compliances.from_dict(truth, STUDY.robot.joint_names, STUDY.specification.joints.unknown)
    found = commands(both, k)
    assert found.wrench[:, :3].tolist() == [pose["load"]["F_N"], [300, -200, 100]]
    np.testing.assert_array_equal(found.desired[0], STUDY.task.q)
    np.testing.assert_array_equal(commands(STUDY, k).command[0], found.command[0])
    # Without wrench columns the load is that of the test poses, if they have one.
    path = tmp_path / "task.csv"
    path.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-60,90,10,45,30\n")
    with pytest.raises(UserError, match="Fx_N"):
        commands(both, k, path)


def test_each_pose_has_its_own_tool_and_payload(tmp_path):
    """Commands and errors are those of each pose alone; a file of other poses needs one tool."""
    pose = STUDY.to_dict()["test_pose"]
    held = {"mass_kg": 100.0, "center_mm": [300, 0, -100]}
    poses = [
        pose,
        pose | {"q_deg": [0, -60, 90, 10, 45, 30], "tool": {"position_mm": [900, 0, 100]}},
        pose | {"q_deg": [10, -60, 80, 10, 45, 30]},
        pose | {"q_deg": [20, -70, 90, 10, 45, 30], "payload": held},
    ]
    several = STUDY.replace(test_pose=poses, published=None)
    truth = {
        "k": STUDY.specification.simulation.compliance_rad_per_Nm,
        "std": dict.fromkeys(STUDY.specification.joints.unknown, 1e-8),
    }
    k = Compliances.from_dict(truth, STUDY.robot.joint_names, STUDY.specification.joints.unknown)
    found = commands(several, k)
    for row, one in enumerate(poses):
        alone = commands(STUDY.replace(test_pose=one), k)
        for name in ("desired", "command", "wrench", "uncompensated", "remaining", "band"):
            np.testing.assert_array_equal(getattr(found, name)[row], getattr(alone, name)[0])
    assert len(set(np.round(found.uncompensated, 9))) == 4
    assert len(found.to_frame()) == len(found.to_dict()) == 4
    rigid = {joint.name: joint.displacement for joint in found.rigid_joints}
    alone = commands(STUDY.replace(test_pose=poses[3]), k)
    assert rigid["q1"] >= alone.rigid_joints[0].displacement
    path = tmp_path / "task.csv"
    path.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-60,90,10,45,30\n")
    with pytest.raises(UserError, match="test_pose: the test poses have different tools"):
        commands(several, k, path)
    assert found.rows.tolist() == [0, 1, 2, 3]
    at_limit = [poses[1] | {"q_deg": [0, -60, 90, 10, sign * 125, 30]} for sign in (-1, 1)]
    part = commands(several.replace(test_pose=[*poses[:3], *at_limit]), k)
    refused = [row.row for row in part.refused]
    assert set(refused) & {3, 4}
    assert all(row.text.endswith("the joint's limits -125 .. 125") for row in part.refused)
    assert part.rows.tolist() == [row for row in range(5) if row not in refused]
    np.testing.assert_array_equal(part.command[:3], found.command[:3])
