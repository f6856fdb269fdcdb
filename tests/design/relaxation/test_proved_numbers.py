"""A number called proved is never wrong: costs and bounds against arithmetic of 50 digits."""

import json
from dataclasses import replace

import numpy as np
import pytest
from exact_costs import COSTS, KINDS, arguments, exact_cost, excess, rows_of
from pairs import some_pairs

import criteria
import edtk
from edtk.design.bound import Bound, BoundKind, printed_form
from edtk.design.problem import RankDeficientError

GAP = 1e-6
LARGE = 1e11  # condition number from which a model may be refused
SCALES = (1.0, 1e-100, 1e-30, 1e-12, 1e12, 1e17, 1e100)
MOST = {"O4": 3}  # parameters, where a family of programs takes long


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


@pytest.mark.parametrize(("name", "kind"), some_pairs(list(COSTS), KINDS, 2))
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


@pytest.mark.long_doubles
@pytest.mark.parametrize(
    ("name", "kind"), some_pairs(list(COSTS), [(KINDS[0], 1e8, 6, 3), (KINDS[3], 1e6, 2, 3)])
)
def test_rows_are_whitened_before_they_are_divided_by_their_noise(name, kind):
    """Division rounds entry by entry, and would hide what tells nearly dependent columns apart."""
    kind, condition, r, p = kind
    rng = np.random.default_rng([r, p])
    p = min(p, MOST.get(name, p))
    rows = rows_of(kind, rng, r, p, condition)
    sigma = rng.uniform(0.1, 3.0, size=r)
    given = arguments(name, rng, rows)
    problem = edtk.Problem(rows, sigma)
    found = edtk.relax(problem, criteria.create(name, **given))
    exact = exact_cost(name, rows, found.weights, given, sigma=sigma)
    assert abs(excess(found.cost, exact)) <= found.accuracy
    assert excess(found.proved_bound.cost, exact) <= 0
    assert excess(found.certify(problem)[1], exact) <= 0
    assert _verified(found, problem).claims[3].holds


def _verified(found, problem, **forged):
    """What the second implementation says of a certificate that went through JSON."""
    return edtk.verify(json.loads(json.dumps(found.to_dict() | forged)), problem)


SEVERAL = {
    "compound": {"criteria": ["A", "D", "O1"], "best": [1e-3, 1.0, 1e3]},
    "minimax": {"criteria": ["A", "D"]},
}


@pytest.mark.long_doubles
@pytest.mark.parametrize(("name", "kind"), some_pairs([*COSTS, *SEVERAL], KINDS, 2))
def test_true_proofs_are_confirmed_and_no_bound_above_the_cost(name, kind):
    """The second implementation has the digits that a proof needs, whatever the units.

    A bound above the cost of its own design is refused, if by 1e-10 of it.
    """
    for condition, r, p in [(1e8, 5, 3), (1e4, 2, 4), (1e2, 1, 2)]:
        p = min(p, MOST.get(name, p))
        rng = np.random.default_rng([r, p, KINDS.index(kind)])
        rows = rows_of(kind, rng, r, p, condition)
        given = SEVERAL.get(name) or arguments(name, rng, rows)
        if name == "minimax":
            best = [edtk.relax(edtk.Problem(rows), part).value for part in given["criteria"]]
            given = {**given, "best": best}
        problem = edtk.Problem(rows)
        found = edtk.relax(problem, criteria.create(name, **given))
        told = _verified(found, problem)
        assert told.valid, told.claims
        above = printed_form(
            found.cost * (1 + max(1e-10, 3 * found.accuracy)), found.told_bound.sense
        )
        assert "bound" in _verified(found, problem, bound=above).failed


@pytest.mark.parametrize("scale", [1.0, 1e-12])
def test_designs_that_leave_directions_open_are_found(scale):
    """The mean variance at three places is least with measurements there, and nowhere else.

    Little weight elsewhere does not make such a design clearly regular; it is none the worse.
    """
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(8, 1, 5))
    rows[..., 3:] = rows[..., :2] + rows[..., 3:] / 100
    found = edtk.relax(
        edtk.Problem(scale * rows), criteria.create("I", points=scale * rows[[1, 3, 5], 0])
    )
    assert found.cost == pytest.approx(3.0, rel=GAP)
    assert 0 <= found.gap <= GAP


@pytest.mark.parametrize("name", ["c", "I", "Ds", "A"])
def test_information_of_units_that_are_far_apart_is_as_exact_as_rows(name):
    """No entry that was given is taken for the rounding of a zero."""
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(9, 3, 4)) * np.array([3e15, 1.0, 3e15, 1.0])
    given = arguments(name, rng, rows)
    criterion = criteria.create(name, **given)
    found = edtk.relax(edtk.Problem.of_information(edtk.Problem(rows).packed), criterion)
    assert found.cost == pytest.approx(edtk.relax(edtk.Problem(rows), criterion).cost, rel=GAP)


@pytest.mark.parametrize("name", ["G", "A", "E", "rho_max", "D"])
@pytest.mark.parametrize("scale", [1.0, 1e100])
def test_proofs_within_limits_are_confirmed_where_columns_are_nearly_dependent(name, scale):
    """The limits' own multipliers follow from the multipliers that have all their digits."""
    rng = np.random.default_rng(3)
    rows = rows_of(KINDS[0], rng, 2, 4, 1e8)
    given = arguments(name, rng, rows)
    problem = edtk.Problem(scale * rows)
    found = edtk.relax(problem, criteria.create(name, **given), size=8, most=2)
    told = _verified(found, problem)
    assert told.valid, told.claims


def test_a_bound_that_says_nothing_is_stated_as_none():
    """A maximised criterion prints it as infinite, which JSON does not know."""
    rows = np.random.default_rng(7).normal(size=(9, 1, 3))
    problem = edtk.Problem(rows)
    found = edtk.relax(problem, "D")
    poor = replace(found, multipliers=np.zeros((1, 3, 3)))
    assert poor.to_dict()["bound"] is None
    told = _verified(poor, problem)
    assert told.failed == ("bound", "gap")
    assert told.claims[3].stated is None


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
