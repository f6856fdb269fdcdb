"""Criteria with parameters: what they are, what they ask for, and where they do not appear."""

import numpy as np
import pytest
from matrices import make, positive

import criteria
from criteria import CriterionError, Interest, registry

P = 4
POINTS = np.random.default_rng(0).normal(size=(7, P))


def matrix(seed=0):
    return positive(np.random.default_rng(seed), P)


def test_criteria_with_parameters_are_not_among_those_that_are_compared():
    """`available` lists what can be used as it is, `families` what needs parameters."""
    assert criteria.families()[:5] == ("I", "c", "Ds", "phi", "prediction_G")
    assert criteria.families()[5:] == ("bayes_D", "bayes_A", "compound", "minimax")
    assert not set(criteria.families()) & set(criteria.available())
    assert not set(criteria.families()) & set(criteria.load_all().classes)
    assert all(criteria.get(name).needs_parameters for name in criteria.families())


def test_phi_leads_from_d_over_a_towards_e():
    """Order 0 is D, order 1 is A over p, and the cost grows with q towards the largest variance."""
    M = matrix()
    assert make("phi 0", P).cost(M) == pytest.approx(criteria.create("D").cost(M), rel=1e-13)
    assert make("phi 1", P).cost(M) == pytest.approx(criteria.create("A").cost(M) / P, rel=1e-13)
    half = criteria.create("O5").cost(M) ** 2 / P**2
    assert make("phi 0.5", P).cost(M) == pytest.approx(half, rel=1e-13)
    costs = [float(criteria.create("phi", q=q).cost(M)) for q in (0, 1e-6, 0.5, 1, 3, 10, 50)]
    assert costs == sorted(costs)
    worst = float(criteria.create("E").cost(M))
    assert worst * P ** (-1 / 50) <= costs[-1] < worst


def test_mean_prediction_variance_is_that_of_the_places():
    """I of points is the weighted mean of x' cov x; of several rows each, of their traces."""
    M = matrix()
    cov = np.linalg.inv(M)
    variances = np.einsum("ki,ij,kj->k", POINTS, cov, POINTS)
    w = np.arange(7.0)
    assert criteria.create("I", points=POINTS).cost(M) == pytest.approx(variances.mean())
    assert criteria.create("I", points=POINTS, weights=w).cost(M) == pytest.approx(
        variances @ w / w.sum()
    )
    pairs = POINTS[:6].reshape(3, 2, P)
    assert criteria.create("I", points=pairs).cost(M) == pytest.approx(variances[:6].sum() / 3)


@pytest.mark.parametrize("rank", [1, 2, 4])
def test_mean_prediction_variance_asks_for_no_more_than_it_needs(rank):
    """With a W of lower rank a singular M has a finite cost where it tells what W weighs."""
    rng = np.random.default_rng(rank)
    B = rng.normal(size=(rank, P)) * [1e-6, 1.0, 10.0, 1e6]
    c = criteria.create("I", W=B.T @ B)
    assert c.K.shape == (P, rank)
    assert c.needs_all == (rank == P)
    np.testing.assert_allclose(c.K @ c.K.T, B.T @ B, rtol=1e-9, atol=0)
    L = rng.normal(size=(rank, rank))
    M = B.T @ L @ L.T @ B
    assert c.cost(M) == pytest.approx(np.trace(np.linalg.inv(L @ L.T)), rel=1e-7)


def test_c_and_ds_are_interests():
    """The criterion c is the variance of c'k, Ds the determinant of a part of the covariance."""
    M = matrix()
    cov = np.linalg.inv(M)
    c = POINTS[0]
    K = POINTS[:2].T
    assert criteria.create("c", c=c).cost(M) == pytest.approx(c @ cov @ c, rel=1e-12)
    assert criteria.create("Ds", interest=K).value(M) == pytest.approx(
        np.linalg.det(K.T @ cov @ K) ** -0.5, rel=1e-12
    )
    assert criteria.create("Ds", interest=K).label.startswith("Ds of")
    singular = np.outer(c, c)
    assert criteria.create("c", c=c).cost(singular) == pytest.approx(1.0, rel=1e-9)
    assert criteria.create("c", c=POINTS[1]).cost(singular) == np.inf
    assert criteria.create("c", c=[1, 0, -2, 0]).label == "c of k1 - 2 k3"
    assert criteria.create("c", c=c).label == "c"


def test_prediction_g_is_the_largest_variance_of_a_prediction():
    """It is not the G of the paper, which is the largest variance of a parameter."""
    M = matrix()
    variances = np.einsum("ki,ij,kj->k", POINTS, np.linalg.inv(M), POINTS)
    found = criteria.create("prediction_G", points=POINTS)
    assert found.cost(M) == pytest.approx(variances.max(), rel=1e-12)
    unit = criteria.create("prediction_G", points=np.eye(P))
    assert unit.cost(M) == pytest.approx(criteria.create("G").cost(M), rel=1e-12)
    assert found.cost(M) <= found.smoothed(20.0).cost(M) <= 1.3 * found.cost(M)


def test_interest_of_a_family():
    """Kiefer's phi can be about a part of the parameters; what has a meaning of its own cannot."""
    K = np.eye(P)[:, :2]
    M = matrix()
    part = np.linalg.inv(np.linalg.inv(M)[:2, :2])
    c = criteria.create("phi", q=2, interest=K)
    assert isinstance(c, Interest)
    assert c.cost(M) == pytest.approx(criteria.create("phi", q=2).cost(part), rel=1e-12)
    again = criteria.from_dict(c.to_dict())
    assert again.cost(M) == pytest.approx(c.cost(M), rel=1e-12)
    with pytest.raises(CriterionError, match="says by itself what is of interest"):
        criteria.create("I", W=np.eye(P), interest=K)


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("I", {}, "needs W or points or root"),
        ("I", {"root": [[1.0, 2.0]]}, "root: expected a finite matrix"),
        ("I", {"root": np.ones((3, 2))}, "root: expected columns that do not follow"),
        ("I", {"root": np.outer([1e20, 1, 1e-9], [1, 3])}, "root: expected columns that do not"),
        ("I", {"root": np.eye(3, 2) @ np.diag([1, 0])}, "root: expected columns that do not"),
        (
            "I",
            {"points": np.zeros((2, 2))},
            "not all zero: what the model's p parameters are multi",
        ),
        ("I", {"W": np.eye(2), "points": np.eye(2)}, "expected one of them"),
        ("I", {"W": np.eye(2), "weights": [1, 1]}, "weights belong to points"),
        ("I", {"W": [[1, 2], [2, 1]]}, "W: expected a positive semidefinite matrix"),
        ("I", {"W": [[1, 2], [0, 9]]}, "W: expected a symmetric matrix"),
        ("I", {"W": np.zeros((2, 2))}, "not zero"),
        ("I", {"W": [1, 2]}, "expected a finite square matrix"),
        ("I", {"points": [1, 2]}, "expected finite regressors"),
        ("I", {"points": np.eye(2), "weights": [1, -1]}, "a weight of each point"),
        ("I", {"points": "abc"}, "points: expected finite regressors"),
        ("c", {"c": [10**400]}, "wrong parameters: int too large"),
        ("c", {"c": {"a": 1}}, "wrong parameters"),
        ("c", {}, "needs c; its parameters: c"),
        ("c", {"c": [0, 0]}, "not all zero"),
        ("c", {"c": [[1, 0]]}, "expected a vector"),
        ("Ds", {}, "needs interest"),
        ("Ds", {"interest": np.ones((3, 2))}, "follows from the others"),
        ("phi", {"q": -1}, "not -1"),
        ("phi", {"q": "2"}, "not '2'"),
        ("phi", {"q": np.inf}, "for infinity, use E"),
        ("phi", {"p": 1}, "has no parameter 'p'; expected q"),
        ("prediction_G", {"points": np.zeros((3, 2))}, "not all zero"),
        ("D", {"q": 1}, "has no parameter 'q'"),
    ],
)
def test_wrong_parameters_are_one_line(name, given, expected):
    """The line names the criterion or the parameter, and what was expected."""
    with pytest.raises(CriterionError, match=expected) as caught:
        criteria.create(name, **given)
    assert "\n" not in str(caught.value)


def test_a_plug_in_with_parameters(monkeypatch):
    """It is made from its parameters, and in no comparison; a missing one is named."""
    monkeypatch.setattr("criteria.registry._registered", dict(registry._registered))

    @criteria.register
    class Weighted(criteria.Criterion):
        """The variance of one parameter."""

        name = "one"
        title = "One parameter"
        formula = "cov_ii"
        sense = "min"
        degree = 1.0
        needs_parameters = True

        def __init__(self, i):
            self.i = i

        def _cost(self, M, cov):
            return cov[..., self.i, self.i]

        def _gradient(self, M, cov):
            column = cov[..., :, self.i]
            return -column[..., :, None] * column[..., None, :]

    assert "one" in criteria.families()
    assert "one" not in criteria.available()
    assert "one" not in criteria.load_all().classes
    assert criteria.create("one", i=1).cost(np.diag([1.0, 4.0])) == 0.25
    with pytest.raises(CriterionError, match="'one' needs i; its parameters: i"):
        criteria.create("one")


@pytest.mark.parametrize("name", ["I", "c", "Ds", "prediction_G", "bayes_D", "compound", "minimax"])
def test_another_number_of_parameters_is_one_line(name):
    """The line says how many the criterion is about, wherever it is used."""
    given = {"criteria": ["D", make("I", 2)]}
    c = make(name, 2) if name not in ("compound", "minimax") else criteria.create(name, **given)
    for ask in (c.cost, c.gradient):
        with pytest.raises(CriterionError, match="is about 2 parameters; expected 4"):
            ask(matrix())
    with pytest.raises(CriterionError, match="is about 2 parameters; expected 3"):
        criteria.create("minimax", criteria=[make("I", 3), make("I", 2)])


def test_points_keep_digits_that_their_squares_lose():
    """Of polynomials on [10, 11] W is known to a few digits, and its root to all of them."""
    X = np.vander(np.linspace(10, 11, 30), 5, increasing=True)
    T = np.linalg.inv(np.linalg.qr(X, mode="r"))  # parameters in which nothing is lost
    c = criteria.create("I", points=X)
    assert c.K.shape == (5, 5)
    assert c.in_units(T).cost(np.eye(5)) == pytest.approx(5 / 30, rel=1e-6)
    again = criteria.from_dict(c.to_dict())
    np.testing.assert_array_equal(again.K, c.K)


def test_what_may_stand_for_a_criterion():
    """Itself, its name, or a table with its parameters."""
    c = criteria.create("D")
    assert criteria.as_criterion(c) is c
    assert criteria.as_criterion("A").name == "A"
    assert criteria.as_criterion({"name": "phi", "q": 2}).label == "phi (q = 2)"
    for wrong in (3, {"q": 2}, None):
        with pytest.raises(CriterionError, match="a criterion, its name or a table with a name"):
            criteria.as_criterion(wrong)


def test_a_criterion_of_some_parameters_keeps_the_order_of_its_mean():
    """The label and the title of phi of two parameters have q, and Ds is not called D."""
    names = ("k1", "k2", "k3")
    given = {"name": "phi", "q": 2, "interest": ["k2", "k3"]}
    found = criteria.as_criterion(given, names)
    assert found.label == "phi (q = 2) of k2, k3"
    assert found.title == "Kiefer's phi_q (q = 2) of k2, k3"
    assert criteria.as_criterion({"name": "Ds", "interest": ["k2"]}, names).label == "Ds of k2"


def test_a_table_calls_parameters_as_the_model_does():
    """Labels and titles have the model's names, parts of other criteria included."""
    names = ("one", "x", "xx")
    assert criteria.as_criterion({"name": "c", "c": {"x": 1, "xx": -2}}, names).label == (
        "c of x - 2 xx"
    )
    found = criteria.as_criterion({"name": "phi", "q": 2, "interest": ["xx"]}, names)
    assert found.label == "phi (q = 2) of xx"
    assert found.in_units(np.diag([1.0, 2.0, 3.0])).label == found.label
    parts = ["D", {"name": "c", "c": {"x": 1}}]
    both = criteria.as_criterion({"name": "compound", "criteria": parts}, names)
    assert both.label == "compound of D, c of x"
    assert both.title.endswith("of D, c of x")
    assert both.cost(np.eye(3)) == criteria.from_dict(both.to_dict()).cost(np.eye(3))
    assert found.named(("a", "b")) is found
