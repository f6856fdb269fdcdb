"""Models of nearly dependent parameters are solved like the same model in good parameters."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

CASES = {
    "years": (2000, 2030, 2),
    "cubic on [300, 310]": (300, 310, 3),
    "degree 6 on [10, 11]": (10, 11, 6),
    "degree 10 on [0, 1]": (0, 1, 10),
    "degree 14 on [-1, 1]": (-1, 1, 14),
}
every_case = pytest.mark.parametrize("case", CASES)
GAP = 1e-6
EPS = np.finfo(float).eps


@cache
def monomials(case):
    """Rows (101, p) of the powers of x."""
    low, high, degree = CASES[case]
    return np.vander(np.linspace(low, high, 101), degree + 1, increasing=True)


@cache
def orthogonal(case):
    """Rows (101, p) of Legendre polynomials on the same points, which span the same functions."""
    return np.polynomial.legendre.legvander(np.linspace(-1, 1, 101), CASES[case][2])


@cache
def solved(case, name):
    """The relaxation of the monomials."""
    return relax(Problem(monomials(case)[:, None, :]), criteria.create(name))


def exact_information(rows, weights):
    """The information of floating-point rows and weights in rational numbers, nothing rounded."""
    p = rows.shape[1]
    M = [[Fraction(0)] * p for _ in range(p)]
    for i in np.flatnonzero(weights):
        w = Fraction(float(weights[i]))
        x = [Fraction(float(v)) for v in rows[i]]
        for a in range(p):
            for b in range(a + 1):
                M[a][b] += w * x[a] * x[b]
    return [[M[max(a, b)][min(a, b)] for b in range(p)] for a in range(p)]


def exact_inverse(M):
    """Inverse and determinant in rational numbers, by Gauss and Jordan."""
    p = len(M)
    A = [[*row, *(Fraction(int(i == j)) for j in range(p))] for i, row in enumerate(M)]
    determinant = Fraction(1)
    for k in range(p):
        pivot = A[k][k]
        determinant *= pivot
        A[k] = [v / pivot for v in A[k]]
        for i in range(p):
            if i != k and A[i][k]:
                factor = A[i][k]
                A[i] = [u - factor * v for u, v in zip(A[i], A[k], strict=True)]
    return [row[p:] for row in A], determinant


@every_case
@pytest.mark.parametrize("name", ["D", "A"])
def test_costs_are_those_of_exact_arithmetic(case, name):
    """The cost is wrong by less than the accuracy that is stated, by rational arithmetic."""
    r = solved(case, name)
    cov, determinant = exact_inverse(exact_information(monomials(case), r.weights))
    p = len(cov)
    if name == "D":
        log = _log(determinant.numerator) - _log(determinant.denominator)
        exact = np.exp(-log / p)
    else:
        exact = float(sum(cov[i][i] for i in range(p)))
    assert abs(r.cost / exact - 1) <= r.accuracy
    assert r.gap <= GAP


def _log(number):
    """Natural logarithm of a large whole number."""
    shift = max(number.bit_length() - 100, 0)
    return np.log(float(number >> shift)) + shift * np.log(2.0)


@every_case
def test_d_optimal_weights_are_those_of_orthogonal_polynomials(case):
    """D does not depend on the parameters, so that weights for monomials are as good for others."""
    good = Problem(orthogonal(case)[:, None, :])
    criterion = criteria.create("D")
    best = relax(good, criterion)
    r = solved(case, "D")
    assert criterion.cost(good.information(r.weights)) <= best.cost * (1 + 2 * GAP)


@pytest.mark.parametrize(
    ("case", "name"),
    # G of fifteen parameters takes seconds.
    [(case, name) for case in CASES for name in ("A", "E", "O3", "O5")] + [("years", "G")],
)
def test_criteria_in_units_are_those_of_the_monomials(case, name):
    """Cost, bound and weights are those of the criterion of the monomials' own coefficients.

    With orthogonal polynomials B and ``A = B R`` their coefficients are ``k = R^-1 c``. The cost of
    other weights is not below the bound. The monomials themselves are rounded, which changes costs
    by the condition number times as much.
    """
    r = solved(case, name)
    assert r.gap <= GAP
    B = orthogonal(case)
    R = np.linalg.lstsq(B, monomials(case), rcond=None)[0]
    same = criteria.create(name).transformed(np.linalg.inv(R))
    good = Problem(B[:, None, :])
    number = Problem(monomials(case)[:, None, :]).conditioning.number
    slack = 2 * r.accuracy + 8 * EPS * number
    assert same.cost(good.information(r.weights)) == pytest.approx(r.cost, rel=slack)
    for weights in np.random.default_rng(0).dirichlet(np.full(101, 0.2), size=20):
        assert same.cost(good.information(weights)) >= r.proved_bound.cost * (1 - slack)


@every_case
@pytest.mark.parametrize("name", ["D", "A", "E", "O5"])
def test_certify_finds_the_same_numbers(case, name):
    """Cost and bound are computed anew from weights and multipliers, with all digits."""
    problem = Problem(monomials(case)[:, None, :])
    r = solved(case, name)
    cost, bound = r.certify(problem)
    assert cost == pytest.approx(r.cost, rel=1e-9)
    assert bound == pytest.approx(r.proved_bound.cost, rel=1e-9)


@pytest.mark.parametrize("noise", [1e-5, 1e-6, 1e-8])
@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_columns_that_differ_by_noise(noise, name):
    """Of two columns that are nearly equal the optimum is that of their mean and difference."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(60, 3))
    own = A.copy()
    A[:, 2] = A[:, 1] + noise * A[:, 2]
    criterion = criteria.create(name)
    r = relax(Problem(A[:, None, :]), criterion)
    # k = T c, where c_2 = k_2 + k_3 and c_3 = noise k_3.
    T = np.array([[1, 0, 0], [0, 1, -1 / noise], [0, 0, 1 / noise]])
    same = criterion.transformed(T)
    good = relax(Problem(own[:, None, :]), same)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(good.cost, rel=2 * GAP)
    rounded = 8 * EPS / noise  # of the third column
    assert r.cost >= good.proved_bound.cost * (1 - r.accuracy - rounded)
    assert r.accuracy < 1e-5


@pytest.mark.parametrize("name", ["D", "A", "E", "O5"])
@pytest.mark.parametrize("case", ["years", "degree 14 on [-1, 1]"])
def test_information_that_has_lost_digits(case, name):
    """Of squares alone cost and bound are right to the accuracy that is told, and certified."""
    problem = Problem(monomials(case)[:, None, :])
    squares = Problem.of_information(problem.packed)
    r = solved(case, name)
    found = relax(squares, criteria.create(name))
    assert 0 <= found.gap <= GAP + found.accuracy
    assert 1e-8 < found.accuracy < 1e-2
    assert found.cost == pytest.approx(r.cost, rel=found.accuracy)
    assert found.proved_bound.cost == pytest.approx(r.proved_bound.cost, rel=found.accuracy)
    _, bound = found.certify(squares)
    assert bound == pytest.approx(found.proved_bound.cost, rel=1e-9)


def test_interest_beside_nearly_dependent_columns():
    """The slope at the end of a cubic on [300, 310] is as well told as with centred powers."""
    x = np.linspace(300, 310, 101)
    u = x - 305
    slope = np.array([0, 1, 2 * 310.0, 3 * 310.0**2])
    centred = np.array([0, 1, 2 * 5.0, 3 * 25.0])
    given = relax(
        Problem(np.vander(x, 4, increasing=True)[:, None, :]), criteria.create("c", c=slope)
    )
    best = relax(
        Problem(np.vander(u, 4, increasing=True)[:, None, :]), criteria.create("c", c=centred)
    )
    assert given.gap <= GAP
    assert given.cost == pytest.approx(best.cost, rel=2 * GAP)


@pytest.mark.parametrize("name", ["D", "A"])
@pytest.mark.parametrize("s", [2, 3, 4])
def test_some_coefficients_of_nearly_dependent_columns(name, s):
    """The highest coefficients of a cubic of years are told as rational arithmetic says."""
    rows = np.vander(np.linspace(2000, 2030, 31), 4, increasing=True)
    r = relax(Problem(rows[:, None, :]), criteria.create(name, interest=np.eye(4)[:, 4 - s :]))
    cov, _ = exact_inverse(exact_information(rows, r.weights))
    part = [row[4 - s :] for row in cov[4 - s :]]
    if name == "D":
        _, determinant = exact_inverse(part)
        log = _log(determinant.numerator) - _log(determinant.denominator)
        exact = np.exp(log / s)
    else:
        exact = float(sum(part[i][i] for i in range(s)))
    assert abs(r.cost / exact - 1) <= r.accuracy
    assert -r.accuracy <= r.gap <= GAP


DISTANT = 10.0 ** np.array([-9, -3, 3, 9])
OF_DISTANT = {
    "c": lambda rows: {"c": rows[3]},
    "I": lambda rows: {"points": rows[:6]},
    # The units of k2 and k3 together are one.
    "Ds": lambda rows: {"interest": np.eye(4)[:, 1:3]},
    "prediction_G": lambda rows: {"points": rows[:6]},
}


@pytest.mark.parametrize("name", OF_DISTANT)
def test_units_that_are_eighteen_decades_apart(name):
    """No parameter of an array is taken for rounding because its unit is large."""
    own = np.random.default_rng(3).normal(size=(25, 4))
    rows = own * DISTANT
    problem = Problem(rows[:, None, :])
    found = relax(problem, criteria.create(name, **OF_DISTANT[name](rows)))
    good = relax(Problem(own[:, None, :]), criteria.create(name, **OF_DISTANT[name](own)))
    assert found.cost == pytest.approx(good.cost, rel=2 * GAP)
    assert -1e-9 <= found.gap <= GAP
    cost, bound = found.certify(problem)
    assert cost == pytest.approx(found.cost, rel=1e-9)
    assert bound == pytest.approx(found.proved_bound.cost, rel=1e-9)


def test_what_a_model_computes_may_be_rounding():
    """Rows of a model are judged as ever: a column of roundings is no parameter to be told."""
    rows = np.random.default_rng(3).normal(size=(25, 3))
    rows[:, 2] *= 1e-17
    computed = Problem.of_kept(Problem(rows[:, None, :]).kept, None, None)
    criterion = criteria.create("Ds", interest=np.eye(3)[:, :2])
    found = relax(computed, criterion)
    without = relax(Problem(rows[:, None, :2]), criteria.create("D"))
    assert found.cost == pytest.approx(without.cost, rel=2 * GAP)


@pytest.mark.parametrize("noise", [1e-4, 1e-6])
def test_accuracy_counts_what_the_criterion_was_given(noise):
    """A matrix W has the squares of nearly dependent rows; what they have lost is told."""
    A = np.random.default_rng(1).normal(size=(30, 3))
    A[:, 2] = A[:, 1] + noise * A[:, 2]
    W = A.T @ A / 30
    problem = Problem(A[:, None, :])
    of_squares = relax(problem, criteria.create("I", W=W))
    of_rows = relax(problem, criteria.create("I", points=A))
    for found in (of_squares, of_rows):
        cov, _ = exact_inverse(exact_information(A, found.weights))
        exact = 0.0
        if found is of_squares:
            pairs = ((i, j) for i in range(3) for j in range(3))
            exact = float(sum(Fraction(float(W[i, j])) * cov[i][j] for i, j in pairs))
        else:
            exact = float(
                sum(
                    Fraction(float(x[i])) * Fraction(float(x[j])) * cov[i][j] / 30
                    for x in A
                    for i in range(3)
                    for j in range(3)
                )
            )
        assert abs(found.cost / exact - 1) <= found.accuracy
    assert of_squares.accuracy > 100 * of_rows.accuracy


def test_accuracy_is_told_where_it_shows():
    """The headline has the accuracy of a model that doubles just hold, and of no other."""
    assert ", numbers to " in solved("degree 6 on [10, 11]", "D").headline()
    assert (
        "numbers"
        not in relax(Problem(orthogonal("years")[:, None, :]), criteria.create("D")).headline()
    )


def exact_extremes(case, r):
    """The largest eigenvalue of the design and of its inverse, which rational arithmetic gave.

    Both matrices are rounded once, entry by entry, which changes neither by more than p roundings.
    """
    M = exact_information(monomials(case), r.weights)
    cov, _ = exact_inverse(M)
    return [np.linalg.eigvalsh(np.array(A, dtype=float))[-1] for A in (M, cov)]


@every_case
@pytest.mark.parametrize("name", ["O2", "O4"])
def test_condition_numbers_of_nearly_dependent_parameters(case, name):
    """Criteria of both extreme eigenvalues are told, and proved, as well as the others.

    Their ratio is up to 1e31 here, where eigenvalues of the information itself have no digit left.
    """
    r = solved(case, name)
    high, low = exact_extremes(case, r)
    exact = np.sqrt(high * low) if name == "O2" else np.sqrt(high) * low
    assert r.cost == pytest.approx(exact, rel=2 * r.accuracy + 64 * EPS)
    assert 0 <= r.gap <= GAP
    problem = Problem(monomials(case)[:, None, :])
    cost, bound = r.certify(problem)
    assert cost == pytest.approx(r.cost, rel=1e-9)
    assert bound == pytest.approx(r.proved_bound.cost, rel=1e-9)


@pytest.mark.parametrize("case", ["cubic on [300, 310]", "degree 10 on [0, 1]"])
@pytest.mark.parametrize("name", ["O2", "O4"])
def test_no_weights_near_the_best_are_below_the_bound(case, name):
    """The bound is no number beside the cost: weights all around the optimum obey it."""
    r = solved(case, name)
    problem = Problem(monomials(case)[:, None, :])
    rng = np.random.default_rng(0)
    for size in (1e-4, 1e-3, 1e-2, 0.1):
        for _ in range(5):
            weights = (1 - size) * r.weights + size * rng.dirichlet(np.full(101, 0.1))
            other = replace(r, weights=weights / weights.sum())
            assert other.certify(problem)[0] >= r.proved_bound.cost * (1 - r.accuracy)


@pytest.mark.parametrize("name", ["E", "O2", "O4"])
def test_units_that_are_decades_apart(name):
    """Own certificates hold, and no other weights are below their bounds, in uneven units too."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(20, 2, 5)) * 10.0 ** rng.uniform(-6, 0, size=5)
        problem = Problem(rows)
        r = relax(problem, criteria.create(name))
        assert r.gap <= GAP
        cost, bound = r.certify(problem)
        assert cost == pytest.approx(r.cost, rel=1e-9)
        assert bound == pytest.approx(r.proved_bound.cost, rel=1e-6)
        for weights in rng.dirichlet(np.full(20, 0.3), size=5):
            assert replace(r, weights=weights).certify(problem)[0] >= bound * (1 - 1e-9)
