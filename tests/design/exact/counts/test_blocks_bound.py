"""The relaxation over whole blocks against all blocks, all plans, and published optima."""

from itertools import combinations_with_replacement, product

import numpy as np
import pytest

import criteria
import edtk
from edtk.design.exact.counts import blocks_bound
from edtk.design.exact.counts.blocks_bound import BlockQuadratic
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits

pytestmark = pytest.mark.slow


def treatments(v):
    """Treatments whose differences are the parameters."""
    return np.vstack([np.eye(v - 1), np.zeros((1, v - 1))])[:, None, :]


def every_block(n, size):
    """All blocks (b, k) of n candidates."""
    return np.array(list(combinations_with_replacement(range(n), size)))


def block_values(rows, Z, share, places):
    """``<Z, X'X - a s's>`` of blocks (b, k)."""
    U = rows[places]
    s = U.sum(axis=1)
    told = np.einsum("bkri,bkrj,ij->b", U, U, Z)
    return told - share * np.einsum("bri,brj,ij->b", s, s, Z)


@pytest.mark.parametrize("variance", [0.3, np.inf])
@pytest.mark.parametrize("limited", [False, True])
def test_the_best_block_is_that_of_all_blocks(variance, limited):
    """Branch and bound finds the best block for a multiplier, and proves it, of any candidates."""
    rng = np.random.default_rng(1)
    for n, r, p, size in [(7, 1, 2, 3), (5, 2, 3, 4), (4, 1, 5, 3), (6, 1, 5, 2)]:
        rows = rng.normal(size=(n, r, p))
        F = rng.normal(size=(p, p))
        most = rng.integers(1, 3, size=n) if limited else None
        share = float(Limits(size, F, blocks=(size,), block_variance=variance).shares[0])
        blocks = every_block(n, size)
        if most is not None:
            allowed = [(np.bincount(b, minlength=n) <= most).all() for b in blocks]
            blocks = blocks[allowed]
        values = block_values(rows, F.T @ F, share, blocks)
        quadratic = BlockQuadratic.of(rows, F.T @ F, size, share, most)
        assert quadratic.values(blocks) == pytest.approx(values, rel=1e-9)
        found = quadratic.best(blocks[:1])
        assert found.is_exact
        assert found.value == pytest.approx(values.max(), rel=1e-9)
        assert found.upper >= values.max()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("variance", [0.3, np.inf])
def test_branch_and_bound_alone_finds_the_best_block(seed, variance, monkeypatch):
    """From the second best block, without an exchange: no bound cuts the best one off."""
    monkeypatch.setattr(BlockQuadratic, "improved", lambda self, places: places)
    rng = np.random.default_rng(seed)
    for n, r, p, size in [(7, 1, 2, 3), (5, 2, 3, 4), (4, 1, 5, 3), (6, 1, 5, 2)]:
        rows = rng.normal(size=(n, r, p))
        F = rng.normal(size=(p, p))
        share = float(Limits(size, F, blocks=(size,), block_variance=variance).shares[0])
        blocks = every_block(n, size)
        values = block_values(rows, F.T @ F, share, blocks)
        second = np.where(values < values.max() * (1 - 1e-6), values, -np.inf).argmax()
        found = BlockQuadratic.of(rows, F.T @ F, size, share, None).best(blocks[[second]])
        assert found.is_exact
        assert found.value == pytest.approx(values.max(), rel=1e-9)


def test_without_time_for_a_proof_the_bound_is_above_all_blocks(monkeypatch):
    """Where blocks are too many to be looked at, the best one is bounded from above."""
    monkeypatch.setattr(blocks_bound, "WORK", 50.0)
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(9, 1, 3))
    F = rng.normal(size=(3, 3))
    values = block_values(rows, F.T @ F, 1 / 4, every_block(9, 4))
    found = BlockQuadratic.of(rows, F.T @ F, 4, 1 / 4, None).best(np.zeros((1, 4), dtype=int))
    assert np.isfinite(found.upper)
    assert found.upper > values.max()
    assert found.value == pytest.approx(values.max())
    assert not found.is_exact


@pytest.mark.parametrize(("name", "variance"), [("D", np.inf), ("A", 0.5), ("E", np.inf)])
def test_no_plan_in_blocks_is_better_than_the_bound(name, variance):
    """Of all plans in blocks of two sizes none is below the bound, and the best is found."""
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(5, 1, 2))
    limits = Limits(5, np.zeros((2, 2)), blocks=(2, 3), block_variance=variance)
    pairs = product(every_block(5, 2), every_block(5, 3))
    plans = np.array([np.concatenate(pair) for pair in pairs])
    costs = criteria.create(name).cost(Scatter(rows, limits).information(plans))
    found = edtk.plan(
        edtk.Problem(rows), blocks=(2, 3), criterion=name, block_variance=variance, starts=4
    )
    assert found.basis == "weights of blocks, the best block exactly"
    assert found.lower_bound.cost <= costs.min() * (1 + 1e-12)
    assert found.cost == pytest.approx(costs.min(), rel=1e-9)


@pytest.mark.parametrize(("v", "b", "k"), [(7, 7, 3), (4, 6, 2)])
@pytest.mark.parametrize("name", ["D", "E"])
def test_a_balanced_incomplete_block_design_is_told_to_be_the_best(v, b, k, name):
    """Its efficiency is one: all eigenvalues of contrasts are the same (Kiefer 1958)."""
    contrasts = np.linalg.svd(np.ones((1, v)))[2][1:].T
    problem = edtk.Problem(contrasts[:, None, :])
    found = edtk.plan(problem, blocks=(k,) * b, criterion=name, starts=4)
    assert found.value == pytest.approx(b * (k - 1) / (v - 1), rel=1e-9)
    assert found.efficiency == pytest.approx(1.0, abs=2e-6)


def test_blocks_that_cannot_be_balanced_are_proved_nearly_the_best():
    """Seven blocks of three, six treatments: within two percent, where weights leave 21."""
    found = edtk.plan(edtk.Problem(treatments(6)), blocks=(3,) * 7, starts=8)
    assert 0.98 < found.efficiency < 1.0


def test_all_corners_are_divided_into_blocks():
    """Where each candidate is taken once, who is in which block is drawn, and then swapped."""
    x = np.array(list(product((-1.0, 1.0), repeat=4)))
    found = edtk.plan(edtk.Problem(x[:, None, :]), blocks=(4,) * 4, most=1, starts=4)
    assert found.value == pytest.approx(16.0)
    assert found.efficiency == pytest.approx(1.0, abs=1e-9)
