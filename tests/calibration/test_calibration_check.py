"""The study that checks the sampler, on a few runs."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

PATH = Path(__file__).parents[2] / "studies" / "calibration_check.py"


@pytest.fixture(scope="module")
def check():
    spec = importlib.util.spec_from_file_location("calibration_check", PATH)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def run(check, case, runs):
    study = check.load_study(PATH.parent / "kr270_milling.toml")
    A = check.plan_rows(study, check.PLAN)
    return check.ranks(A, study.sigma, study.compliances, case, list(range(runs)))


def test_ranks(check):
    """Twenty runs where the prior matters pass Kolmogorov's test and cover the truth; noise twice as large fails."""
    found = run(check, 3, 20)
    assert found.ranks.shape == (20, 5)
    for column in found.ranks.T:
        assert stats.kstest((column + 0.5) / (check.DRAWS + 1), "uniform").pvalue > 1e-3
    assert found.covered.mean() > 0.88
    right = check.simulate
    check.simulate = lambda A, k, sigma, rng: right(A, k, 2 * sigma, rng)
    try:
        assert run(check, 3, 20).covered.mean() < 0.88
    finally:
        check.simulate = right


def test_every_case_can_be_run(check):
    """Two runs of each case have a rank for every parameter, those of the noise included."""
    for i, case in enumerate(check.CASES):
        assert run(check, i, 2).ranks.shape == (2, 5 + len(case.noise.names))


def test_verdict(check):
    """A case holds with uniform ranks and 95 % coverage, and not with other ranks, or if one parameter is off."""
    p, covered = np.full(5, 0.3), np.full(5, 0.95)
    assert check.holds(p, covered, 500)[1]
    assert not check.holds(p * [1, 1, 1, 1, 1e-3], covered, 500)[1]
    assert not check.holds(p, covered - 0.03, 500)[1]
    assert not check.holds(p, covered - [0, 0, 0, 0, 0.05], 500)[1]


def test_uniformity(check):
    """Uniform ranks pass, those of a posterior that is too narrow or shifted do not."""
    rng = np.random.default_rng(0)
    assert check.uniformity(rng.integers(0, 100, (500, 1)))[0] > 0.01
    for skewed in (rng.beta(0.6, 0.6, (500, 1)), rng.beta(1.3, 1, (500, 1))):
        assert check.uniformity(np.floor(100 * skewed))[0] < 0.01


def test_least_squares(check):
    """Eq. (13) with the right sigma passes, and with one that is five percent wrong does not."""
    A = np.random.default_rng(0).normal(size=(5, 3, 2))
    rng, k, sigma = np.random.default_rng(1), np.array([1.0, 2.0]), np.full(3, 0.1)
    assert check.least_squares(A, sigma, k, rng, 5000)[1] > 1e-3
    wrong = check.simulate

    def noisier(A, k, sigma, rng, runs):
        return wrong(A, k, 1.05 * sigma, rng, runs)

    check.simulate = noisier
    try:
        assert check.least_squares(A, sigma, k, rng, 5000)[1] < 1e-3
    finally:
        check.simulate = wrong
