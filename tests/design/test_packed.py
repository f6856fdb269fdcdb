"""Packed symmetric matrices: round trips, and inner products with multipliers."""

import numpy as np
import pytest

from edtk.design.information import order, pack_gram, sensitivity_rows, unpack

RNG = np.random.default_rng(0)
SIZES = pytest.mark.parametrize("p", [1, 2, 3, 5, 12])
BATCH = pytest.mark.parametrize("batch", [(), (1,), (7,), (2, 3), (0,)], ids=str)
EPS = np.finfo(float).eps


@SIZES
@BATCH
def test_gram_round_trip(p, batch):
    """Unpacked Gram matrices are A'A of every candidate, to the rounding of a sum."""
    A = RNG.normal(size=(*batch, 4, p))
    packed = pack_gram(np.moveaxis(A, (-1, -2), (0, 1)))
    assert packed.shape == (p * (p + 1) // 2, *batch)
    expected = np.swapaxes(A, -1, -2) @ A
    size = np.swapaxes(np.abs(A), -1, -2) @ np.abs(A)
    assert (np.abs(unpack(packed) - expected) <= 8 * EPS * size).all()


@SIZES
@BATCH
def test_unpack_is_symmetric_and_keeps_every_entry(p, batch):
    """Unpacking copies each entry of the upper triangle, row by row, to (i, j) and (j, i)."""
    packed = RNG.normal(size=(p * (p + 1) // 2, *batch))
    M = unpack(packed)
    assert M.shape == (*batch, p, p)
    np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))
    k = 0
    for i in range(p):
        for j in range(i, p):
            np.testing.assert_array_equal(M[..., i, j], packed[k])
            k += 1


@SIZES
def test_price_rows_give_the_inner_product(p):
    """The product of sensitivity rows and packed matrices is trace(Z M), for one Z or a stack."""
    Z = RNG.normal(size=(2, 3, p, p))
    Z = Z + np.swapaxes(Z, -1, -2)
    packed = RNG.normal(size=(p * (p + 1) // 2, 6))
    M = unpack(packed)
    expected = np.einsum("abij,nji->abn", Z, M)
    size = np.einsum("abij,nji->abn", np.abs(Z), np.abs(M))
    assert (np.abs(sensitivity_rows(Z) @ packed - expected) <= 2 * p * p * EPS * size).all()
    np.testing.assert_array_equal(sensitivity_rows(Z[1, 2]), sensitivity_rows(Z)[1, 2])
    assert sensitivity_rows(Z[:0]).shape == (0, 3, p * (p + 1) // 2)


def test_order_inverts_the_length_of_a_triangle():
    """The order of p (p + 1)/2 entries is p, also of large ones; any other length is rejected."""
    for p in (*range(1, 60), 10_000, 1_000_000):
        assert order(p * (p + 1) // 2) == p
    for length in set(range(60)) - {p * (p + 1) // 2 for p in range(1, 12)}:
        with pytest.raises(ValueError, match=f"^{length} entries"):
            order(length)
