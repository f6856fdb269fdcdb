"""Diagnostics of chains, on processes whose autocorrelation is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from edtk.fit.run_chain import autocorrelation_time, split_r_hat, std_error


def autoregressive(phi, steps=4000, walkers=32, seed=0):
    """Stationary ``x_t = phi x_{t-1} + noise`` of unit variance (steps, walkers, 1)."""
    z = np.random.default_rng(seed).standard_normal((steps, walkers))
    z[1:] *= np.sqrt(1 - phi**2)
    return lfilter([1.0], [1.0, -phi], z, axis=0)[..., None]


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_autocorrelation_time(phi):
    """An autoregressive process has the time (1 + phi)/(1 - phi), found within a tenth."""
    assert autocorrelation_time(autoregressive(phi)) == pytest.approx(
        (1 + phi) / (1 - phi), rel=0.1
    )


def test_error_of_standard_deviations():
    """Deviations of many chains scatter by the error that one chain tells, within a quarter."""
    chains = [autoregressive(0.8, 1000, 8, seed) for seed in range(100)]
    told = np.mean([std_error(x) for x in chains])
    assert np.std([x.std() for x in chains]) == pytest.approx(told, rel=0.25)


def test_split_r_hat():
    """Parts that agree are near one; chains that drift, differ by walker or stand still are not."""
    x = autoregressive(0.5)
    assert abs(split_r_hat(x)[0] - 1) < 2e-3
    assert split_r_hat(x + np.linspace(0, 1, len(x))[:, None, None])[0] > 1.01
    assert split_r_hat(x + np.repeat([0.0, 0.5], 16)[:, None])[0] > 1.01
    assert np.isinf(split_r_hat(np.ones_like(x))).all()
    assert np.isinf(autocorrelation_time(np.ones_like(x))).all()
