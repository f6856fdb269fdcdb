"""Chains of a density that is known, up to the accuracy that is asked for."""

import pickle

import numpy as np
import pytest

from edtk.fit.run_chain import Demand, UnconvergedError, run_chain

START = np.random.default_rng(0).normal(size=(16, 2))


class Normal:
    """Two independent normal parameters about 5 with standard deviation 3, sampled whitened."""

    def log_density(self, x):
        """Logarithm of the density at coordinates (n, 2)."""
        return -0.5 * (x**2).sum(axis=-1)

    def parameters(self, x):
        """Parameters (..., 2) at coordinates (..., 2)."""
        return 5 + 3 * x


@pytest.mark.slow
def test_moments_and_progress():
    """Samples are parameters, not coordinates; progress is reported from block to block."""
    steps = []
    chain = run_chain(Normal(), START, 1, Demand(0.05), progress=steps.append)
    error = 3 * np.sqrt(chain.tau / chain.samples[..., 0].size)
    assert (np.abs(chain.samples.mean(axis=(0, 1)) - 5) < 4.5 * error).all()
    assert chain.samples.std(axis=(0, 1)) == pytest.approx(3, rel=5 * 0.05)
    assert steps[-1] == chain.steps
    assert (np.diff(steps) > 0).all()


@pytest.mark.parametrize("most", [100, 900])
def test_unconverged(most):
    """Too few steps allowed are an error that says their number, not a poor answer."""
    with pytest.raises(UnconvergedError, match=f"{most} steps; allow more") as caught:
        run_chain(Normal(), START, 1, Demand(0.002, most=most))
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
