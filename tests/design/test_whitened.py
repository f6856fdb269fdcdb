"""Problems in parameters that their candidates tell equally well."""

import gc
import weakref

import numpy as np
import pytest

from edtk.design.information import PackedInformation, Rows
from edtk.design.problem import Problem
from edtk.design.problems import Whitened

EPS = np.finfo(float).eps


def steep(rows=1, degree=3):
    """A polynomial on [300, 310], measured at several shifted points at once."""
    x = np.linspace(300, 310, 41)
    points = x[:, None] + 0.1 * np.arange(rows)
    return Problem(np.vander(points.ravel(), degree + 1, increasing=True).reshape(41, rows, -1))


@pytest.mark.parametrize(("rows", "kept"), [(1, Rows), (3, PackedInformation)])
def test_the_smaller_form_is_kept(rows, kept):
    """White rows are kept where they are fewer numbers than their squares, else the squares."""
    problem = steep(rows)
    white = Whitened.of(problem)
    assert isinstance(white.problem.kept, kept)
    np.testing.assert_allclose(white.problem.mean, np.eye(4), atol=1e-7)


def test_rows_are_known_to_the_rounding_that_is_told():
    """A_i T agrees with exact arithmetic to the bound, candidate by candidate."""
    from fractions import Fraction

    problem = steep()
    white = Whitened.of(problem)
    T = [[Fraction(float(v)) for v in row] for row in white.T]
    for i in (0, 7, 40):
        a = [Fraction(float(v)) for v in problem.factors(i)[0]]
        exact = [sum(a[j] * T[j][k] for j in range(4)) for k in range(4)]
        found = white.problem.factors(i)[0]
        error = [float(abs(Fraction(float(x)) - y)) for x, y in zip(found, exact, strict=True)]
        assert np.linalg.norm(error) <= white.rounding[i]
        assert white.rounding[i] < 1e-6


def test_squares_are_known_to_the_rounding_that_is_told():
    """T' M_i T agrees with a product in long doubles to the bound."""
    squares = Problem.of_information(steep(degree=2).packed * 1.0)
    white = Whitened.of(squares)
    T = white.T.astype(np.longdouble)
    exact = T.T @ squares.blocks().astype(np.longdouble) @ T
    error = np.linalg.norm((white.problem.blocks() - exact).astype(float), axis=(1, 2))
    assert (error <= white.rounding).all()


def test_a_problem_is_whitened_once_and_forgotten():
    """Several criteria share the work, and nothing outlives the problem."""
    problem = steep()
    white = Whitened.of(problem)
    assert Whitened.of(problem) is white
    gone = weakref.ref(white)
    del problem, white
    gc.collect()
    assert gone() is None


def test_what_is_well_stays_as_it_is():
    """Centred candidates are not transformed, nor are those of a prior that tells enough."""
    x = np.linspace(-1, 1, 41)
    assert Whitened.of(Problem(np.vander(x, 4)[:, None, :])) is None
    problem = steep()
    known = problem.with_prior(np.diag(np.diag(problem.mean)))
    assert Whitened.of(known) is None
