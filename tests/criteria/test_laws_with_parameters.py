"""The laws of `criteria.Criterion` for criteria that need parameters, at a few sizes each."""

import inspect

import numpy as np
import pytest
import test_laws as laws
from matrices import make, positive, slip

import criteria

NAMES = (
    *("I", "c", "Ds", "phi 0", "phi 0.5", "phi 1", "phi 3"),
    *("prediction_G", "compound", "minimax"),
)
# c and Ds are finite where what they ask for is estimable: see test_interest.py.
ALL = tuple(name for name in NAMES if name not in ("c", "Ds"))
SIZES = (1, 4)

every = pytest.mark.parametrize("name", NAMES)
LAWS = (
    laws.test_gradient_is_symmetric_and_finite_even_at_kinks,
    laws.test_cost_is_homogeneous_with_its_declared_degree,
    laws.test_convex_along_segments,
    laws.test_subgradient_inequality,
    laws.test_more_information_never_costs,
    laws.test_value_cost_and_sense_agree,
    laws.test_cost_where_the_inverse_is_at_hand,
)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__.removeprefix("test_"))
@pytest.mark.parametrize("p", SIZES)
@every
def test_law(name, p, law):
    """Each law of the suite that takes a name and a size holds with parameters too."""
    assert list(inspect.signature(law).parameters) == ["name", "p"]
    law(name, p)


@pytest.mark.parametrize("decades", [0.0, 2.0])
@every
def test_gradient(name, decades):
    """The gradient is the derivative, and obeys Euler's identity, in any units."""
    laws.test_gradient_matches_finite_differences(name, 4, decades)
    laws.test_euler_identity_of_the_gradient(name, 4, decades)


@every
def test_nan_batch_and_description(name):
    """A NaN stays where it is, and a batch gives what its members give."""
    laws.test_nan_information_costs_nan(name)
    laws.test_batch_equals_loop(name, (2, 3))
    laws.test_batch_equals_loop(name, (0,))


@pytest.mark.parametrize("name", ALL)
def test_singular_information(name):
    """Where all parameters are needed, a singular M costs inf."""
    laws.test_singular_information_costs_infinity(name, 3)


@pytest.mark.parametrize("name", [n for n in NAMES if make(n, 3).unit_free])
def test_unit_free(name):
    """Where declared, the parameters' units change no efficiency."""
    laws.test_unit_free_ones_rank_alike_in_any_units(name, 4)


@pytest.mark.parametrize("name", [n for n in NAMES if not make(n, 3).unit_free])
def test_the_others_depend_on_units(name):
    """Where not declared, they do."""
    laws.test_the_others_do_depend_on_units(name)


@pytest.mark.parametrize("p", SIZES)
@every
def test_polar_is_tight_at_its_gradient_and_below_every_cost(name, p):
    """What minus the gradient at M proves is the cost of M; other multipliers never prove more."""
    rng = np.random.default_rng(p)
    c = make(name, p)
    for _ in range(5):
        M = positive(rng, p)
        X = np.stack([positive(rng, p, 1e3) for _ in range(50)])
        Z = -c.gradient(M)
        t = np.array([np.sum(Z * M)])
        assert c.lower_bound(Z[None], t, M) == pytest.approx(c.cost(M), rel=1e-7)
        for multiplier in (Z, positive(rng, p, 1e3)):
            tops = np.einsum("ij,nij->n", multiplier, X)
            best = (c.cost(X) * tops**c.degree).min()
            found = c.lower_bound(multiplier[None], np.ones(1), M)
            assert 0 < found <= best * (1 + slip(M, multiplier))
            assert c.lower_bound(multiplier[None], np.array([1e8]), M) == pytest.approx(
                1e8**-c.degree * found, rel=1e-9
            )


@every
def test_dictionary_makes_an_equal_criterion(name):
    """Name and arguments are plain, and enough."""
    c = make(name, 4)
    again = criteria.from_dict(c.to_dict())
    M = positive(np.random.default_rng(0), 4)
    assert type(again) is type(c)
    assert again.label == c.label
    assert again.cost(M) == pytest.approx(c.cost(M), rel=1e-12)
