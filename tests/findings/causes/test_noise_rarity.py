"""The share of the likelihood that sizes of noise have is an integral over them."""

import math

import numpy as np
import pytest

from edtk.findings.causes.evidence import USUAL_FACTOR, noise_rarity
from edtk.fit.estimate_noise import Stratum


def part(mean_square, dof):
    """A part of the residuals."""
    return Stratum(mean_square * dof, dof)


def density(log_s):
    """Student's density with four degrees of freedom of the logarithm of a noise."""
    return 3 / 8 / USUAL_FACTOR * (1 + (log_s / USUAL_FACTOR) ** 2 / 4) ** -2.5


def likelihood(one, variance):
    """Likelihood of a variance, over that of the mean square."""
    ratio = one.mean_square / variance
    return np.exp(-one.dof * (ratio - 1 - np.log(ratio)) / 2)


def test_prior_is_a_density():
    """All sizes of noise together are certain."""
    x = np.linspace(-60, 60, 400001)
    assert density(x).sum() * (x[1] - x[0]) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(("mean_square", "dof"), [(1.0, 31), (2.25, 31), (0.5, 3), (4.0, 1)])
def test_noise_of_any_size(mean_square, dof):
    """With one part it is the mean of the likelihood over the sizes of the noise."""
    own = part(mean_square, dof)
    log_s = np.linspace(-10, 20, 300001)
    mean = (density(log_s) * likelihood(own, np.exp(2 * log_s))).sum() * (log_s[1] - log_s[0])
    assert noise_rarity(own) == pytest.approx(-2 * math.log(mean), abs=1e-4)


@pytest.mark.parametrize(
    ("own", "together", "readings"),
    [
        (part(0.7, 27), part(3.0, 4), 3.0),
        (part(1.0, 27), part(1.0, 4), 3.0),
        (part(1.0, 3), part(1.0, 40), 2.0),
        (part(0.5, 72), part(2.0, 31), 3.0),
    ],
)
def test_noise_in_common(own, together, readings):
    """With two parts it is the mean over sizes and over shares of the variance, all alike."""
    log_s = math.log(own.mean_square) / 2 + np.linspace(-5, 5, 1001)
    share = (np.arange(4000) + 0.5) / 4000
    own_variance = np.exp(2 * log_s)[:, None]
    variance = own_variance * (1 + readings * share / (1 - share))
    inner = likelihood(together, variance).mean(axis=1)
    weight = density(log_s) * likelihood(own, own_variance[:, 0]) * inner
    mean = weight.sum() * (log_s[1] - log_s[0])
    found = noise_rarity(own, [(together, readings)])
    assert found == pytest.approx(-2 * math.log(mean), abs=5e-3)


def test_what_few_degrees_of_freedom_leave_open_costs_little():
    """Four degrees of freedom tell little of shared noise; forty do, and so cost more."""
    own = part(1.0, 200)
    alone = noise_rarity(own)
    few = noise_rarity(own, [(part(2.5, 4), 3.0)]) - alone
    many = noise_rarity(own, [(part(2.5, 40), 3.0)]) - alone
    assert 0 < few < many


def test_no_overflow():
    """Noise that is far from stated, or none at all, has a finite cost."""
    for mean_square in (0.0, 1e-12, 1e12):
        for other in (0.0, 1e-12, 1e12):
            cost = noise_rarity(part(mean_square, 30), [(part(other, 10), 3.0)])
            assert math.isfinite(cost)
