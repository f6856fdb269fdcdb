"""The share of the likelihood that a fault's sizes have is an integral over them."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammaln
from scipy.stats import multivariate_normal, special_ortho_group

from edtk.findings.causes.evidence import FREEDOM, likely_size, rarity


def student(x, width):
    """Density of Student's distribution of a width."""
    peak = gammaln((FREEDOM + 1) / 2) - gammaln(FREEDOM / 2) - np.log(FREEDOM * np.pi) / 2
    return np.exp(peak) / width * (1 + (x / width) ** 2 / FREEDOM) ** (-(FREEDOM + 1) / 2)


@pytest.mark.parametrize("size", [0.0, 0.5, 2.0, 8.0])
@pytest.mark.parametrize("std", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("only_positive", [False, True])
def test_is_the_mean_of_the_likelihood(size, std, only_positive):
    """With one parameter it is the integral over Student's distribution, on its side."""

    def weighed(x):
        return np.exp(-(((x - size) / std) ** 2) / 2) * student(x, 1.0) * (1 + only_positive)

    lower = 0.0 if only_positive else -60.0
    mean, _ = quad(weighed, lower, 60.0, points=[0.0, size], limit=200)
    found = rarity(np.array([size]), np.array([[std**2]]), 1.0, only_positive)
    # A mixture of few normal distributions stands for Student's, within a tenth of its density.
    assert found == pytest.approx(-2 * np.log(mean), abs=0.2)


def test_only_the_length_counts_and_units_do_not():
    """Turned axes and other units change nothing."""
    rng = np.random.default_rng(0)
    c = rng.standard_normal(3)
    root = rng.standard_normal((3, 3))
    covariance = root @ root.T
    turn = special_ortho_group.rvs(3, random_state=1)
    expected = rarity(c, covariance, 2.0)
    assert rarity(turn @ c, turn @ covariance @ turn.T, 2.0) == pytest.approx(expected)
    assert rarity(1e-3 * c, 1e-6 * covariance, 2e-3) == pytest.approx(expected)


def test_a_fault_that_is_not_shown_gains_nothing():
    """Where the usual size is far below the noise, the maximum's gain is taken back."""
    c = np.array([3.0, -1.0])
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]])
    gain = c @ np.linalg.solve(covariance, c)
    assert rarity(c, covariance, 1e-6) == pytest.approx(gain, rel=1e-6)


def test_a_direction_that_is_hardly_shown_does_not_count():
    """Its estimate is far off by noise alone, and costs less than a unit."""
    shown = rarity(np.array([1.0, 0.0]), np.diag([0.01, 100.0]), 1.0)
    noisy = rarity(np.array([1.0, 8.0]), np.diag([0.01, 100.0]), 1.0)
    assert 0 < noisy - shown < 1
    assert multivariate_normal([0, 0], np.diag([1.0, 1.0])).logpdf([1.0, 8.0]) < -30


def test_a_negative_size_of_a_positive_fault():
    """A gear that is loose by less than nothing is a much worse explanation than the same above."""
    for size in (0.5, 1.0, 2.0):
        below = rarity(np.array([-size]), np.array([[0.04]]), 1.0, only_positive=True)
        above = rarity(np.array([size]), np.array([[0.04]]), 1.0, only_positive=True)
        assert below > above + (size / 0.2) ** 2


@pytest.mark.parametrize(("size", "std"), [(0.5, 0.2), (3.0, 1.0), (0.0, 2.0)])
def test_likely_size_is_the_mean_and_variance_of_all(size, std):
    """With one parameter these are integrals over likelihood times Student's distribution."""

    def moment(power):
        return quad(
            lambda x: x**power * np.exp(-(((x - size) / std) ** 2) / 2) * student(x, 1.0),
            -60,
            60,
            points=[0.0, size],
            limit=200,
        )[0]

    mean = moment(1) / moment(0)
    variance = moment(2) / moment(0) - mean**2
    found, covariance = likely_size(np.array([size]), np.array([[std**2]]), 1.0)
    # By the mixture that stands for Student's distribution.
    assert found[0] == pytest.approx(mean, rel=0.03, abs=1e-9)
    assert covariance[0, 0] == pytest.approx(variance, rel=0.1)


def test_what_is_usual_counts_where_measurements_show_nothing():
    """A direction that is hardly shown is as usual, and one that is shown well is as measured."""
    c, covariance = likely_size(np.array([0.9, 20.0]), np.diag([1e-6, 400.0]), 1.0)
    assert c[0] == pytest.approx(0.9, rel=1e-3)
    assert abs(c[1]) < 0.1
    assert covariance[0, 0] == pytest.approx(1e-6, rel=1e-3)
    assert 0.3 < np.sqrt(covariance[1, 1]) < 2


@pytest.mark.parametrize("variance", [0.0, -1e-12, 1e-300])
@pytest.mark.parametrize("only_positive", [False, True])
def test_no_variance_at_all_is_no_fault(variance, only_positive):
    """Rounding may leave a variance of zero or below: the cost is finite, and no warning comes."""
    found = rarity(np.array([0.1]), np.array([[variance]]), 100.0, only_positive)
    assert 500 < found < 1000


def test_many_faults_at_once_are_each_alone():
    """Sizes of many faults have the rarity and the likely size that each of them has."""
    rng = np.random.default_rng(0)
    c, root, usual = rng.normal(size=(4, 2)), rng.normal(size=(4, 2, 2)), np.geomspace(0.1, 10, 4)
    covariance = root @ np.swapaxes(root, 1, 2)
    each = [rarity(*one) for one in zip(c, covariance, usual, strict=True)]
    np.testing.assert_allclose(rarity(c, covariance, usual), each, rtol=1e-12)
    for i, found in enumerate(zip(*likely_size(c, covariance, usual), strict=True)):
        for one, alone in zip(found, likely_size(c[i], covariance[i], usual[i]), strict=True):
            np.testing.assert_allclose(one, alone, rtol=1e-10)
    sizes, variance = np.array([[-0.3], [0.3]]), np.full((2, 1, 1), 0.04)
    mixed = rarity(sizes, variance, 1.0, np.array([True, False]))
    alone = [rarity(sizes[i], variance[i], 1.0, only_positive=i == 0) for i in range(2)]
    np.testing.assert_allclose(mixed, alone, rtol=1e-12)
