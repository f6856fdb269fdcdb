"""Compound and minimax: what they are made of, several models, and their bounds."""

import numpy as np
import pytest
from matrices import make, positive

import criteria
from criteria import CriterionError

P = 4
create = criteria.create


def information(seed=0):
    return positive(np.random.default_rng(seed), P)


def test_costs_are_means_and_maxima_of_losses():
    """A loss is the cost by the best one, to the power of one by the degree."""
    M = information()
    given = [create("D"), create("rho0", target=np.eye(P)), create("I", W=np.eye(P))]
    best = [2.0, 0.3, 0.1]
    costs = np.array([float(c.cost(M)) for c in given])
    losses = [costs[0] * 2.0, (costs[1] / 0.3) ** 2, costs[2] / 0.1]
    compound = create("compound", criteria=given, weights=[1, 1, 2], best=best)
    expected = (losses[0] * losses[1] * losses[2] ** 2) ** 0.25
    assert compound.cost(M) == pytest.approx(expected, rel=1e-12)
    assert create("minimax", criteria=given, best=best).cost(M) == pytest.approx(max(losses))
    assert create("compound", criteria=["D"]).cost(M) == pytest.approx(costs[0], rel=1e-12)


def test_names_and_tables_make_parts():
    """A part is a criterion, a name, or a table with a name: as a study's file has it."""
    c = create("minimax", criteria=["D", {"name": "phi", "q": 2}, create("A")])
    assert c.label == "minimax of D, phi (q = 2), A"
    again = criteria.from_dict(c.to_dict())
    assert again.cost(information()) == pytest.approx(c.cost(information()), rel=1e-13)


@pytest.mark.parametrize("kind", ["compound", "minimax"])
def test_models_side_by_side(kind):
    """With sizes each criterion sees its own block, and the others may be singular."""
    A = positive(np.random.default_rng(1), 2)
    B = positive(np.random.default_rng(2), 3)
    M = np.zeros((5, 5))
    M[:2, :2] = A
    M[2:, 2:] = B
    c = create(kind, criteria=["D", create("c", c=[1.0, 0, 0])], sizes=[2, 3])
    losses = c.losses(M, np.linalg.inv(M))
    expected = [create("D").cost(A), np.linalg.inv(B)[0, 0]]
    np.testing.assert_allclose(losses, expected, rtol=1e-12)
    again = criteria.from_dict(c.to_dict())
    assert again.cost(M) == pytest.approx(c.cost(M), rel=1e-13)
    M[2:, 2:] = np.diag([2.0, 0.0, 0.0])
    np.testing.assert_allclose(c.cost(M), c._cost(M, np.linalg.pinv(M)), rtol=1e-12)
    M[2:, 2:] = np.diag([0.0, 1.0, 1.0])
    assert c.cost(M) == np.inf
    assert c.missing(M, ("a", "b", "c", "d", "e")) == ("c",)


@pytest.mark.parametrize("kind", ["compound", "minimax"])
@pytest.mark.slow
def test_bound_of_any_parts_and_design(kind):
    """Near any M, and for any multiplier, the bound is below the cost of every design."""
    rng = np.random.default_rng(3)
    given = [create("c", c=rng.normal(size=P)), create("Ds", interest=rng.normal(size=(P, 2)))]
    for parts in (given, ["D", *given]):
        c = create(kind, criteria=parts)
        for _ in range(10):
            Z = positive(rng, P, 1e3)
            X = np.stack([positive(rng, P, 1e2) for _ in range(100)])
            X /= np.einsum("ij,nij->n", Z, X)[:, None, None]
            found = c.lower_bound(Z[None], np.ones(1), positive(rng, P, 1e2))
            assert 0 < found <= c.cost(X).min() * (1 + 1e-9)
        low = np.outer(parts_of := rng.normal(size=P), parts_of)
        assert c.lower_bound(low[None], np.ones(1), information()) <= c.cost(X).min()
    assert c.lower_bound(np.zeros((1, P, P)), np.ones(1), information()) == 0


def test_minimax_bound_splits_a_multiplier_between_equal_losses():
    """Where two losses are the largest, a mean of their slopes proves what each alone does not."""
    c = create("minimax", criteria=[create("c", c=[1.0, 0]), create("c", c=[0, 1.0])])
    M = np.eye(2)
    Z = np.diag([0.3, 0.3])
    t = np.array([0.6])  # the largest <Z, X> of designs of trace two
    assert c.lower_bound(Z[None], t, M) == pytest.approx(1.0, rel=1e-9)
    only = np.diag([0.3, 0.0])
    assert c.lower_bound(only[None], t, M) == pytest.approx(0.5, rel=1e-9)


def test_soft_maximum_and_units():
    """A smooth criterion lies above; in other units the losses are the same."""
    c = make("minimax", P)
    M = information()
    assert not c.smooth
    assert c.smoothed(30.0).smooth
    assert c.cost(M) <= c.smoothed(30.0).cost(M) <= c.cost(M) * 3 ** (1 / 30)
    free = create("minimax", criteria=["D", make("I", P)], best=[3.0, 0.5])
    T = np.diag([1e-4, 1.0, 30.0, 1e5])
    assert free.in_units(T).cost(T @ M @ T) == pytest.approx(free.cost(M), rel=1e-9)


@pytest.mark.parametrize("name", ["compound", "minimax"])
def test_other_parameters(name):
    """As functions of ``T'M T`` costs and bounds are those of M."""
    rng = np.random.default_rng(7)
    T = rng.normal(size=(P, P))
    M = information()
    given = ["D", "A", "O1", make("I", P), make("Ds", P)]
    for parts in (given, given[3:]):
        c = create(name, criteria=parts)
        other = c.transformed(T)
        assert other.cost(T.T @ M @ T) == pytest.approx(c.cost(M), rel=1e-10)
        Z = -c.gradient(M)
        S = np.linalg.inv(T)
        bounds = other.lower_bound((S @ Z @ S.T)[None], np.ones(1), T.T @ M @ T)
        assert bounds == pytest.approx(c.lower_bound(Z[None], np.ones(1), M), rel=1e-7)
        assert c.lower_bound(-Z[None], np.ones(1), M) == 0


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("compound", {"criteria": []}, "at least one criterion"),
        ("compound", {"criteria": ["E"]}, "'E' cannot be a part of it"),
        ("compound", {"criteria": ["O2"]}, "'O2' cannot be a part of it"),
        ("minimax", {"criteria": ["G", "D"]}, "'G' cannot be a part of it"),
        ("compound", {"criteria": ["O5"]}, "logarithm of 'O5' has no convex form"),
        ("compound", {"criteria": ["D"], "weights": [0]}, "weights: expected a positive weight"),
        ("compound", {"criteria": ["D"], "best": [1, 2]}, "best: expected a positive value"),
        ("minimax", {"criteria": ["D"], "best": [-1]}, "best: expected a positive value"),
        ("minimax", {"criteria": ["D", "A"], "sizes": [2]}, "sizes: expected a positive number"),
        ("minimax", {"criteria": [7]}, "a criterion, its name or a table with a name, not 7"),
        ("minimax", {"criteria": [{"q": 7}]}, "a criterion, its name or a table with a name"),
        ("minimax", {"criteria": ["I"]}, "'I' needs W or points"),
        ("minimax", {"criteria": [{"name": "bayes_D", "precision": [[1.0]]}]}, "cannot be a part"),
        (
            "minimax",
            {"criteria": [{"name": "c", "c": [1, 2]}, "D"], "sizes": [3, 2]},
            "is about 2 parameters, and its model has 3",
        ),
    ],
)
def test_wrong_parts_are_one_line(name, given, expected):
    """The line says which part, and what was expected."""
    with pytest.raises(CriterionError, match=expected) as caught:
        create(name, **given)
    assert "\n" not in str(caught.value)
