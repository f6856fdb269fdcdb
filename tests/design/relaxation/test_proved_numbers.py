"""A number called proved is never wrong: costs and bounds against arithmetic of 50 digits."""

import numpy as np
import pytest
from exact_costs import COSTS, KINDS, arguments, exact_cost, excess, rows_of

import criteria
import edtk
from edtk.design.bound import Bound, BoundKind
from edtk.design.problem import RankDeficientError

GAP = 1e-6
LARGE = 1e11  # condition number from which a model may be refused
SCALES = (1.0, 1e-100, 1e-30, 1e-12, 1e12, 1e17, 1e100)
MOST = {"O4": 3}  # parameters, where a family of programs takes long
every = pytest.mark.parametrize("name", COSTS)


CASES = [
    (kind, condition, r, p)
    for i, kind in enumerate(KINDS)
    for condition, r, p in [
        (1e12, 6, 2 + i % 2),
        (1e11, 1 + i, 4),
        (1e9, 5, 3),
        (1e6, 3, 6 - i),
        (1e3, 4, 2),
        (1.0, 2 + i, 1),
    ]
]


@every
@pytest.mark.parametrize("kind", KINDS)
def test_cost_and_bound_are_right_in_fifty_digits(name, kind):
    """Costs are wrong by less than is told, and no bound is above the cost of its own weights.

    Experiments have fewer rows than parameters, and more; condition numbers are up to 1e12. A model
    that doubles cannot hold is refused in words.
    """
    cases = [case for case in CASES if case[0] == kind]
    checked = 0
    for i, (_, condition, r, p) in enumerate(cases):
        rng = np.random.default_rng([i, r, p])
        p = min(p, MOST.get(name, p))
        rows = rows_of(kind, rng, r, p, condition)
        given = arguments(name, rng, rows)
        problem = edtk.Problem(rows)
        try:
            found = edtk.relax(problem, criteria.create(name, **given))
        except RankDeficientError:
            assert condition >= LARGE
            continue
        exact = exact_cost(name, rows, found.weights, given)
        if exact is None:
            continue
        checked += 1
        assert abs(excess(found.cost, exact)) <= found.accuracy
        assert excess(found.proved_bound.cost, exact) <= 0
        assert excess(found.certify(problem)[1], exact) <= 0
        assert 0 <= found.gap <= 10 * GAP + found.accuracy
    assert checked >= 3


@pytest.mark.parametrize(
    ("name", "seed", "shape"),
    [(name, 2, (10, 5, 5)) for name in COSTS] + [("G", 47, (10, 5, 5)), ("G", 9, (30, 6, 6))],
)
def test_no_scale_of_the_rows_lifts_a_bound_above_its_cost(name, seed, shape):
    """Rows of any order of magnitude have the same design, gap and certificate."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=shape)
    given = arguments(name, rng, rows)
    costs = []
    for scale in SCALES:
        criterion = criteria.create(name, **given)
        problem = edtk.Problem(rows * scale)
        found = edtk.relax(problem, criterion)
        assert 0 <= found.gap <= GAP
        cost, bound = found.certify(problem)
        assert bound <= cost
        assert bound == pytest.approx(found.proved_bound.cost, rel=GAP)
        costs.append(found.cost * scale ** (2 * criterion.degree))
    assert costs == pytest.approx([costs[0]] * len(costs), rel=2 * GAP)


@pytest.mark.parametrize("name", ["Ds", "c", "A"])
@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1e12, 1e17])
def test_a_parameter_that_nothing_tells_has_no_size_of_its_own(name, scale):
    """Of interest are the others: in any units they have the design that they have without it."""
    rows = np.random.default_rng(3).normal(size=(12, 2, 4))
    rows[..., -1] = 0.0
    K = np.eye(4)[:, :2]
    given = {"c": K.sum(axis=1)} if name == "c" else {"interest": K}
    plain = edtk.relax(edtk.Problem(rows), criteria.create(name, **given))
    found = edtk.relax(edtk.Problem(rows * scale), criteria.create(name, **given))
    assert found.cost * scale**2 == pytest.approx(plain.cost, rel=2 * GAP)
    assert 0 <= found.gap <= GAP


@pytest.mark.parametrize("unit", [8e4, 5e6, 3e15])
@pytest.mark.parametrize("p", [4, 6])
def test_combinations_across_uneven_units(unit, p):
    """Combinations of parameters in units that are decades apart keep their digits."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(p + 6, 1 + 2 * seed, p))
        rows[..., ::2] *= unit
        given = {"interest": rng.normal(size=(p, p - seed))}
        found = edtk.relax(edtk.Problem(rows), criteria.create("Ds", **given))
        exact = exact_cost("Ds", rows, found.weights, given)
        assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-8
        assert excess(found.proved_bound.cost, exact) <= 0
        assert found.gap <= GAP


@pytest.mark.parametrize("unit", [1e14, 1e16, 3e18])
@pytest.mark.parametrize("name", ["O2", "O4"])
def test_ratios_of_eigenvalues_in_units_beyond_all_digits(name, unit):
    """Both extreme eigenvalues are largest ones: of the information, and of its inverse."""
    for seed in (1, 4):
        rows = np.random.default_rng(seed).normal(size=(10, 3, 4))
        rows[..., -1] *= unit
        found = edtk.relax(edtk.Problem(rows), criteria.create(name))
        exact = exact_cost(name, rows, found.weights, {})
        assert abs(excess(found.cost, exact)) <= found.accuracy
        assert 0 <= found.gap <= 10 * GAP


@pytest.mark.slow
@pytest.mark.parametrize("name", ["A", "D", "G", "c", "I"])
def test_regions_of_ill_conditioned_models(name):
    """Designs over a region have exact costs within what is told, and bounds below them."""
    shifts = np.array([0.0, 0.2, 0.3])

    def rows(x):
        return (x[:, :1] + shifts)[..., None] ** np.arange(3)

    given = arguments(name, np.random.default_rng(0), rows(np.array([[700.0], [701.0]])))
    found = edtk.relax(edtk.Region(rows, 700, 701), criteria.create(name, **given))
    exact = exact_cost(name, rows(found.points), found.weights, given)
    assert abs(excess(found.cost, exact)) <= found.accuracy
    for bound in (found.grid_bound, found.searched_bound, found.on_grid().proved_bound):
        assert excess(bound.cost, exact) <= 0
    assert 0 <= found.gap <= GAP + found.accuracy


def test_a_bound_above_the_cost_of_its_own_design_is_never_returned():
    """Rounding is lowered onto the cost; a contradiction says nothing."""

    def bound(cost, **rounding):
        return Bound.of(criteria.create("A"), cost, 2.0, BoundKind.PROVED_ON_CANDIDATES, **rounding)

    assert bound(2.0 * (1 + 1e-12)).cost == 2.0
    assert bound(2.0 * (1 + 1e-12)).gap == 0.0
    assert bound(1084.0).cost == 0.0
    assert bound(np.nan).cost == 0.0
    assert bound(1.0, error=0.25).cost == 0.75
    assert bound(1.0, error=2.0).cost == 0.0
