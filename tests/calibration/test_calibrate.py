"""A study's compliances from a file of measurements: from the empty sheet to the numbers."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from edtk.calibration.calibrate import calibrate
from edtk.calibration.planned import plan_bias
from edtk.findings.fitted_data import HowFitted
from edtk.fit.measurements import simulate
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.measure.compliances import load_compliances
from edtk.report.calibration_report import calibration_files
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.system.files import write_files
from edtk.verbs.evaluate import evaluate
from edtk.verbs.template import template

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STUDY = load_study(ROOT / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_12"]
D = ["dx_mm", "dy_mm", "dz_mm"]


def filled(study=STUDY, plan=PLAN, seed=0, positions=False, digits=6):
    """The sheet of a plan with simulated readings."""
    table = template(study, plan, positions=positions)
    q = np.deg2rad(table.iloc[:, :6].to_numpy())
    W = table.iloc[:, 6:12].to_numpy(dtype=float)
    A = study.model.regressor(q, W)
    moved = simulate(A, study.compliances, study.sigma, np.random.default_rng(seed))[0]
    mm = (moved[:, :3] * 1e3).round(digits)
    if positions:
        at = study.robot.forward(q)[:, :3, 3] * 1e3
        table[["x0_mm", "y0_mm", "z0_mm"]] = at
        table[["x_mm", "y_mm", "z_mm"]] = at + mm
    else:
        table[D] = mm
    if moved.shape[1] == 6:
        table[["drx_deg", "dry_deg", "drz_deg"]] = np.rad2deg(moved[:, 3:])
    return table


@pytest.fixture
def save(tmp_path):
    def write(table):
        table.to_csv(tmp_path / "measured.csv", index=False)
        return tmp_path / "measured.csv"

    return write


@pytest.mark.parametrize("positions", [False, True])
def test_round_trip(save, positions):
    """From the sheet to the truth, within four standard deviations, without diagnostics."""
    path = save(filled(plan=PLAN.repeated(2), positions=positions))
    found = calibrate(STUDY, path, HowFitted(plan=PLAN, linear=True))
    assert list(found.k.values()) == found.fit.k.tolist()
    assert list(found.std) == list(found.k) == ["q2", "q3", "q4", "q5", "q6"]
    expected = evaluate(STUDY, PLAN.repeated(2))
    np.testing.assert_allclose(found.fit.std, expected.std, rtol=1e-6)
    assert (np.abs(found.fit.k - STUDY.compliances) < 4 * found.fit.std).all()
    assert found.findings == ()
    assert found.to_dict()["rho0"]["value"] == pytest.approx(expected.criteria["rho0"], rel=1e-6)
    assert found.data.pose.max() == 11


def test_rows_of_outliers_stand_first(save):
    """Two readings that are off by ten sigma are named by their rows before the noise is, once."""
    table = filled(plan=PLAN.repeated(2))
    table.loc[3, "dx_mm"] += 0.3
    table.loc[8, "dz_mm"] -= 0.3
    found = calibrate(STUDY, save(table))
    kinds = [one.kind for one in found.findings]
    assert kinds[:2] == ["outliers", "noise_above_sigma"]
    assert found.findings[0].rows == (3, 8)


def test_rotations_too(save, tmp_path):
    """A study that measures poses identifies from rotations as well."""
    text = (ROOT / "studies/kr270_milling.toml").read_text()
    text = text[: text.index("published = [")] + text[text.index("[tool]") :]
    path = tmp_path / "study.toml"
    path.write_text(text.replace('rows = "position"', 'rows = "pose"\nsigma_deg = 0.005'))
    study = load_study(path)
    found = calibrate(study, save(filled(study)))
    assert found.fit.dof == 12 * 6 - 5
    assert (np.abs(found.fit.k - study.compliances) < 4 * found.fit.std).all()
    assert found.findings == ()
    assert set(found.residuals()["coordinate"]) == {*D, "drx_deg", "dry_deg", "drz_deg"}
    table = filled(study)
    table[["drx_deg", "dry_deg", "drz_deg"]] *= np.pi / 180
    assert "radians" in calibrate(study, save(table)).findings[0].words


KEYS = {
    "model_error_mm",
    "covariance_measured",
    "covariance_all",
    "assumed_joints",
    "k",
    "std",
    "correlation",
    "sigma_hat",
    "chi2",
    "dof",
    "p_value",
    "outliers",
    "loo_rms_mm",
    "share_inside_left_out",
    "rho0",
    "negative",
    "covariance_dof",
    "k_unbounded",
    "known",
    "rho0_bias",
    "k_bias",
    "model",
    "budget_mm",
    "lack_of_fit",
    "causes",
    "expected_error",
    "posterior",
    "poses",
    "rank",
    "open",
    "not_told",
    "prediction",
    "verdict",
    "doubts",
    "noise",
    "study_warnings",
    "diagnostics",
}


def test_json_and_files(save, tmp_path):
    """The JSON has the promised keys, the files hold the same, and `edtk compensate` reads them."""
    table = filled()
    table.loc[4, "dz_mm"] += 1
    found = calibrate(STUDY, save(table), HowFitted(sigma_unknown=True, linear=True))
    content = found.to_dict()
    assert set(content) == KEYS
    assert content["doubts"] == [diagnostic["text"] for diagnostic in content["diagnostics"]]
    assert content["diagnostics"][0]["severity"] == "warning"
    assert content["posterior"] is None
    assert content["outliers"] == [5]
    assert content["negative"] == []
    assert content["p_value"] is None
    assert content["sigma_hat"] == pytest.approx(
        0.03e-3 * np.sqrt(content["chi2"] / content["dof"])
    )
    low, high = content["rho0"]["interval95"]
    assert low < content["rho0"]["value"] < high
    write_files(calibration_files(found, tmp_path / "out"))
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "k.json",
        "poses.html",
        "report.html",
        "residuals.csv",
    ]
    assert json.loads((tmp_path / "out/k.json").read_text()) == content
    read = load_compliances(
        tmp_path / "out/k.json", STUDY.robot.joint_names, STUDY.specification.joints.unknown
    )
    np.testing.assert_array_equal(read.k, found.fit.k)
    np.testing.assert_allclose(read.covariance, found.fit.covariance, rtol=1e-9)
    written = pd.read_csv(tmp_path / "out/residuals.csv")
    columns = ["row", "pose", "coordinate", "residual", "leverage", "standardised", "left_out"]
    assert list(written) == columns
    assert len(written) == 36
    predicted = STUDY.model.regressor(found.data.q, found.data.wrench) @ found.fit.k
    measured = table[D].to_numpy().ravel()
    np.testing.assert_allclose(written["residual"], measured - 1e3 * predicted.ravel(), atol=1e-8)
    assert written["standardised"].abs().idxmax() == 4 * 3 + 2
    assert "outliers (1): row 5" in found.summary()


def test_causes_are_looked_for_once(save, monkeypatch):
    """One outlier hides another from the fit; naming it is no reason to look for causes anew."""
    from edtk.findings import fitted_data

    looks = []
    look = fitted_data.find_causes
    monkeypatch.setattr(fitted_data, "find_causes", lambda *of: looks.append(of) or look(*of))
    table = filled()
    table.loc[[1, 4], "dz_mm"] += [0.2, -0.2]
    found = calibrate(STUDY, save(table), HowFitted(linear=True))
    assert found.fit.outliers.tolist() == [1, 4]
    assert len(looks) == 1


def test_without_a_test_pose_there_is_no_rho0(save, tmp_path):
    """A study without a test pose identifies all the same; rho0 is null."""
    text = (ROOT / "studies/kr270_milling.toml").read_text()
    text = text[: text.index("published = [")] + text[text.index("[tool]") :]
    a = text.index("[test_pose]")
    b = text.index("[simulation]")
    path = tmp_path / "study.toml"
    path.write_text((text[:a] + text[b:]).replace('"rho0", ', "").replace(', "rho0"', ""))
    found = calibrate(load_study(path), save(filled()))
    assert found.to_dict()["rho0"] is None
    assert "rho0" not in found.summary()


def test_mistakes_name_the_file(save):
    """A bad cell and measurements of a single pose end in one line that names the file."""
    table = filled()
    table[D] = table[D].astype(object)
    table.loc[2, "dy_mm"] = "?"
    with pytest.raises(UserError, match=r"measured\.csv: row 3, column dy_mm: '\?' is not"):
        calibrate(STUDY, save(table))
    with pytest.raises(
        UserError, match=r"measured\.csv: the plan cannot identify all parameters: k.* along \("
    ):
        calibrate(STUDY, save(filled().iloc[:1]))


def test_many_rows_give_a_narrow_posterior_fast(save):
    """With many rows the sampler is fast, and agrees with Eq. (13)."""
    table = pd.concat([filled(seed=seed) for seed in range(100)])
    found = calibrate(STUDY, save(table)).sampled(
        np.random.default_rng(0), SamplingOptions(Demand(0.2, length=20.0))
    )
    ratio = found.check.table["ratio"]
    error = found.check.table["ratio_error"]
    assert (np.abs(ratio - 1) < 4 * error).all()
    np.testing.assert_allclose(found.check.table["mean"], found.fit.k, atol=0, rtol=3e-3)


def test_posterior_of_measurements(save):
    """The posterior has the fit's deviations, wider where sigma is estimated, and its rho0."""
    path = save(filled())
    for known in (True, False):
        plain = calibrate(STUDY, path, HowFitted(sigma_unknown=not known))
        found = plain.sampled(np.random.default_rng(0), SamplingOptions(Demand(0.2, length=20.0)))
        table = found.check.table
        np.testing.assert_allclose(table["std_fit"], plain.fit.std, rtol=1e-6)
        np.testing.assert_allclose(table["reference"], plain.fit.k, rtol=1e-9)
        slack = 1.0 if known else np.sqrt(plain.fit.dof / (plain.fit.dof - 2))  # Student-t is wider
        assert (np.abs(table["ratio"] / slack - 1) < 5 * table["ratio_error"]).all()
        assert found.check.posterior.noise_names == (() if known else ("sigma_ratio",))
        assert found.check.pose.rho0_fit == pytest.approx(plain.fit.accuracy(STUDY.target)[0])
        content = found.to_dict()["posterior"]
        assert {"parameters", "noise", "test_pose", "steps", "walkers"} < set(content)
        assert json.loads(json.dumps(content)) == content
        assert "posterior" in found.summary()


def test_a_robust_posterior_is_not_spoiled(save):
    """With one gross error Student-t errors of unknown nu leave the truth inside the intervals."""
    table = filled()
    table.loc[4, "dz_mm"] += 1
    found = calibrate(STUDY, save(table), HowFitted(robust=True)).sampled(
        np.random.default_rng(0), SamplingOptions(Demand(0.2, length=20.0))
    )
    assert found.check.posterior.noise_names == ("nu",)
    rows = found.check.table
    truth = STUDY.compliances
    assert (np.abs(rows["mean"] - truth) < 4 * rows["std_posterior"]).all()
    plain = calibrate(STUDY, save(table)).fit
    assert np.abs(plain.k - truth).max() > 2 * np.abs(rows["mean"] - truth).max()


def test_what_the_linear_model_leaves_out(save):
    """The bias in the test pose is that of `edtk bias`, if the robot is the assumed one."""
    table = filled()
    found = calibrate(STUDY, save(table), HowFitted(linear=True))
    expected = plan_bias(STUDY, PLAN, Path("plan.csv")).rho0_bias
    assert found.rho0_bias == pytest.approx(expected, rel=0.05)
    assert found.to_dict()["rho0_bias"] == found.rho0_bias
    assert "the linear model leaves" in found.summary()
    for column in ("marker_x_mm", "marker_y_mm", "marker_z_mm"):
        table[column] = 1e-3
    assert calibrate(STUDY, save(table), HowFitted(linear=True)).rho0_bias == pytest.approx(
        found.rho0_bias, rel=1e-3
    )


def test_what_the_linear_model_leaves_out_beside_what_repetitions_share(save):
    """The bias is of the model, whatever weighs the rows: it hardly depends on their errors."""
    table = filled(plan=PLAN.repeated(3))
    pose = table.groupby(list(table.columns[:6]), sort=False).ngroup().to_numpy()
    shared = np.random.default_rng(3).normal(0, 0.06, (pose.max() + 1, 3))
    table[D] += shared[pose]
    found = calibrate(STUDY, save(table), HowFitted(linear=True))
    assert found.fitted.common_noise
    expected = plan_bias(STUDY, PLAN, Path("plan.csv")).rho0_bias
    assert found.rho0_bias == pytest.approx(expected, rel=0.2)


def test_paths_may_be_strings(save):
    """A study, a plan and measurements are found by a name as by a Path."""
    study = load_study(str(ROOT / "studies" / "kr270_milling.toml"))
    plan = study.load_plan(str(ROOT / "studies" / "plans" / "table_4_12.csv"))
    np.testing.assert_array_equal(plan.q, PLAN.q)
    found = calibrate(study, str(save(filled())))
    np.testing.assert_array_equal(found.fit.k, calibrate(STUDY, save(filled())).fit.k)
