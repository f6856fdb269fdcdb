"""Bayesian D and A: the laws of a criterion of M + R, which is homogeneous together with R only."""

import numpy as np
import pytest
import test_laws as laws
from matrices import make, orthogonal, positive

import criteria
from criteria import CriterionError

P = 4
NAMES = ("bayes_D", "bayes_A")

every = pytest.mark.parametrize("name", NAMES)


def information(seed):
    return positive(np.random.default_rng(seed), P)


@every
def test_laws(name):
    """Derivatives, convexity, monotonicity, batches and NaN are those of every criterion."""
    laws.test_gradient_matches_finite_differences(name, P, 0.0)
    laws.test_gradient_is_symmetric_and_finite_even_at_kinks(name, P)
    laws.test_convex_along_segments(name, P)
    laws.test_subgradient_inequality(name, P)
    laws.test_more_information_never_costs(name, P)
    laws.test_nan_information_costs_nan(name)
    laws.test_batch_equals_loop(name, (2, 3))


@every
def test_it_is_the_criterion_of_the_posterior(name):
    """The cost is that of M + R, and finite without any experiment."""
    c = make(name, P)
    base = criteria.create(name.removeprefix("bayes_"))
    M = information(1)
    assert c.cost(M) == pytest.approx(base.cost(M + c.precision), rel=1e-13)
    np.testing.assert_allclose(c.gradient(M), base.gradient(M + c.precision), rtol=1e-12)
    assert c.cost(np.zeros((P, P))) == pytest.approx(base.cost(c.precision), rel=1e-13)
    assert c.missing(np.zeros((P, P)), ("a", "b", "c", "d")) == ()
    again = criteria.from_dict(c.to_dict())
    assert again.cost(M) == c.cost(M)


@pytest.mark.parametrize("name", [*NAMES, "I", "Ds", "phi 3", "compound"])
def test_experiments_share_a_prior(name):
    """A plan of m like experiments costs ``m^-degree`` of one, where each has R/m of the prior."""
    c = make(name, P)
    M = information(2)
    for m in (1, 3, 40):
        expected = m**-c.degree * c.for_size(m).cost(M)
        assert c.cost(m * M) == pytest.approx(expected, rel=1e-12)


def test_a_prior_that_leaves_something_open():
    """A singular R is fine; what neither tells costs inf, and is named."""
    c = criteria.create("bayes_D", precision=np.diag([1.0, 0.0]))
    assert c.cost(np.diag([0.0, 2.0])) == pytest.approx(2**-0.5)
    assert c.cost(np.diag([2.0, 0.0])) == np.inf
    assert c.missing(np.diag([2.0, 0.0]), ("k1", "k2")) == ("k2",)


@every
def test_other_units(name):
    """The precision changes with the parameters; D keeps its efficiencies, A does not."""
    c = make(name, P)
    M = np.stack([information(3), information(4)])
    T = orthogonal(np.random.default_rng(0), P) * 10 ** np.linspace(-2, 2, P)
    before = c.cost(M)
    after = c.in_units(T).cost(T.T @ M @ T)
    change = after[1] / after[0] / (before[1] / before[0]) - 1
    assert c.unit_free == (abs(change) < 1e-9)


@every
def test_bound_is_tight_at_a_gradient_and_below_every_design(name):
    """Minus the gradient at M proves the cost of M; no multiplier proves more than a design has."""
    rng = np.random.default_rng(5)
    c = make(name, P)
    for _ in range(10):
        M = positive(rng, P)
        Z = -c.gradient(M)
        assert c.lower_bound(Z[None], np.array([np.sum(Z * M)]), M) == pytest.approx(
            c.cost(M), rel=1e-9
        )
        X = np.stack([positive(rng, P, 1e3) for _ in range(50)])
        for multiplier in (Z, positive(rng, P, 1e3)):
            top = np.einsum("ij,nij->n", multiplier, X).max()
            found = c.lower_bound(multiplier[None], np.array([top]), M)
            assert found <= c.cost(X).min() * (1 + 1e-9)


@pytest.mark.parametrize("precision", [np.zeros((2, 2)), [[1, 2], [2, 1]], [1, 2], [[np.nan]]])
def test_wrong_precision_is_one_line(precision):
    """It names the parameter, and what was expected."""
    with pytest.raises(CriterionError, match="criterion 'bayes_A': precision: expected"):
        criteria.create("bayes_A", precision=precision)
