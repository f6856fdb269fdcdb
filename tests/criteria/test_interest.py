"""Criteria of combinations K'k: the laws of `Criterion`, and what C_K itself obeys."""

import numpy as np
import pytest
from matrices import positive, symmetric

import criteria
from criteria import CriterionError, Interest
from criteria.linalg.estimable import estimable_inverse, open_columns

MONOTONE = ("A", "D", "E", "G", "O1", "O3", "O5")
P = 5

every = pytest.mark.parametrize("name", MONOTONE)
sizes = pytest.mark.parametrize("s", [1, 2, 5])


def combinations(rng, s):
    """K (P, s) of full rank, no column of which is a unit vector."""
    return rng.normal(size=(P, s))


def information(K, M):
    """C_K by its definition."""
    return np.linalg.inv(K.T @ np.linalg.inv(M) @ K)


@sizes
@every
def test_cost_is_that_of_the_information_about_the_combinations(name, s):
    """The criterion phi of C_K, whatever phi; K = I gives phi itself."""
    rng = np.random.default_rng(s)
    M = positive(rng, P)
    K = combinations(rng, s)
    base = criteria.create(name)
    assert Interest(base, K).cost(M) == pytest.approx(base.cost(information(K, M)), rel=1e-11)
    assert Interest(base, np.eye(P)).cost(M) == pytest.approx(base.cost(M), rel=1e-11)


@sizes
@every
def test_gradient_matches_finite_differences(name, s):
    """Fourth-order differences with h = 1e-3 of a direction of size 0.1 err by about 1e-9."""
    rng = np.random.default_rng(10 + s)
    c = criteria.create(name, interest=combinations(rng, s))
    h = 1e-3
    for _ in range(5):
        M = positive(rng, P)
        d = np.sqrt(np.diag(M))
        H = symmetric(rng, P) * np.outer(d, d) / 30
        f = c.cost(M + h * np.array([-2, -1, 1, 2])[:, None, None] * H)
        numeric = (f @ [1, -8, 8, -1]) / (12 * h)
        assert abs(np.sum(c.gradient(M) * H) - numeric) < 1e-6 * c.cost(M)


@sizes
@every
def test_homogeneous_monotone_and_convex(name, s):
    """The laws of a monotone convex criterion carry over to the combinations."""
    rng = np.random.default_rng(20 + s)
    c = criteria.create(name, interest=combinations(rng, s))
    for _ in range(10):
        M = positive(rng, P)
        N = positive(rng, P)
        assert c.cost(3 * M) == pytest.approx(3**-c.degree * c.cost(M), rel=1e-11)
        assert c.cost(M + N) <= c.cost(M) * (1 + 1e-11)
        assert c.cost(N) >= c.cost(M) + np.sum(c.gradient(M) * (N - M)) - 1e-10 * c.cost(M)
        assert np.sum(c.gradient(M) * M) == pytest.approx(-c.degree * c.cost(M), rel=1e-9)


@sizes
@every
def test_other_parameters_change_nothing(name, s):
    """With k = T k' the combinations are T'K, and the cost is the same, whatever the units."""
    rng = np.random.default_rng(30 + s)
    c = criteria.create(name, interest=combinations(rng, s))
    M = positive(rng, P)
    T = rng.normal(size=(P, P)) * 10 ** rng.uniform(-3, 3, P)
    assert c.in_units(T).cost(T.T @ M @ T) == pytest.approx(c.cost(M), rel=1e-8)


@sizes
@every
def test_lower_bound_holds_for_every_design(name, s):
    """A multiplier bounds each design below it, and minus the gradient is tight at its design."""
    rng = np.random.default_rng(40 + s)
    c = criteria.create(name, interest=combinations(rng, s))
    M = positive(rng, P)
    Z = -c.gradient(M)
    t = np.sum(Z * M)
    bound = c.lower_bound(Z[None], np.array([t]), M)
    assert bound == pytest.approx(c.cost(M), rel=1e-7)
    for _ in range(20):
        X = positive(rng, P)
        X *= t / np.sum(Z * X)
        assert c.cost(X) >= bound * (1 - 1e-9)
        other = positive(rng, P)
        top = np.sum(other * X)
        assert c.cost(X) >= c.lower_bound(other[None], np.array([top]), M) * (1 - 1e-9)


def test_d_of_a_subset_is_a_ratio_of_determinants():
    """D_s: ``det C_K = det M / det M_22`` for the parameters that are not of interest."""
    M = positive(np.random.default_rng(0), P)
    value = criteria.create("D", interest=np.eye(P)[:, :2]).value(M)
    assert value == pytest.approx(np.sqrt(np.linalg.det(M) / np.linalg.det(M[2:, 2:])), rel=1e-10)


@every
def test_singular_information_that_tells_the_combination(name):
    """A combination of what was measured is known, although the other parameters are not."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(3, P)) * [1e-3, 1.0, 10.0, 1e2, 1.0]
    K = A.T @ rng.normal(size=(3, 2))
    M = A.T @ A
    c = criteria.create(name, interest=K)
    L = np.linalg.lstsq(A.T, K, rcond=None)[0]  # K = A'L: the variance of L'y is L'L
    best = criteria.create(name).cost(np.linalg.inv(L.T @ L))
    assert c.cost(M) == pytest.approx(best, rel=1e-8)
    gradient = c.gradient(M)
    for _ in range(20):
        X = M + 0.3 * (B := rng.normal(size=(2, P)) * np.sqrt(np.diag(M))).T @ B
        assert c.cost(X) >= (c.cost(M) + np.sum(gradient * (X - M))) * (1 - 1e-7)
    # The cost tends to that of the singular matrix from the matrices above it.
    assert c.cost(M + 1e-9 * np.diag(np.diag(M))) == pytest.approx(best, rel=1e-5)


def test_singular_information_that_leaves_a_combination_open():
    """The cost is inf, and the message names the combination and what hides it."""
    M = np.diag([1.0, 0.0, 2.0, 0.0, 3.0])
    c = criteria.create("A", interest=np.eye(P)[:, [0, 1]])
    names = ("k1", "k2", "k3", "k4", "k5")
    assert c.cost(M) == np.inf
    assert c.missing(M, names) == ("k2 (open: k2 and k4)",)
    assert criteria.create("A", interest=np.eye(P)[:, [0, 4]]).missing(M, names) == ()
    np.testing.assert_array_equal(open_columns(M, np.eye(P)), [False, True, False, True, False])
    both = np.stack([M, np.eye(P)])
    np.testing.assert_array_equal(c.cost(both), [np.inf, 2.0])
    assert np.isnan(c.cost(np.full((P, P), np.nan)))


def test_what_rounding_leaves_of_a_zero_is_a_zero():
    """An excitation of 1e-17 does not make a nuisance parameter known, nor hide another one."""
    row = np.array([[1.0, 1e-17]])
    c = criteria.create("A", interest=[1.0, 0.0])
    assert c.cost(row.T @ row) == 1.0
    assert criteria.create("A", interest=[0.0, 1.0]).cost(row.T @ row) == np.inf


def test_regular_information_has_its_own_inverse_to_the_last_bit():
    """Nothing changes for regular matrices, beside singular ones too."""
    rng = np.random.default_rng(2)
    M = np.stack([positive(rng, P), np.diag([1.0, 1, 1, 1, 0])])
    _, cov, good = estimable_inverse(M, np.eye(P)[:, :1])
    assert good.all()
    alone = estimable_inverse(M[:1], np.eye(P)[:, :1])[1]
    np.testing.assert_array_equal(cov[0], alone[0])


def test_powers_and_soft_maxima_keep_the_combinations():
    """O3 of k2 has the plans of E of k2; a smooth criterion stays itself."""
    K = np.eye(P)[:, 1:3]
    c = criteria.create("O3", interest=K)
    assert c.label == "O3 of k2, k3"
    assert c.plan_criterion.label == "E of k2, k3"
    assert c.cost_from_plan_criterion(4.0) == 2.0
    M = positive(np.random.default_rng(3), P)
    assert c.cost(M) <= c.smoothed(50.0).cost(M) <= c.cost(M) * 1.1
    smooth = criteria.create("A", interest=K)
    assert smooth.smoothed(50.0) is smooth
    assert smooth.plan_criterion is smooth


def test_combinations_of_other_parameters_are_refused():
    """K has a row for each parameter of the information matrix."""
    c = criteria.create("A", interest=np.eye(3)[:, :1])
    for ask in (c.cost, c.gradient, lambda M: c.missing(M, ("k1",) * P)):
        with pytest.raises(CriterionError, match="combinations of 3 parameters; expected 5"):
            ask(np.eye(P))


@pytest.mark.parametrize(
    ("name", "K", "expected"),
    [
        ("O2", np.eye(3), "not monotone and convex"),
        ("O4", np.eye(3), "not monotone and convex"),
        ("rho0", np.eye(3), "says by its target what is of interest"),
        ("A", np.ones((3, 2)), "follows from the others"),
        ("A", np.ones((2, 3)), "follows from the others"),
        ("A", np.zeros(3), "a combination is zero"),
        ("A", np.full((3, 1), np.inf), "expected a finite matrix"),
        ("A", np.ones((3, 1, 1)), "expected a finite matrix"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(name, K, expected):
    """Criteria that are not monotone, a target besides, and combinations that say nothing new."""
    with pytest.raises(CriterionError, match=expected) as caught:
        criteria.create(name, target=np.eye(3), interest=K)
    assert "\n" not in str(caught.value)
