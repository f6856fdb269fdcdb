"""Parts of matrices whose negative part is far below the rounding of their positive one."""

from fractions import Fraction

import numpy as np
import pytest

from criteria.linalg.spectrum import definite_parts, graded_parts

LIFT = 1e-9


def with_small_negative_part(rng, p, decades):
    """Z = d (y y' + lift I) d - q q' with q graded."""
    d = 10.0 ** np.linspace(decades, 0, p)
    y = rng.normal(size=p)
    q = rng.normal(size=p) / d
    q[-1] = 1.0
    return np.outer(d, d) * (np.outer(y, y) + LIFT * np.eye(p)) - np.outer(q, q)


def shifted(Z, x):
    """``Z + x I`` in rational numbers."""
    rows = [[Fraction(float(z)) for z in row] for row in Z]
    for i, row in enumerate(rows):
        row[i] += Fraction(float(x))
    return rows


def is_definite(Z):
    """Whether a rational matrix is positive definite, by exact elimination."""
    A = [row[:] for row in Z]
    for k in range(len(A)):
        if A[k][k] <= 0:
            return False
        for i in range(k + 1, len(A)):
            factor = A[i][k] / A[k][k]
            A[i] = [a - factor * b for a, b in zip(A[i], A[k], strict=True)]
    return True


@pytest.mark.parametrize("p", [2, 3, 5, 9])
@pytest.mark.parametrize("decades", [4, 7, 11, 14])
def test_negative_part_is_found(p, decades):
    """It is told to the gaps that relaxations ask for, though eigenvalues have lost it.

    Z has one negative eigenvalue, and exact arithmetic tells that it is not below what is told, and
    not above by more than a part of 2e-6.
    """
    for seed in range(3):
        Z = with_small_negative_part(np.random.default_rng(seed), p, decades)
        above, below = definite_parts(Z)
        assert is_definite(shifted(Z, below))
        assert not is_definite(shifted(Z, below * (1 - 2e-6)))
        assert above <= np.trace(Z) + below
        assert above == pytest.approx(np.trace(Z) + below, rel=1e-11)


def test_what_has_no_such_form():
    """Without diagonal, or with negative large entries, nothing is told."""
    assert graded_parts(np.array([[0.0, 1.0], [1.0, 1.0]])) is None
    Z = np.diag([-1.0, -1e-12])
    above, below = definite_parts(Z)
    assert above == 0
    assert below >= 1
