"""Products whose terms cancel keep their digits on machines that have no numbers beyond doubles."""

from fractions import Fraction

import numpy as np
import pytest

from criteria.linalg.long_product import EPS_OF_SUM, compensated_product, long_product
from edtk.certificate.recompute import arrays


def exact(A, T):
    """The product in fractions, and the sums of the sizes of its terms."""
    whole = np.vectorize(Fraction, otypes=[object])
    return whole(A) @ whole(T), np.abs(A) @ np.abs(T)


def cancelling(rng, units):
    """Rows whose combinations are 1e-14 of their terms, in units up to 1e+-units."""
    A = rng.normal(size=(7, 2, 5))
    T = rng.normal(size=(5, 3))
    A[..., -1] = -(A[..., :-1] @ T[:-1, 0]) / T[-1, 0]
    d = 10.0 ** rng.uniform(-units, units, 5)
    return A * d, T / d[:, None]


@pytest.mark.parametrize("units", [0, 60])
@pytest.mark.parametrize("product", [long_product, compensated_product])
def test_products_keep_what_is_left_of_their_terms(product, units):
    """The error is eps of the result and EPS_OF_SUM of the terms; doubles lose eps of these."""
    A, T = cancelling(np.random.default_rng(4), units)
    sums, sizes = exact(A, T)
    wrong = np.abs((product(A, T).astype(float) - sums).astype(float))
    allowed = 2.0**-52 * np.abs(sums.astype(float)) + len(T) * EPS_OF_SUM * sizes
    assert (wrong <= allowed).all()
    assert not (np.abs((A @ T - sums).astype(float)) <= allowed).all()


@pytest.mark.parametrize("is_longer", [True, False])
def test_the_second_implementation_keeps_them_too(monkeypatch, is_longer):
    """Its error is as small, with long numbers and without."""
    monkeypatch.setattr(arrays, "IS_LONGER", arrays.IS_LONGER and is_longer)
    A, T = cancelling(np.random.default_rng(5), 60)
    sums, sizes = exact(A, T)
    wrong = np.abs((arrays.long_product(A, T).astype(float) - sums).astype(float))
    assert (wrong <= 2.0**-52 * np.abs(sums.astype(float)) + 5 * 2.0**-63 * sizes).all()
