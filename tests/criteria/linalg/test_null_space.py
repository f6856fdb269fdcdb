"""The directions that an information matrix leaves open, and their names."""

import numpy as np
import pytest
from matrices import EPS, positive, units, with_spectrum

import criteria
from criteria.linalg.estimable import null_space, open_directions

FOUR = ("k1", "k2", "k3", "k4")
SEEDS = range(40)


def regressor(seed, p=4, rows=12):
    return np.random.default_rng(seed).normal(size=(rows, p))


def names(A, parameters=FOUR):
    return open_directions(A.T @ A, parameters)


def low_rank(seed, p, rank):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(2 * p, rank)) @ rng.normal(size=(rank, p))
    return A.T @ A


@pytest.mark.parametrize("p", [1, 2, 3, 6, 9])
def test_full_rank_leaves_nothing_open(p):
    """A regular matrix has no open direction.

    That holds at condition 1e10 and in units from 1e-7 to 1e4 too.
    """
    rng = np.random.default_rng(p)
    parameters = tuple(f"k{i}" for i in range(p))
    for M in (np.eye(p), positive(rng, p), with_spectrum(rng, np.geomspace(1e-10, 1, p))):
        t = units(rng, p)
        for scaled in (M, np.outer(t, t) * M):
            N, d = null_space(scaled)
            assert N.shape == (p, 0)
            assert open_directions(scaled, parameters) == ()
            np.testing.assert_allclose(d**2, np.diag(scaled), rtol=4 * EPS)


@pytest.mark.parametrize("j", range(4))
def test_a_parameter_without_effect_is_named_alone(j):
    """A column of zeros is one open direction, named after its parameter."""
    for seed in SEEDS:
        A = regressor(seed)
        A[:, j] = 0
        assert names(A) == names(1e-9 * A) == (FOUR[j],)


def test_two_parameters_of_like_effect_are_named_by_their_combination():
    """If k3 has twice the effect of k2, then "k2 - 0.5 k3" is open.

    It is always spelt so, whatever the rounding of the other entries is.
    """
    found = set()
    for seed in SEEDS:
        A = regressor(seed)
        A[:, 2] = 2 * A[:, 1]
        found.add(names(A))
    assert found == {("k2 - 0.5 k3",)}


def test_opposite_effects_add():
    """If k4 has the opposite effect of k1, then "k1 + k4" is open."""
    for seed in SEEDS:
        A = regressor(seed)
        A[:, 3] = -A[:, 0]
        assert names(A) == ("k1 + k4",)


def test_three_parameters_in_one_direction():
    """A parameter whose effect is the sum of two others' leads their combination.

    It has the largest share.
    """
    A = np.linalg.qr(regressor(0))[0]
    A[:, 0] = A[:, 1] + A[:, 2]
    assert names(A) == ("k1 - k2 - k3",)
    A[:, 0] = A[:, 1] - 0.25 * A[:, 2]
    assert names(A) == ("k1 - k2 + 0.25 k3",)


def test_two_open_directions_are_told_apart():
    """Two open directions are named with few parameters each, not mixed with each other."""
    found = set()
    for seed in SEEDS:
        A = regressor(seed)
        B = regressor(seed, p=5)
        A[:, 3] = 0
        A[:, 2] = 2 * A[:, 1]
        B[:, 1] = B[:, 0]
        B[:, 4] = -2 * B[:, 3]
        found |= {frozenset(names(A)), frozenset(names(B, (*FOUR, "k5")))}
    assert found == {frozenset({"k4", "k2 - 0.5 k3"}), frozenset({"k1 - k2", "k4 + 0.5 k5"})}


def test_names_are_those_that_are_given():
    """Directions are spelt in the caller's own names."""
    A = regressor(0, p=2)
    A[:, 1] = 0
    assert open_directions(A.T @ A, ("elbow", "wrist roll")) == ("wrist roll",)


def test_no_information_leaves_every_parameter_open():
    """Of the zero matrix every parameter is open by itself."""
    assert sorted(open_directions(np.zeros((4, 4)), FOUR)) == list(FOUR)


@pytest.mark.parametrize(("p", "rank"), [(2, 1), (4, 2), (6, 5), (6, 3), (9, 4)])
def test_null_space_is_one(p, rank):
    """As many as p - rank directions are found, and M maps each to zero up to rounding.

    They are solved for from unit vectors of rows of modest condition, hence the factor of 1e3.
    """
    for seed in range(10):
        M = low_rank(seed, p, rank)
        N, d = null_space(M)
        assert N.shape == (p, p - rank)
        assert (
            np.linalg.svd(N, compute_uv=False)[-1] >= 1 - 64 * p * EPS
        )  # an identity is among its rows
        R = M / np.outer(d, d)
        np.testing.assert_allclose(R @ N, 0.0, atol=1e3 * p * EPS * np.abs(N).max())


@pytest.mark.parametrize(("p", "rank"), [(2, 1), (4, 2), (6, 5), (6, 3), (9, 4)])
def test_null_space_is_in_echelon_form(p, rank):
    """Each direction has a parameter of coefficient one that no other direction has."""
    for seed in range(10):
        N, _ = null_space(low_rank(seed, p, rank))
        own = [
            (np.abs(N[:, j] - 1) <= 64 * p * EPS) & (np.delete(N, j, 1) == 0).all(axis=1)
            for j in range(p - rank)
        ]
        assert all(mask.any() for mask in own)


@pytest.mark.parametrize(("p", "rank"), [(2, 1), (4, 2), (6, 5), (6, 3)])
def test_null_space_does_not_depend_on_units(p, rank):
    """With k = t k', t from 1e-7 to 1e4, the open directions are the same.

    In the scaled parameters even the numbers are the same; projectors are compared.
    """

    def projector(N):
        Q = np.linalg.qr(N)[0]
        return Q @ Q.T

    for seed in range(10):
        M = low_rank(seed, p, rank)
        t = units(np.random.default_rng(seed), p)
        N, d = null_space(M)
        scaled, e = null_space(np.outer(t, t) * M)
        np.testing.assert_allclose(e, t * d, rtol=8 * EPS)
        np.testing.assert_allclose(projector(scaled), projector(N), atol=1e4 * p * EPS)


def test_coefficients_are_in_the_units_of_the_parameters():
    """With k2 = 1e-7 k2' the direction "k2 - 0.5 k3" becomes "k2' - 5e-08 k3".

    So names speak of the user's numbers.
    """
    A = regressor(0)
    A[:, 2] = 2 * A[:, 1]
    A[:, 1] *= 1e-7
    assert names(A) == ("k2 - 5e-08 k3",)


@pytest.mark.parametrize("seed", range(10))
def test_open_directions_are_why_a_cost_is_infinite(seed):
    """A matrix has an open direction just where criteria call it singular."""
    rng = np.random.default_rng(seed)
    c = criteria.create("D")
    for p in (2, 4, 6):
        parameters = tuple(f"k{i}" for i in range(p))
        for rank in range(1, p + 1):
            t = units(rng, p)
            M = np.outer(t, t) * low_rank(seed, p, rank)
            assert bool(open_directions(M, parameters)) == np.isinf(c.cost(M)) == (rank < p)
