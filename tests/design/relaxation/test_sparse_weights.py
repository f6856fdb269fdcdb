"""The same design on fewer candidates."""

from importlib import import_module

import numpy as np
import pytest

from edtk.design.packed import pack
from edtk.design.relaxation.sparse_weights import sparse_weights


@pytest.mark.parametrize("few", [0, 60])
@pytest.mark.parametrize(("p", "k"), [(2, 5), (3, 30), (4, 12)])
def test_few_candidates_have_the_same_information(p, k, few, monkeypatch):
    """At most p(p+1)/2 + 1 weights stay, by null vectors or a linear program, of the same M."""
    monkeypatch.setattr(import_module("edtk.design.relaxation.sparse_weights"), "FEW", few)
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
