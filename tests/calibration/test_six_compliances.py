"""The study of all six compliances: only a horizontal load excites joint 1."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from edtk.cli import main
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

PATH = Path(__file__).parents[2] / "studies" / "kr270_six_compliances.toml"


@pytest.fixture(scope="module")
def plan_study(tmp_path_factory):
    """The study, and the file of a plan of six experiments from a small search."""
    out = tmp_path_factory.mktemp("six") / "plan.csv"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.study.plan_study.STARTS", 32)
        args = ["plan", PATH, "--size", 6, "--workers", 1, "--json", "--out", out]
        result = CliRunner().invoke(main, list(map(str, args)), catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout), out


def test_plan_identifies_all_six(plan_study):
    """The plan is near its bound, applies a horizontal load, and finds each compliance to 4 %."""
    answer, out = plan_study
    assert answer["efficiency"] > 0.9
    study = load_study(PATH)
    plan = study.load_plan(out)
    assert plan.wrench[:, :2].any()
    std = np.sqrt(np.diag(np.linalg.inv(study.space.information(plan))))
    assert (std < 0.04 * study.compliances).all()


def test_six_compliances_come_out_of_simulated_measurements(plan_study):
    """Identified 2000 times from the plan, all six are unbiased and scatter as Eq. (13) says."""
    study = load_study(PATH)
    plan = study.load_plan(plan_study[1])
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    runs = simulate(A, study.compliances, study.sigma, np.random.default_rng(0), runs=2000)
    fit = estimate(A, runs, study.sigma, study.model.parameters)
    std = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.k.mean(axis=0) - study.compliances) < 5 * std / np.sqrt(2000)).all()
    np.testing.assert_allclose(fit.k.std(axis=0), std, rtol=0.1)


def test_vertical_load_leaves_joint_1_open(plan_study, tmp_path):
    """Under the vertical load alone k1 cannot be told, and the message names it alone."""
    study = load_study(PATH)
    plan = study.load_plan(plan_study[1])
    wrench = np.tile([0, 0, -2500.0, 0, 0, 0], (len(plan.q), 1))
    path = tmp_path / "vertical.csv"
    type(plan)(plan.q, wrench, plan.repeats).to_csv(path, study.robot)
    for command in ("evaluate", "bias"):
        result = CliRunner().invoke(main, [command, str(PATH), str(path)])
        assert result.exit_code == 2
        assert "cannot identify all parameters: k1 cannot be told" in result.stderr
