"""A look at all candidates in single precision, against doubles."""

import numpy as np
import pytest

from edtk.design.exact.counts import several_rows_pricing as module
from edtk.design.exact.counts.several_rows_pricing import FullLook

RNG = np.random.default_rng(8)
N = 150
P = 6
SCALES = np.exp(RNG.uniform(-4, 4, size=(N, 1, 1)))
ROWS = RNG.normal(size=(N, 3, P)) * SCALES
ROOTS = RNG.normal(size=(7, P, P)) * 10.0 ** RNG.uniform(-6, 6, size=(7, 1, 1))
Z = ROOTS @ np.swapaxes(ROOTS, 1, 2)
EXACT = np.einsum("nri,zij,nrj->zn", ROWS, Z, ROWS)


@pytest.fixture(params=["kept", "formed anew"])
def look(request, monkeypatch):
    """Few candidates and few multipliers at a time, with matrices that are kept or are not."""
    monkeypatch.setattr(module, "MATRICES_AT_ONCE", 40)
    monkeypatch.setattr(module, "PLACES_TOGETHER", 3)
    if request.param != "kept":
        monkeypatch.setattr(module, "BYTES_KEPT", 0)
    return FullLook(ROWS)


def test_no_more_wrong_than_it_says(look):
    """Every sensitivity is within its bound, which is a small part of a typical one."""
    numbers = []
    for i, found, wrong in look.sensitivities(Z):
        numbers.append(i)
        off = np.abs(found - EXACT[i])
        assert (off <= wrong * look.sizes).all()
        assert np.median(wrong * look.sizes / EXACT[i]) < 1e-4
        assert off.any()
    assert numbers == list(range(7))


def test_the_largest_of_each(look):
    """The candidates that are the best for any multiplier, of those that count."""
    best = {int(i) for own in EXACT for i in np.argsort(-own)[:4]}
    assert look.largest(Z, 4).tolist() == sorted(best)
    allowed = RNG.random((7, N)) < 0.5
    best = {int(i) for own, one in zip(EXACT, allowed, strict=True) for i in _first(own, one)}
    assert look.largest(Z, 4, list(allowed)).tolist() == sorted(best)
    assert look.largest(Z, N + 1).tolist() == list(range(N))


def _first(own: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """The four largest that are allowed."""
    return np.argsort(-np.where(allowed, own, -np.inf))[:4]
