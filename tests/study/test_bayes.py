"""The Bayesian check against Eq. (13)."""

from pathlib import Path

import numpy as np
import pytest

from edtk.inference import SingularPlanError
from edtk.study import load_study
from edtk.study.bayes import bayes_check

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")


@pytest.fixture(scope="module")
def checked():
    steps = []
    plan = STUDY.published_plans()["table_4_12"]
    table = bayes_check(STUDY, plan, np.random.default_rng(STUDY.file.seed), steps.append)
    return plan, table, steps


def test_posterior_has_the_covariance_of_eq_13(checked):
    """For every parameter the sampled standard deviation is Eq. (13)'s within three Monte-Carlo errors."""
    table = checked[1]
    assert (np.abs(table["ratio"] - 1) <= 3 * table["ratio_error"]).all()
    assert (table["ratio_error"] < 0.02).all()


def test_columns(checked):
    """One row a parameter, with columns that agree with each other, the study and the plan."""
    plan, table, _ = checked
    assert table["parameter"].tolist() == ["k2", "k3", "k4", "k5", "k6"]
    np.testing.assert_array_equal(table["true"], STUDY.compliances)
    cov = np.linalg.inv(STUDY.design.information(plan))
    np.testing.assert_allclose(table["std_eq13"], np.sqrt(cov.diagonal()), rtol=1e-9)
    np.testing.assert_allclose(table["ratio"], table["std_posterior"] / table["std_eq13"], rtol=1e-14)


def test_posterior_lies_about_the_truth(checked):
    """The posterior's mean is the truth within five standard deviations of the one simulated calibration."""
    table = checked[1]
    assert (np.abs(table["mean"] - table["true"]) < 5 * table["std_eq13"]).all()


def test_progress_counts_steps(checked):
    """Progress is the growing number of steps of the chain."""
    steps = checked[2]
    assert steps == sorted(set(steps))
    assert steps[-1] * 32 > checked[1]["effective_samples"].max()


def test_singular_plan():
    """A plan that leaves parameters open is refused before anything is sampled."""
    plan = STUDY.design.plan(STUDY.published_plans()["table_4_2"].q[:1], np.array([1]))
    with pytest.raises(SingularPlanError, match=r"k\d"):
        bayes_check(STUDY, plan, np.random.default_rng(0))
