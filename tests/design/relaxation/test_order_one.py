"""Regressors of any order of magnitude have the same optimal design."""

import numpy as np
import pytest
from exact_costs import arguments, exact_cost, excess
from matrices import make

import criteria
import edtk
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.setting import OrderOne
from edtk.system.errors import UserError

ROWS = np.random.default_rng(0).normal(size=(12, 2, 3))
CRITERIA = {name: make(name, 3) for name in criteria.available()} | {
    "c": criteria.create("c", c=[1.0, 2.0, 0.0]),
    "I": criteria.create("I", W=np.eye(3)),
    "Ds": criteria.create("Ds", interest=np.eye(3)[:, :2]),
    "phi": criteria.create("phi", q=2.0),
    "prediction_G": criteria.create("prediction_G", points=ROWS[:5, 0]),
}
# Weights where a cost is smooth, and where it is flat up to the gap; costs are sharper.
SAME = {True: 1e-9, False: 1e-6}


@pytest.mark.parametrize("name", CRITERIA)
def test_powers_of_two_change_no_digit(name):
    """Rows of the order 1e-150 or 1e150 have the weights of the same rows of order one."""
    criterion = CRITERIA[name]
    plain = relax(Problem(ROWS), criterion)
    assert plain.gap <= 1e-6
    for power in (-498, 498):
        problem = Problem(np.ldexp(ROWS, power))
        found = relax(problem, criterion)
        assert np.abs(found.weights - plain.weights).max() <= SAME[criterion.smooth]
        log = np.log(found.cost) + 2 * criterion.degree * power * np.log(2.0)
        assert log == pytest.approx(np.log(plain.cost), abs=1e-8)
        assert found.gap == pytest.approx(plain.gap, abs=1e-8)
        cost, bound = found.certify(problem)
        assert cost == pytest.approx(found.cost, rel=1e-9)
        assert bound == pytest.approx(found.proved_bound.cost, rel=1e-9)


@pytest.mark.parametrize("name", ["A", "O2"])
def test_exact_plans(name):
    """The best plan of whole experiments is the same, and so is its distance from the bound."""
    criterion = CRITERIA[name]
    plain, *others = [
        edtk.plan(edtk.Problem(np.ldexp(ROWS, power)), 5, criterion, seed=0, starts=1)
        for power in (0, -498, 498)
    ]
    for found in others:
        assert (found.counts == plain.counts).all()
        assert found.efficiency == pytest.approx(plain.efficiency, rel=1e-6)


def test_regions_of_such_rows_are_refused():
    """One line says which rows are expected."""
    region = edtk.Region(lambda x: 1e-140 * np.stack([np.ones(len(x)), x[:, 0]], axis=-1), -1, 1)
    with pytest.raises(
        UserError, match=r"rows: they are of the order 1e-140, .* expected 1e-50 to"
    ):
        edtk.relax(region, "D")


def test_information_and_a_prior():
    """Squares alone, and a prior beside the candidates, are brought to order one with them."""
    prior = np.diag([1.0, 2.0, 0.0])
    plain = Problem.of_information(Problem(ROWS).packed, prior=prior)
    tiny = Problem.of_information(np.ldexp(plain.packed, -900), prior=np.ldexp(prior, -900))
    sized = OrderOne.of(tiny)
    assert 0.1 < np.trace(sized.problem.mean) < 1e3
    good = relax(plain, criteria.create("D"))
    found = relax(tiny, criteria.create("D"))
    assert found.weights == pytest.approx(good.weights, abs=1e-9)
    assert found.gap <= 1e-6


def test_bayesian_criterion():
    """A precision of the order of the information is a part of it."""
    found = [
        relax(
            Problem(np.ldexp(ROWS, power)),
            criteria.create("bayes_A", precision=np.ldexp(np.eye(3), 2 * power)),
        )
        for power in (0, -480)
    ]
    assert found[1].weights == pytest.approx(found[0].weights, abs=1e-9)
    assert np.log2(found[1].cost / found[0].cost) == pytest.approx(960)


def test_problems_of_ordinary_size_stay_as_they_are():
    """No copy is made of candidates that need none."""
    problem = Problem(1e-20 * ROWS)
    assert OrderOne.of(problem).problem is problem


def test_a_cost_beyond_doubles():
    """What cannot be told is said in one line; a criterion that can be told is."""
    problem = Problem(1e-170 * ROWS)
    with pytest.raises(UserError, match=r"'A': a cost of 1e\+340 is beyond floating-point numbers"):
        relax(problem, criteria.create("A"))
    assert relax(problem, criteria.create("O5")).cost == pytest.approx(
        1e170 * relax(Problem(ROWS), criteria.create("O5")).cost, rel=1e-6
    )


FAR = 10.0 ** np.array([-70.0, 0.0, 70.0])  # units of three parameters


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "c", "I", "Ds", "phi", "prediction_G"])
def test_parameters_in_far_units(name, tmp_path):
    """Columns that are 140 decades apart have a proved design, with the digits that it states."""
    rows = ROWS * FAR
    own = arguments(name, np.random.default_rng(1), rows)
    if name == "Ds":
        own = {"interest": np.eye(3)[:, :2]}
    problem = edtk.Problem(rows)
    found = edtk.relax(problem, {"name": name, **own}, certificate=tmp_path / "c.json")
    assert found.gap <= 1e-6
    exact = exact_cost(name, rows, found.weights, own)
    assert abs(excess(found.cost, exact)) <= found.accuracy <= 1e-6
    assert excess(found.proved_bound.cost, exact) <= 0
    assert edtk.verify(tmp_path / "c.json", problem).valid


def test_parameters_in_units_beyond_doubles():
    """Squares of their information are no doubles: one line names both, and how far is too far."""
    problem = Problem(ROWS * FAR**1.2, parameters=("near", "middle", "far"))
    with pytest.raises(UserError, match=r"of far and near are 168 decades apart, .* at most 150"):
        relax(problem, criteria.create("D"))


@pytest.mark.parametrize("name", ["c", "Ds"])
@pytest.mark.parametrize("unit", [1e-100, 1e-80, 1e80, 1e100])
def test_combinations_in_far_units(name, unit):
    """They have the proof of the same combinations of order one, whose rows are ill-conditioned."""
    K = np.array([[1.0, 0.0], [1.0, 1.0], [0.5, -1.0]])
    rows = ROWS + np.array([1e4, 0, 0])

    given = {"c": {"c": K[:, 0]}, "Ds": {"interest": K}}[name]
    near, far = (
        relax(
            Problem(rows), criteria.create(name, **{key: size * own for key, own in given.items()})
        )
        for size in (1.0, unit)
    )
    assert far.gap <= 1e-6
    assert far.cost / unit / unit == pytest.approx(near.cost, rel=1e-9)


@pytest.mark.parametrize("seed", [10, 16, 24, 40])
def test_designs_that_are_all_but_singular_in_far_units(seed):
    """The inverse of such a design loses digits of a combination, which the accuracy counts."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(12, 1, 4)) * rng.normal(size=(1, 5, 1))
    rows = (rows + 1e-8 * rng.normal(size=(12, 5, 4))) * 10.0 ** np.array([-25, 3, 0, 25])
    c = {"c": rows[0, 0] + rows[-1, 0]}
    found = relax(Problem(rows), criteria.create("c", **c))
    exact = exact_cost("c", rows, found.weights, c)
    assert abs(excess(found.cost, exact)) <= found.accuracy
    assert excess(found.proved_bound.cost, exact) <= 0


@pytest.mark.parametrize("name", ["c", "prediction_G", "rho0"])
@pytest.mark.parametrize("seed", range(2))
def test_combinations_of_nearly_dependent_parameters(seed, name, tmp_path):
    """Their terms cancel, but the cost keeps the digits of which the check makes sure."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(9, 2, 3))
    rows[..., -1] = rows[..., 0] + 1e-9 * rows[..., -1]
    own = {"target": rows[0]} if name == "rho0" else arguments(name, rng, rows)
    problem = edtk.Problem(rows)
    found = edtk.relax(problem, {"name": name, **own}, certificate=tmp_path / "c.json")
    assert abs(excess(found.cost, exact_cost(name, rows, found.weights, own))) <= 1e-8
    assert edtk.verify(tmp_path / "c.json", problem).valid
