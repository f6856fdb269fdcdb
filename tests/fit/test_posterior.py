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
    text = "1 compliances, 500 steps of 10 walkers, at least 1000 effective samples, R-hat"
    assert repr(found).startswith(f"<Posterior: {text}")
    assert "k2" in found.summary()
