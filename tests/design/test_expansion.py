"""Functions of points as polynomials: derived exactly, interpolated by a degree, or refused."""

from fractions import Fraction
from math import comb

import numpy as np
import pandas as pd
import pytest

from edtk.design.expansion import NotPolynomialError, degrees_of, derived, expand
from edtk.design.region import Region
from edtk.system.errors import ArgumentError

SQUARE = np.array([[-1.0, -2.0], [3.0, 5.0]])


def quadratic(x):
    """A full quadratic."""
    u, v = x.T
    return np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)


def as_floats(x):
    """The same, which does not run on polynomials."""
    return quadratic(np.asarray(x, dtype=float))


def test_a_function_that_runs_on_polynomials_is_one_without_rounding():
    """Powers of ``2015 + 15 u`` have the coefficients of the binomial theorem, digit by digit."""
    found = derived(lambda x: np.vander(x[:, 0], 8, increasing=True), np.array([[2000.0], [2030]]))
    assert found.is_derived
    for k in range(8):
        expected = [comb(k, j) * 2015 ** (k - j) * 15**j for j in range(k + 1)]
        assert found.exact[k].tolist() == expected + [Fraction(0)] * (7 - k)


def test_degrees_are_those_of_each_variable():
    """A variable on which nothing depends has degree zero; so has a constant model."""
    three = np.array([[0.0, 0, 0], [1, 1, 1]])
    found = derived(lambda x: np.stack([x[:, 0] ** 3 * x[:, 2] / 7, 2 * x[:, 2]], axis=-1), three)
    assert found.degrees == (3, 0, 1)
    assert derived(lambda x: np.ones((len(x), 2)), three).degrees == (0, 0, 0)


@pytest.mark.parametrize("rows", [quadratic, as_floats], ids=["derived", "interpolated"])
def test_values_are_those_of_the_function(rows):
    """At fresh points, for a function of either kind, within the errors that are stated."""
    found = expand(rows, SQUARE, (4, 3))
    assert found.degrees == (2, 2)
    x = SQUARE[0] + (SQUARE[1] - SQUARE[0]) * np.random.default_rng(1).random((500, 2))
    away = np.abs(found.values(x) - rows(x)).max(axis=0)
    assert (away <= found.errors + 1e-13).all()
    assert (found.errors <= 1e-12).all()


def test_a_product_with_a_matrix_rounds_nothing():
    """Years around 2015 and parameters about their middle: differences of numbers of 1e9."""
    years = np.array([[2000.0], [2030.0]])
    found = derived(lambda x: np.vander(x[:, 0], 4, increasing=True)[:, None, :], years)
    T = np.array([[1.0, -2015, 2015**2, -(2015**3)], [0, 1, -2 * 2015, 3 * 2015**2]])
    T = np.vstack([T, [0, 0, 1, -3 * 2015], [0, 0, 0, 1]])
    centred = found.divided(np.array([3.0])).times(T)
    expected = np.diag([1.0, 15, 225, 3375]) / 3
    np.testing.assert_array_equal(centred.reshaped((4,)).coefficients, expected)


@pytest.mark.parametrize(
    "function",
    [
        np.exp,
        np.abs,
        np.sqrt,
        lambda x: 1 / (1 + x),
        lambda x: x**0.5,
        lambda x: x**-1,
        lambda x: x**1000,
        lambda x: np.where(x > 0, x, 0),
        lambda x: np.where(x == 0, x, 0),
        lambda x: np.maximum(x, 0.1),
        lambda x: x // 1,
        lambda x: x / x,
        lambda x: x + np.inf,
    ],
)
def test_what_is_no_polynomial_is_none(function):
    """Roots, orders, quotients: nothing runs that could be another function at other points."""
    with pytest.raises(NotPolynomialError, match="does not run on polynomials"):
        expand(function, np.array([[0.5], [2.0]]), None)


def test_a_function_that_knows_what_it_runs_on_is_found_out():
    """Another function on polynomials than on numbers differs at fresh points."""

    def two_faced(x):
        return x if x.dtype == object else np.exp(x)

    with pytest.raises(NotPolynomialError, match="differs by") as caught:
        expand(two_faced, np.array([[0.0], [1.0]]), None)
    assert caught.value.x is not None


@pytest.mark.parametrize(
    ("rows", "degree", "message"),
    [
        (np.exp, 5, r"rows: a value differs by 4\.5e-07 .* any polynomial of degree 5 at x = 1"),
        (lambda x: x**3, 2, r"rows: a value differs by .* degree 2 at x = "),
        (lambda x: np.stack([x, np.abs(x - 0.3)], axis=-1)[:, 0], 9, r"rows: .* degree 9 at x = "),
        (lambda x: x, [1, 1], "degree: 2 numbers; expected one, or one for each of 1 variables"),
        (lambda x: x, [[1], [2, 3]], "degree: expected a number, or one for each of 1 variables"),
        (lambda x: x, -1, "degree -1: expected a whole number, 0 or more"),
        (lambda x: x, 1.5, "degree 1.5: expected a whole number, 0 or more"),
        (lambda x: np.exp(0 * x), 10**6, "rows: a degree of more than 20000 coefficients"),
    ],
)
def test_a_wrong_degree_is_refused_in_one_line(rows, degree, message):
    """A function that is no polynomial of the stated degree is refused, with a point."""
    with pytest.raises(ArgumentError, match=message) as caught:
        Region(rows, 0, 1, degree=degree)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("degree", [np.array(2), np.array([2]), pd.Series([2], index=[7])])
def test_a_degree_is_a_number_of_any_kind(degree):
    """Arrays of no axis and columns of tables, too."""
    assert degrees_of(degree, 1) == (2,)
    assert Region(lambda x: x**2, 0, 1, degree=degree).p == 1


def test_a_constraint_of_a_higher_degree_is_refused():
    """Constraints are polynomials of the stated degree likewise."""
    with pytest.raises(ArgumentError, match=r"constraints: a value differs .* at x1 = .*, x2 = "):
        Region(
            lambda x: x,
            [-1, -1],
            [1, 1],
            constraints=lambda x: 1 - (np.asarray(x, dtype=float) ** 2).sum(axis=1),
            degree=1,
        )
