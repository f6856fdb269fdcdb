"""Apportionment: exact properties and a textbook example."""

import doctest
from importlib import import_module
from itertools import product

import numpy as np
import pytest

from edtk.design.exact.apportion import apportion
from edtk.system.errors import ArgumentError

cases = pytest.mark.parametrize("seed", range(20))


def draw(seed):
    rng = np.random.default_rng(seed)
    w = rng.dirichlet(np.full(rng.integers(1, 9), 0.7))
    w[w < 1e-3] = 0.0
    return w / w.sum()


@cases
def test_sums_to_m_on_the_support(seed):
    """The counts sum to m, none is negative, and points without weight get nothing."""
    w = draw(seed)
    for m in range(1, 40):
        n = apportion(w, m)
        assert n.sum() == m
        assert (n >= 0).all()
        assert not n[w == 0].any()


def test_adams_example():
    """Rounding up is Adams' method: the five-state example of Balinski and Young with 26 seats."""
    assert apportion([9061, 7179, 5259, 3319, 1182], 26).tolist() == [9, 7, 5, 3, 2]


@cases
def test_multiplier(seed):
    """One multiplier v has n_i - 1 <= v w_i <= n_i for all i (Pukelsheim and Rieder)."""
    w = draw(seed)
    w = w[w > 0]
    for m in range(len(w), 40):
        n = apportion(w, m)
        assert ((n - 1) / w).max() <= (n / w).min() * (1 + 1e-12)


@cases
def test_efficiency_bound(seed):
    """The least n_i/(m w_i), which bounds every criterion's efficiency, is at least 1 - l/m."""
    w = draw(seed)
    w = w[w > 0]
    for m in range(len(w), 60):
        assert (apportion(w, m) / (m * w)).min() >= 1 - len(w) / m - 1e-12


@pytest.mark.parametrize("m", [3, 5, 8])
def test_no_other_counts_are_more_efficient(m):
    """Among all whole numbers that sum to m none has a larger min n_i/w_i."""
    w = np.array([0.52, 0.31, 0.17])
    every = [c for c in product(range(m + 1), repeat=3) if sum(c) == m]
    assert (apportion(w, m) / w).min() == max((np.array(c) / w).min() for c in every)


def test_exact_quotas_are_kept():
    """Weights that are multiples of 1/m give just those counts."""
    assert apportion(np.array([1, 0, 3, 2]) / 6, 6).tolist() == [1, 0, 3, 2]


def test_fewer_experiments_than_support():
    """With m below the support the m largest weights get one each; ties go to the first."""
    assert apportion([0.1, 0.3, 0.25, 0.35], 2).tolist() == [0, 1, 0, 1]
    assert apportion([0.25, 0.25, 0.25, 0.25], 3).tolist() == [1, 1, 1, 0]


@pytest.mark.parametrize(
    ("weights", "m"),
    [([0.5, 0.5], 0), ([0.5, -0.5], 2), ([0.0, 0.0], 2), ([np.nan, 1.0], 2), ([[1.0]], 2), ([], 1)],
)
def test_bad_input(weights, m):
    """Weights or numbers of the wrong kind are rejected."""
    with pytest.raises(ArgumentError, match=r"^(weights|m)( 0)?: expected [^\n]*$"):
        apportion(weights, m)


def test_example():
    """The example in the docstring runs and prints what it says."""
    result = doctest.testmod(import_module("edtk.design.exact.apportion"))
    assert result.attempted > 0
    assert result.failed == 0
