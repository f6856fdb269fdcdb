"""What samples of a posterior say of themselves."""

import numpy as np
import pytest

from edtk.fit.posterior import Posterior

WHITE = np.random.default_rng(0).normal(size=(500, 10, 1))


def posterior(**names):
    """A posterior of white samples."""
    return Posterior(WHITE, np.array([5.0]), 600, np.ones(1), np.empty(0), WHITE[..., :0], **names)


def test_effective_samples():
    """The effective number is samples over tau; white samples' deviation has std/sqrt(2N)."""
    found = posterior()
    assert found.effective == pytest.approx(1000)
    assert found.std_error == pytest.approx(found.std / np.sqrt(2 * 5000), rel=0.1)


def test_shows_itself():
    """The frame has a row a compliance, by name or number; the repr is one line."""
    found = posterior(parameters=("k2",))
    table = found.to_frame()
    assert table["parameter"].tolist() == ["k2"]
    assert posterior().to_frame()["parameter"].tolist() == ["1"]
    np.testing.assert_array_equal(table[["low_95", "high_95"]].to_numpy().T, found.interval())
    assert table["mean"][0] == pytest.approx(0, abs=0.1)
    text = "1 parameters, sampled by emcee: 600 steps of 10 walkers, at least 1000 effective"
    assert repr(found).startswith(f"<Posterior: {text}")
    assert "k2" in found.summary()


def test_weighted_draws():
    """Weights make draws of a wide distribution those of a narrow one, with their errors."""
    rng = np.random.default_rng(1)
    x = 2 * rng.normal(size=(20_000, 1, 1))
    weights = np.exp(-0.5 * x**2 + 0.125 * x**2)[..., 0]
    weights /= weights.sum()
    tau = np.array([len(x) * (weights**2).sum()])
    found = Posterior(x, tau, len(x), np.ones(1), np.empty(0), x[..., :0], weights=weights)
    assert abs(found.std[0] - 1) < 4 * found.std_error[0] < 0.05
    assert found.covariance[0, 0] == pytest.approx(found.std[0] ** 2)
    np.testing.assert_allclose(found.interval()[:, 0], [-1.96, 1.96], atol=0.08)
    assert found.method == "Laplace"
    even = found.evenly()
    assert even.weights is None
    assert even.std == pytest.approx(found.std, rel=5e-3)
    assert even.evenly() is even
