"""Fig. 7: simulation and closed forms."""

import numpy as np
import pandas as pd
import pytest

from paper_figures import figure_7, printed_values
from paper_figures.example import load_example
from paper_figures.random_plans import random_plans
from paper_figures.simulated import simulate_errors

# Means for plans 2a to 2e, from a simulation independent of this package [1e-3 mm].
INDEPENDENT = {
    "clipped": [2.145, 2.054, 2.037, 1.990, 1.989],
    "true": [2.951, 2.912, 2.763, 2.818, 2.814],
}


@pytest.fixture(scope="module")
def candidates():
    return random_plans(load_example())


@pytest.fixture(scope="module")
def errors(candidates):
    return simulate_errors(load_example(), candidates.median)


def test_printed_caption_has_six_expectations():
    """The typed caption has one expectation per plan, the first of a random plan."""
    lines = printed_values.figure_7()
    assert [line.line for line in lines] == ["3", "4a", "4b", "4c", "4d", "4e"]
    assert [line.configurations for line in lines] == [None, 2, 3, 4, 6, 12]


def test_simulation_agrees_with_the_closed_forms(errors):
    """Monte-Carlo mean and RMS are the exact ones within three standard errors."""
    assert len(errors) == 12
    for e in errors:
        assert abs(e.mean - e.exact_mean) < 3 * e.mean_error
        assert abs(e.rms - e.rho0) < 3 * e.rms_error


@pytest.mark.parametrize("target", ["clipped", "true"])
def test_exact_means_match_an_independent_simulation(errors, target):
    """The closed-form means of Table 4's plans are independently simulated ones, but for noise."""
    means = [e.exact_mean * 1e6 for e in errors if e.target == target and e.plan != "1"]
    assert means == pytest.approx(INDEPENDENT[target], rel=2.5e-3)


def test_same_seed_same_result(candidates, errors):
    """A second run with the study's seed gives the same plan and the same errors, bit for bit."""
    again = random_plans(load_example())
    assert np.array_equal(again.median.q, candidates.median.q)
    repeated = simulate_errors(load_example(), again.median)
    for one, other in zip(errors, repeated, strict=True):
        np.testing.assert_array_equal(one.distances, other.distances)


def test_random_plan_is_feasible_and_the_median_one(candidates, errors):
    """Plan (1) satisfies every constraint and has the median mean error under the true A0."""
    assert (load_example().space.workspace.slack(candidates.median.q) >= 0).all()
    shown = next(e for e in errors if e.plan == "1" and e.target == "true")
    assert shown.exact_mean == pytest.approx(np.median(candidates.means["true"]), rel=1e-9)


def test_random_plans_average_as_expected(candidates):
    """Over random plans the mean error is about 4.06 (clipped) and 5.35 (true), in 1e-3 mm."""
    for name, expected in (("clipped", 4.06), ("true", 5.35)):
        means = candidates.means[name] * 1e6
        assert abs(means.mean() - expected) < 3 * means.std() / np.sqrt(len(means))


def test_caption_and_numbers(candidates, errors):
    """The table has a row per plan and A0 and the caption says that the random plan is ours."""
    table = figure_7.tabulate(errors)
    assert isinstance(table, pd.DataFrame)
    assert len(table) == 12
    assert "random plan (1) is ours" in figure_7.readable(errors, candidates.means)
