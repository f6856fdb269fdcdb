"""The Bayesian check against Eq. (13)."""

from pathlib import Path

import numpy as np
import pytest

from edtk.calibration.planned import check_plan_posterior
from edtk.fit.least_squares import SingularPlanError
from edtk.fit.noise import Noise
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")

ACCURACY = 0.02


@pytest.fixture(scope="module")
def checked():
    steps = []
    plan = STUDY.published_plans()["table_4_12"]
    return (
        plan,
        check_plan_posterior(
            STUDY,
            plan,
            np.random.default_rng(STUDY.specification.seed),
            options=SamplingOptions(Demand(ACCURACY), progress=steps.append),
        ),
        steps,
    )


def test_posterior_has_the_covariance_of_eq_13(checked):
    """Each sampled standard deviation is Eq. (13)'s within three Monte-Carlo errors."""
    table = checked[1].table
    assert (np.abs(table["ratio"] - 1) <= 3 * table["ratio_error"]).all()
    assert (table["ratio_error"] < 1.1 * ACCURACY).all()


def test_accuracy_in_the_test_pose(checked):
    """The sampled rho0 is Eq. (20)'s; 95 % of the errors are below one to three times it."""
    pose = checked[1].pose
    assert abs(pose.rho0 - pose.rho0_fit) < 3 * pose.rho0_error < 0.05 * pose.rho0
    assert pose.rho0_fit == pytest.approx(
        STUDY.criterion("rho0").value(STUDY.space.information(checked[0]))
    )
    assert pose.rho0 < pose.error_95 < 3 * pose.rho0
    truth = STUDY.target @ STUDY.compliances
    low, high = pose.displacement_95
    assert ((low < pose.displacement) & (pose.displacement < high)).all()
    assert (np.abs(pose.displacement - truth) < 5 * pose.rho0).all()


def test_columns(checked):
    """One row a parameter, with columns that agree with each other, the study and the plan."""
    plan, check, _ = checked
    table = check.table
    assert table["parameter"].tolist() == ["k2", "k3", "k4", "k5", "k6"]
    np.testing.assert_array_equal(table["reference"], STUDY.compliances)
    cov = np.linalg.inv(STUDY.space.information(plan))
    np.testing.assert_allclose(table["std_eq13"], np.sqrt(cov.diagonal()), rtol=1e-9)
    np.testing.assert_allclose(
        table["ratio"], table["std_posterior"] / table["std_eq13"], rtol=1e-14
    )
    assert check.to_dict()["parameters"][0]["low_95"] == pytest.approx(table["low_95"][0])


def test_posterior_lies_about_the_truth(checked):
    """The posterior's mean is the truth within five standard deviations."""
    table = checked[1].table
    assert (np.abs(table["mean"] - table["reference"]) < 5 * table["std_eq13"]).all()


def test_progress_counts_steps(checked):
    """Progress is the growing number of steps of the chain."""
    steps = checked[2]
    assert steps == sorted(set(steps))
    assert steps[-1] == checked[1].posterior.steps


def test_unknown_noise(checked):
    """With sigma and nu unknown their intervals are told, by name."""
    check = check_plan_posterior(
        STUDY,
        checked[0],
        np.random.default_rng(0),
        noise=Noise(np.inf, None),
        options=SamplingOptions(Demand(0.2, length=20.0)),
    )
    low, high = check.noise_intervals["sigma_ratio"][1:]
    assert 0.3 < low < 0.85 < high < 1.6
    assert set(check.to_dict()["noise"]) == {"sigma_ratio", "nu"}
    assert "nu: " in check.summary()


def test_singular_plan():
    """A plan that leaves parameters open is refused before anything is sampled."""
    plan = STUDY.space.plan(STUDY.published_plans()["table_4_2"].q[:1], np.array([1]))
    with pytest.raises(SingularPlanError, match=r"k\d"):
        check_plan_posterior(STUDY, plan, np.random.default_rng(0))
