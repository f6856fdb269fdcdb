"""Ranks of simulated truths, on a few runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from edtk import load_study
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand

pytestmark = pytest.mark.slow

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"


@pytest.fixture(scope="module")
def check(script):
    return script("simulation_based_calibration.py")


def run(check, case, runs):
    """The ranks of so many runs of a case."""
    study = load_study(STUDY)
    A = check.plan_rows(study, check.PLAN)
    return check.ranks(A, study.sigma, study.compliances, case, list(range(runs)))


@pytest.mark.cell("simulation-based calibration", "springs")
def test_ranks(check):
    """Ten runs where the prior matters pass Kolmogorov's test, and cover the truth."""
    found = run(check, 3, 10)
    assert found.ranks.shape == (10, 5)
    for column in found.ranks.T:
        assert stats.kstest((column + 0.5) / (check.DRAWS + 1), "uniform").pvalue > 1e-3
    assert found.covered.mean() > 0.88


def test_wrong_noise_is_found(check, monkeypatch):
    """With noise four times as large as assumed, the intervals of five runs do not cover.

    Prior and measurements weigh the same in this case: errors are ``((1 + 4^2)/2)^(1/2)`` times as
    large as told, and 95 % intervals hold half of them. Of noise only twice as large they would
    hold 78 %, which 25 of them hardly tell from 88 %.
    """
    right = check.simulate

    def noisier(A, k, sigma, rng):
        return right(A, k, 4 * sigma, rng)

    monkeypatch.setattr(check, "simulate", noisier)
    assert run(check, 3, 5).covered.mean() < 0.88


@pytest.fixture
def short(check, monkeypatch):
    """Chains that end early, of which nothing is asked but their form."""
    demand = Demand(accuracy=1.0, length=5.0)
    monkeypatch.setattr(check, "OPTIONS", SamplingOptions(demand))


@pytest.mark.cell("simulation-based calibration", "parameters")
@pytest.mark.usefixtures("short")
def test_every_case_can_be_run(check):
    """A run of each case has a rank for every parameter, those of the noise included."""
    for i, case in enumerate(check.CASES):
        assert run(check, i, 1).ranks.shape == (1, 5 + len(case.noise.names))


@pytest.mark.usefixtures("short")
def test_every_case_of_geometry_can_be_run(check):
    """A run has a rank for each parameter that was asked for by name, and for each coordinate."""
    for case in range(len(check.GEOMETRY_CASES)):
        found = check.geometry_ranks(case, [1])
        assert found.ranks.shape == (1, len(check.ranked_names(case)))
    assert check.ranked_names(0)[:4] == ("q2.ry", "q3.ry", "k_q2", "k_q3")


def test_errors_that_a_density_does_not_know_are_found(check, monkeypatch):
    """Where a density believes in a third of the errors, its intervals do not cover."""
    right = check.geometry_posterior

    def surer(density, *given):
        return right(
            replace(density, root=density.root / 3, whitening=3 * density.whitening), *given
        )

    fits = []  # of the same seeds: the second time they are taken from here

    def fitted_once(*given, of=check._fit):
        fits.append(of(*given))
        return fits[-1]

    check.told(1)  # by a fit of its own, which is kept
    monkeypatch.setattr(check, "_fit", fitted_once)
    assert check.geometry_ranks(1, range(4)).covered.mean() > 0.8
    again = iter(fits.copy())
    monkeypatch.setattr(check, "_fit", lambda *given: next(again))
    monkeypatch.setattr(check, "geometry_posterior", surer)
    assert check.geometry_ranks(1, range(4)).covered.mean() < 0.7


def test_uniformity(check):
    """Uniform ranks pass, those of a posterior that is too narrow or shifted do not."""
    rng = np.random.default_rng(0)
    assert check.uniformity(rng.integers(0, 100, (500, 1)))[0] > 0.01
    for skewed in (rng.beta(0.6, 0.6, (500, 1)), rng.beta(1.3, 1, (500, 1))):
        assert check.uniformity(np.floor(100 * skewed))[0] < 0.01
