"""Exchanges by cutting planes, beside those for every candidate there is."""

import numpy as np
import pytest
from test_prove_exact import NAMES, criterion_of

from criteria.linalg.inverse import whitener
from criteria.linalg.typing import triangle
from edtk.design.exact.exact_exchange import GAIN_OF_EXCHANGE, exchanged
from edtk.design.exact.exact_nodes import Merits
from edtk.design.information import sensitivity_rows


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_no_single_exchange_is_better(name: str, seed: int) -> None:
    """The plan has the merit that is said, and no candidate in any place makes a better one."""
    rng = np.random.default_rng(seed)
    p, n, m = 3, 500, 5
    A = rng.normal(size=(n, 2, p))
    A = A @ whitener(np.einsum("nrp,nrq->pq", A, A) / n)
    twice = sensitivity_rows(np.ones((p, p)))
    rows, columns = triangle(p)
    F = (np.swapaxes(A, 1, 2) @ A)[:, rows, columns] * twice
    merits = Merits(criterion_of(name, p, rng), F, np.zeros(len(twice)), 0.0, m)

    def merit(features: np.ndarray) -> np.ndarray:
        return merits.of(merits.unpacked(features / merits.twice))

    places = rng.integers(0, n, m)
    first = float(merit(F[places].sum(axis=0)[None])[0])
    found = exchanged(merits, F[places], first)
    places = np.where(found.places < 0, places, found.places)
    whole = F[places].sum(axis=0)
    assert found.merit == pytest.approx(float(merit(whole[None])[0]), rel=1e-12)
    assert found.merit >= first
    for place in places:
        every = merit(whole - F[place] + F)
        assert every.max() <= found.merit * (1 + 2 * GAIN_OF_EXCHANGE)
