"""The normalised basis of a box, angles and lengths alike."""

from itertools import product

import numpy as np
import pytest

from edtk.design.enclosure.basis import basis, elevation, from_functions, halves, largest_entry
from edtk.design.enclosure.polynomial import Axis, Polynomial

CASES = list(product(("angle", "length"), (0, 1, 2, 4), (0.7, 1e-3)))


@pytest.fixture
def rng() -> np.random.Generator:
    """The same numbers each time."""
    return np.random.default_rng(7)


@pytest.mark.parametrize(("kind", "degree", "half"), CASES)
def test_the_basis_is_a_partition_of_one(kind: str, degree: int, half: float) -> None:
    """No function is negative, their sum is one, and only the first and the last reach the ends."""
    values = basis(kind, degree, half, np.linspace(-half, half, 31))
    assert values.min() >= -1e-15
    assert np.allclose(values.sum(axis=1), 1, atol=1e-13)
    assert np.allclose(values[[0, -1]][:, [0, -1]], np.eye(2) if degree else 1, atol=1e-13)


@pytest.mark.parametrize(("kind", "degree", "half"), CASES)
def test_matrices_of_halves_and_of_elevation_are_stochastic(
    kind: str, degree: int, half: float
) -> None:
    """Their entries are not negative and rows have the sum one, so that no bound rises."""
    for matrix in (*halves(kind, degree, half), elevation(kind, degree, degree + 2, half)):
        assert matrix.min() >= 0
        assert np.allclose(matrix.sum(axis=1), 1, atol=1e-14)


@pytest.mark.parametrize(("kind", "degree", "half"), CASES)
def test_coefficients_give_the_polynomial_on_an_interval_and_on_its_halves(
    kind: str, degree: int, half: float, rng: np.random.Generator
) -> None:
    """From functions of the whole axis to an interval, and from there to halves and degrees."""
    axis = Axis(kind, -1.0, 2.0)  # type: ignore[arg-type]
    f = Polynomial((axis,), rng.normal(size=axis.size(degree)))
    s = np.linspace(-half, half, 17)
    own = from_functions(axis, degree, np.array([0.4]), np.array([half]))[0] @ f.coefficients
    accuracy = 1e-13 * f.size * largest_entry(axis, degree, half)
    assert np.abs(basis(kind, degree, half, s) @ own - f(0.4 + s[:, None])).max() < accuracy
    higher = elevation(kind, degree, degree + 3, half) @ own
    assert np.abs(basis(kind, degree + 3, half, s) @ higher - f(0.4 + s[:, None])).max() < accuracy
    for side, H in zip((-1, 1), halves(kind, degree, half), strict=True):
        middle = np.array([0.4 + side * half / 2])
        anew = from_functions(axis, degree, middle, np.array([half / 2]))[0] @ f.coefficients
        assert np.abs(H @ own - anew).max() < accuracy


@pytest.mark.parametrize("kind", ["angle", "length"])
def test_the_excess_of_the_largest_coefficient_falls_with_the_square_of_the_box(
    kind: str, rng: np.random.Generator
) -> None:
    """Half the interval, about a quarter of the excess, where the maximum is inside."""
    axis = Axis(kind, -1.0, 1.0)  # type: ignore[arg-type]
    down = [1.0, 0.0, -1.0] if kind == "length" else [0.0, 1.0, 0.3]
    f = Polynomial((axis,), np.array(down))
    top = 0.0 if kind == "length" else float(np.arctan(0.3))
    excess = []
    for half in (0.2, 0.1, 0.05):
        own = from_functions(axis, f.degrees[0], np.array([top]), np.array([half]))
        excess.append((own[0] @ f.coefficients).max() - f(np.array([[top]]))[0])
    assert excess[0] > 0
    assert np.allclose(np.divide(excess[:-1], excess[1:]), 4, rtol=0.05)
