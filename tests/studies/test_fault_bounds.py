"""What is possible with a plan: likelihood ratios are right, and nothing beats them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from edtk.calibration.planned import planned_measurements
from edtk.design.plan import Plan
from edtk.fit.least_squares import Whitened


@pytest.fixture(scope="module")
def signals(script):
    return script("fault_signals.py")


@pytest.fixture(scope="module")
def study(script):
    return script("fault_robots.py").robots()["UR10, 10 kg"]


Q = np.random.default_rng(0).uniform(-1, 1, (8, 6)) * [0, 1, 1, 1, 1, 1] + [0, -1, 1, 0, 1, 0]
POSES = np.array([0, 0, 2, 3, 4, 5, 6, 7])


@pytest.fixture(scope="module")
def known(signals, study):
    q = Q[POSES]
    return signals.signals_of(study, q, np.unique(q, axis=0, return_inverse=True)[1].ravel())


def test_likelihood_ratios(signals):
    """They are those of normal distributions."""
    rng = np.random.default_rng(0)
    r = rng.standard_normal((5, 4))
    good = multivariate_normal(np.zeros(4)).logpdf(r)
    shifts = rng.standard_normal((3, 4))
    each = [multivariate_normal(shift).logpdf(r) for shift in shifts]
    found = signals.Shifted(shifts).log_ratio(r)
    np.testing.assert_allclose(found, np.log(np.exp(each).mean(axis=0)) - good)
    root = rng.standard_normal((4, 4))
    covariance = root @ root.T + np.eye(4)
    noisier = signals.Noisier(covariance)
    expected = multivariate_normal(np.zeros(4), covariance).logpdf(r) - good
    np.testing.assert_allclose(noisier.log_ratio(r), expected)
    drawn = noisier.draw(rng, 20_000)
    # Each entry of the mean of so many products is within five of its standard errors.
    error = np.sqrt((covariance**2 + np.outer(*2 * [covariance.diagonal()])) / len(drawn))
    assert (np.abs(drawn.T @ drawn / len(drawn) - covariance) < 5 * error).all()


def test_directions_are_even(signals):
    """Unit vectors whose mean is zero and whose covariance is the same in all directions."""
    for dims in (1, 2, 3):
        units = signals.directions(dims)
        np.testing.assert_allclose(np.linalg.norm(units, axis=1), 1)
        np.testing.assert_allclose(units.mean(axis=0), 0, atol=1e-3)
        np.testing.assert_allclose(units.T @ units / len(units), np.eye(dims) / dims, atol=1e-3)


def test_signals_are_what_scenes_leave(script, known, study):
    """A tool that is off leaves residuals as long as its signal, but for the bent arm."""
    scenes = script("scene.py")
    faults = script("faults.py")
    wrench = np.asarray(study.space.load.wrench(np.zeros((len(Q), 0))))[POSES]
    good = scenes.Scene.of(study, Q[POSES], wrench, 1)
    data = planned_measurements(study, Plan(Q[POSES], wrench, np.ones(len(POSES), dtype=int)))
    whitened = Whitened.of(data.regressor(study.model), data.noise, study.model.parameters)
    for make, title in (
        (faults.tool_z, "tool point 10 mm off along z"),
        (faults.backlash_everywhere, "backlash of 0.005 degrees, all joints"),
    ):
        bad = replace(make(good, np.random.default_rng(0)), noise=0.0)
        change = bad.measured(np.random.default_rng(0))
        change = change - replace(good, noise=0.0).measured(np.random.default_rng(0))
        length = np.linalg.norm(whitened.residual(change))
        assert length == pytest.approx(np.linalg.norm(known[title].signals[0]), rel=0.05)


def test_best_test_of_one_signal_is_that_along_it(script, signals, monkeypatch):
    """Its power is the normal one, and the sum of squares has less."""
    possible = script("fault_bounds.py")
    title = "tool point 10 mm off along z"
    one = signals.Shifted(np.array([[3.0, 0, 0, 0, 0, 0, 0, 0]]))
    monkeypatch.setattr(possible, "signals_of", lambda *_: {title: one})
    found = possible.bounds(None, [np.zeros((1, 6))], 0.05, 0)[title]
    # Binomial: four standard errors of 400 are 6 %.
    assert found.detected == pytest.approx(100 * norm.cdf(3 - norm.ppf(0.95)), abs=6)
    assert found.plain < found.detected
    assert found.named == found.named_unknown == 100


def test_every_fault_that_is_not_gross_has_a_bound(script, known):
    """Titles are those of the table."""
    titles = {fault.title: fault.cause for fault in script("faults.py").FAULTS}
    others = {title for title in known if title not in titles}
    assert others == {"tool_x", "tool_y"}
    missing = {titles[title] for title in titles if title not in known}
    assert missing == {"", "load_size", "frame_axes", "unit", "columns", "backlash"}
