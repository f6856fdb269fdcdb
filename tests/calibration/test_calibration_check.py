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
    """Twenty runs where the prior matters pass Kolmogorov's test, and cover the truth."""
    found = run(check, 3, 20)
    assert found.ranks.shape == (20, 5)
    for column in found.ranks.T:
        assert stats.kstest((column + 0.5) / (check.DRAWS + 1), "uniform").pvalue > 1e-3
    assert found.covered.mean() > 0.88


def test_wrong_noise_is_found(check, monkeypatch):
    """With noise twice as large as assumed, the intervals of ten runs do not cover."""
    right = check.simulate

    def noisier(A, k, sigma, rng):
        return right(A, k, 2 * sigma, rng)

    monkeypatch.setattr(check, "simulate", noisier)
    assert run(check, 3, 10).covered.mean() < 0.88


def test_every_case_can_be_run(check):
    """A run of each case has a rank for every parameter, those of the noise included."""
    for i, case in enumerate(check.CASES):
        assert run(check, i, 1).ranks.shape == (1, 5 + len(case.noise.names))


def test_verdict(check):
    """A case holds with uniform ranks and 95 % coverage, and not if one parameter is off."""
    p = np.full(5, 0.3)
    covered = np.full(5, 0.95)
    assert check.verdict_of(p, covered, 500).holds
    assert not check.verdict_of(p * [1, 1, 1, 1, 1e-3], covered, 500).holds
    assert not check.verdict_of(p, covered - 0.03, 500).holds
    assert not check.verdict_of(p, covered - [0, 0, 0, 0, 0.05], 500).holds


def test_uniformity(check):
    """Uniform ranks pass, those of a posterior that is too narrow or shifted do not."""
    rng = np.random.default_rng(0)
    assert check.uniformity(rng.integers(0, 100, (500, 1)))[0] > 0.01
    for skewed in (rng.beta(0.6, 0.6, (500, 1)), rng.beta(1.3, 1, (500, 1))):
        assert check.uniformity(np.floor(100 * skewed))[0] < 0.01


def test_least_squares(check, monkeypatch):
    """Eq. (13) with the right sigma passes, and with one that is five percent wrong does not."""
    A = np.random.default_rng(0).normal(size=(5, 3, 2))
    rng = np.random.default_rng(1)
    k = np.array([1.0, 2.0])
    sigma = np.full(3, 0.1)
    assert check.least_squares(A, sigma, k, rng, 5000)[1] > 1e-3
    right = check.simulate

    def noisier(A, k, sigma, rng, runs):
        return right(A, k, 1.05 * sigma, rng, runs)

    monkeypatch.setattr(check, "simulate", noisier)
    assert check.least_squares(A, sigma, k, rng, 5000)[1] < 1e-3
