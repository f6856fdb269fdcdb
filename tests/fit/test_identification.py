"""What an identification says: intervals, accuracy, a table, a line."""

import numpy as np
import pytest
from simulated_fits import K0, NAMES, STUDY, fits

pytestmark = pytest.mark.slow

ROBUST_RUNS = 400


def test_interval_of_rho0_covers_the_true_one():
    """The 95 % interval of rho0 covers Eq. (20)'s value in 95 % of runs; none for a known sigma."""
    true, interval = fits("table_4_4", 1)[0].accuracy(STUDY.target)
    assert interval == (true, true)
    runs = fits("table_4_4", 1000, known=False)
    intervals = [fit.accuracy(STUDY.target)[1] for fit in runs]
    hits = [low <= true <= high for low, high in intervals]
    assert abs(np.mean(hits) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / len(runs))


@pytest.mark.parametrize(
    ("known", "robust"), [(True, False), (False, False), (True, True), (False, True)]
)
def test_intervals_hold_the_truth(known, robust):
    """The 95 % intervals of the compliances hold the truth in 95 % of runs of a four-pose plan."""
    runs = fits("table_4_4", ROBUST_RUNS, known=known, robust=robust)
    held = np.mean([np.abs(fit.unbounded - K0) <= fit.half_interval for fit in runs])
    assert abs(held - 0.95) < (0.03 if robust else 4 * np.sqrt(0.95 * 0.05 / len(runs) / 3))


@pytest.mark.parametrize("known", [True, False])
def test_interval_of_the_accuracy_if_robust(known):
    """The interval of rho0 of robust fits holds the accuracy of their estimates in 95 % of runs."""
    runs = fits("table_4_4", ROBUST_RUNS, known=known, robust=True)
    errors = [STUDY.target @ (fit.unbounded - K0) for fit in runs]
    true = np.sqrt(np.mean([e @ e for e in errors]))
    intervals = [fit.accuracy(STUDY.target)[1] for fit in runs]
    held = np.mean([low <= true <= high for low, high in intervals])
    assert 0.9 < held < 0.99


def test_degrees_of_freedom_of_the_scale():
    """The scales of least-squares and robust fits scatter as their degrees of freedom say."""
    for robust, runs in ((False, 1000), (True, ROBUST_RUNS)):
        found = fits("table_4_4", runs, known=False, robust=robust)
        squares = np.array([fit.scale**2 for fit in found])
        spread = np.sqrt(2 / found[0].scale_dof)
        assert squares.std() / squares.mean() == pytest.approx(spread, rel=0.25)


def test_shows_itself():
    """The frame has a row a compliance, with an interval about it; the repr is one line."""
    fit = fits("table_4_12", 1)[0]
    table = fit.to_frame()
    assert table["parameter"].tolist() == list(NAMES)
    assert list(table) == ["parameter", "k", "std", "low_95", "high_95"]
    np.testing.assert_array_equal(table["k"], fit.k)
    np.testing.assert_array_equal(table["std"], fit.std)
    np.testing.assert_allclose(table["high_95"] - table["k"], 1.96 * fit.std, rtol=1e-3)
    assert (table["low_95"] >= 0).all()
    assert repr(fit).startswith("<Identification: 5 compliances, standard deviations up to ")
    assert all(name in fit.summary() for name in NAMES)
