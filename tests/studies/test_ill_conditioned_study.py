"""The study of nearly dependent parameters: its exact arithmetic, and one of its rows."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def study(script):
    return script("ill_conditioned.py")


def test_exact_costs_are_those_of_a_diagonal_matrix(study):
    """Of unit rows with weights w the variances are 1/w, and the determinant is their product."""
    w = np.array([0.25, 0.25, 0.5, 0.0])
    A = np.concatenate([np.eye(3), np.ones((1, 3))])
    found = study.exact_costs(A, w)
    assert found["A"] == 10.0
    assert found["D"] == pytest.approx(32 ** (1 / 3), rel=1e-14)


def test_logarithms_of_long_fractions(study):
    """Numbers beyond the range of doubles have logarithms, too."""
    ratio = study.Fraction(3**5000, 2**7000)
    assert study.logarithm(ratio) == pytest.approx(5000 * np.log(3) - 7000 * np.log(2), rel=1e-13)


def test_an_error_is_below_the_accuracy_that_is_told(study):
    """Of years, from rows and from squares; a bound is lowered by what rounding may have added."""
    A = study.MODELS["quadratic of the years 2000 to 2030"]
    rows = study.edtk.Problem(A[:, None, :])
    for problem in (rows, study.edtk.Problem.of_information(rows.packed)):
        gap, error, accuracy = map(float, study.cells(problem, A, "A"))
        assert gap <= study.GAP + accuracy
        assert error <= accuracy
