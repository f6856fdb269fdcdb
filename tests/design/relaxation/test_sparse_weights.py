"""The same design on fewer candidates."""

import numpy as np
import pytest

from criteria import create
from edtk.design.information import pack
from edtk.design.problem import Problem
from edtk.design.relaxation.incumbent import sparse_weights, told_alike
from edtk.design.relaxation.relax import relax
from edtk.system.time_limit import time_limit


@pytest.mark.parametrize(("p", "k"), [(2, 5), (3, 30), (4, 12), (8, 200)])
def test_few_candidates_have_the_same_information(p, k):
    """At most p(p+1)/2 + 1 weights stay, of the same M."""
    rng = np.random.default_rng(k)
    A = rng.normal(size=(k, 2, p)) * 10.0 ** np.arange(p)
    packed = pack(np.swapaxes(A, 1, 2) @ A)
    weights = rng.dirichlet(np.ones(k))
    found = sparse_weights(packed, weights)
    assert np.count_nonzero(found) <= p * (p + 1) // 2 + 1
    assert (found >= 0).all()
    assert found.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(packed @ found, packed @ weights, rtol=1e-9)


def test_like_candidates_become_one():
    """Of candidates that are all alike hardly any stays; the heaviest is one of them."""
    packed = pack(np.repeat(np.eye(2)[None], 20, axis=0))
    weights = np.arange(1.0, 21.0) / 210
    found = sparse_weights(packed, weights)
    assert np.count_nonzero(found) <= 4
    np.testing.assert_allclose(packed @ found, packed @ weights, rtol=1e-12)


def test_few_weights_stay_as_they_are():
    """A design on few candidates is left alone."""
    weights = np.array([0.25, 0.75])
    assert sparse_weights(np.ones((3, 2)), weights) is weights


@pytest.mark.parametrize("faint", [0.0, 1e-27, 1e-13])
def test_no_more_candidates_than_the_rank_of_the_equations(faint):
    """Parameters in two groups that no candidate links have fewer equations: those of linked pairs.

    Entries between the groups that are nothing but rounding change nothing: with them, the simplex
    method did not end.
    """
    rng = np.random.default_rng(1)
    blocks = np.zeros((300, 10, 10))
    for group in (slice(0, 5), slice(5, 10)):
        A = rng.normal(size=(300, 2, 5))
        blocks[:, group, group] = np.swapaxes(A, 1, 2) @ A
    noise = faint * rng.normal(size=blocks.shape)
    packed = pack(blocks + noise + np.swapaxes(noise, 1, 2))
    weights = rng.dirichlet(np.ones(300))
    found = sparse_weights(packed, weights)
    most = 2 * 15 + 1 if faint < 1e-20 else 56
    assert np.count_nonzero(found) <= most
    np.testing.assert_allclose(packed @ found, packed @ weights, rtol=1e-9, atol=1e-12)


def test_when_the_time_is_over_the_design_stays_the_same():
    """Without time more candidates stay than are needed, of the same M."""
    rng = np.random.default_rng(2)
    packed = pack(np.eye(2) + np.zeros((30, 1, 1))) * rng.uniform(1, 2, 30)
    weights = rng.dirichlet(np.ones(30))
    with time_limit(0.0):
        found = sparse_weights(packed, weights)
    np.testing.assert_allclose(packed @ found, packed @ weights, rtol=1e-12)


@pytest.mark.parametrize("name", ["A", "D", "phi"])
@pytest.mark.parametrize("s", [1, 2])
def test_a_part_of_the_parameters_is_told_alike_by_fewer_candidates(name, s):
    """For s combinations of p parameters s p + 1 candidates do, of the same covariance."""
    rng = np.random.default_rng(s)
    k, p = 60, 6
    A = rng.normal(size=(k, 2, p)) * 10.0 ** np.arange(p)
    blocks = np.swapaxes(A, 1, 2) @ A
    K = rng.normal(size=(p, s)) * 10.0 ** np.arange(p)[:, None]
    arguments = {"q": 2.0} if name == "phi" else {}
    criterion = create(name, interest=K, **arguments)
    weights = rng.dirichlet(np.ones(k))
    _, found = told_alike(criterion, blocks, weights)
    assert np.count_nonzero(found) <= s * p + 1
    assert (found >= 0).all()
    assert found.sum() == pytest.approx(1.0)
    told = [K.T @ np.linalg.solve(np.tensordot(w, blocks, 1), K) for w in (weights, found)]
    np.testing.assert_allclose(told[1], told[0], rtol=1e-7)


def test_one_combination_rests_on_no_more_candidates_than_parameters():
    """Elfving: the slope of a quadratic surface at a point, whose optimal designs are many."""
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, 21)] * 2), axis=-1).reshape(-1, 2)
    u, v = x.T
    rows = np.stack([np.ones(len(x)), u, v, u * v, u**2, v**2], axis=1)
    found = relax(Problem(rows[:, None]), create("c", c=[0, 1, 0, 0.3, 0.4, 0]))
    assert found.cost == pytest.approx(1.5625, rel=1e-6)
    assert found.gap < 1e-6
    assert len(found.support) <= 6
