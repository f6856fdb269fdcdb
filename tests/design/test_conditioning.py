"""How well candidates tell parameters apart: condition numbers, open directions, whitening."""

import numpy as np
import pytest

from edtk.design.problem import Problem, RankDeficientError

EPS = np.finfo(float).eps


def monomials(low, high, degree, n=101):
    """Candidates of a polynomial of this degree at equally spaced points."""
    x = np.linspace(low, high, n)
    return Problem(np.vander(x, degree + 1, increasing=True)[:, None, :])


@pytest.mark.parametrize(
    ("low", "high", "degree"),
    [(2000, 2030, 2), (300, 310, 3), (10, 11, 6), (0, 1, 10), (-1, 1, 14), (2000, 2030, 4)],
)
def test_polynomials_far_from_the_origin_are_identifiable(low, high, degree):
    """Their condition number is that of the scaled rows, and whitening brings it to one."""
    problem = monomials(low, high, degree)
    problem.require_identifiable()
    A = problem.factors()[:, 0] / problem.conditioning.scale / np.sqrt(problem.n)
    assert problem.conditioning.number == pytest.approx(np.linalg.cond(A), rel=1e-3)
    white = problem.in_units(problem.conditioning.whitener)
    rounding = 16 * EPS * problem.p * problem.conditioning.number
    np.testing.assert_allclose(white.mean, np.eye(problem.p), atol=rounding)


def test_well_conditioned_candidates_need_no_factorization(monkeypatch):
    """Where squares are good enough, rows and their information are judged alike."""
    problem = monomials(-1, 1, 4)
    monkeypatch.setattr("edtk.design.conditioning.triangular_factor", None)
    same = Problem.of_information(problem.packed)
    assert problem.conditioning.is_well
    assert same.conditioning.number == pytest.approx(problem.conditioning.number, rel=1e-10)


def test_columns_that_differ_by_noise():
    """Two columns equal up to 1e-6 are told apart, with their condition number."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(500, 3))
    A[:, 2] = A[:, 1] + 1e-6 * rng.normal(size=500)
    problem = Problem(A[:, None, :])
    problem.require_identifiable()
    assert 1e5 < problem.conditioning.number < 1e7


def test_noise_below_what_can_be_told_is_no_open_direction():
    """Columns that differ by 1e-12 are told apart by candidates, but not to working precision."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(500, 3))
    for noise, words in ((1e-12, "to working precision"), (0.0, "no candidate excites k2 - k3")):
        A[:, 2] = A[:, 1] + noise * rng.normal(size=500)
        with pytest.raises(RankDeficientError, match=words):
            Problem(A[:, None, :]).require_identifiable()


@pytest.mark.parametrize(("low", "high", "degree"), [(10, 11, 10), (2000, 2030, 7), (300, 310, 9)])
def test_beyond_doubles(low, high, degree):
    """A model that doubles cannot hold is named so, with its condition number and a remedy."""
    words = r"to working precision: their condition number is \d.\de\+\d\d; centre or scale the reg"
    with pytest.raises(RankDeficientError, match=words):
        monomials(low, high, degree).require_identifiable()


def test_information_may_be_beyond_doubles_where_rows_are_not():
    """Packed information has lost what its rows still have, and the message says so."""
    problem = monomials(300, 310, 3)
    squared = Problem.of_information(problem.packed)
    with pytest.raises(RankDeficientError, match=r"or give rows instead of information$"):
        squared.require_identifiable()


@pytest.mark.parametrize("spread", [0.0, 6.0])
def test_open_direction_beside_nearly_dependent_columns(spread):
    """A direction that is exactly open is named, in any units, also where others nearly are."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(300, 4))
    A[:, 1] = A[:, 0] + 1e-5 * A[:, 1]
    A[:, 3] = 2 * A[:, 2]
    problem = Problem((A * 10.0 ** np.linspace(-spread, spread, 4))[:, None, :])
    with pytest.raises(RankDeficientError, match="no candidate excites k3 - "):
        problem.require_identifiable()
    T = problem.conditioning.whitener
    white = problem.in_units(T).mean
    np.testing.assert_allclose(white, np.diag([0.0, 1, 1, 1]), atol=1e-9)


def test_prior_counts():
    """What the candidates cannot tell apart the prior may, to the same precision."""
    problem = monomials(10, 11, 10)
    scale = problem.conditioning.scale
    known = problem.with_prior(1e-12 * np.diag(scale**2))
    known.require_identifiable()
    T = known.conditioning.whitener
    np.testing.assert_allclose(known.in_units(T).mean, np.eye(11), atol=1e-7)


def test_in_units():
    """The information about k' is T'M T, of rows and of packed information, prior included."""
    rng = np.random.default_rng(2)
    T = rng.normal(size=(3, 3))
    B = rng.normal(size=(4, 3))
    rows = Problem(rng.normal(size=(6, 2, 3)), prior=B.T @ B)
    for problem in (rows, Problem.of_information(rows.packed, prior=rows.prior)):
        other = problem.in_units(T)
        np.testing.assert_allclose(other.blocks(), T.T @ rows.blocks() @ T, atol=1e-13)
        np.testing.assert_allclose(other.mean, T.T @ rows.mean @ T, atol=1e-13)
        Z = np.eye(3)
        np.testing.assert_allclose(
            other.sensitivities(Z), rows.sensitivities(T @ Z @ T.T), rtol=1e-12
        )
