"""Plans of nearly dependent parameters: values and bounds against arithmetic of 50 digits."""

import mpmath
import numpy as np
import pytest
from exact_costs import (
    COSTS,
    DIGITS,
    KINDS,
    arguments,
    exact_cost,
    exact_information,
    excess,
    rows_of,
)
from pairs import some_pairs

import criteria
import edtk
from edtk.design.problem import RankDeficientError
from edtk.system.errors import UserError

LARGE = 1e11  # condition number from which a model may be refused
# Rows an experiment, parameters, condition number, size of the rows, what is known besides.
CASES = [
    (1, 2, 1e7, 1.0, "kept candidates"),
    (2, 3, 1e9, 1e-100, "kept experiments"),
    (3, 2, 1e12, 1.0, "nothing"),
    (4, 3, 1e5, 1e12, "a prior"),
    (5, 2, 1e10, 1e100, "kept candidates"),
    (6, 4, 1e6, 1.0, "a prior and kept candidates"),
]
MOST = {"O2": 2, "O4": 2}  # parameters, where a family of programs takes long


def question(name, kind, case):
    """A problem with what is known besides, in floating-point numbers and exactly."""
    r, p, condition, scale, besides = case
    p = min(p, MOST.get(name, p))
    rng = np.random.default_rng([r, p, KINDS.index(kind)])
    rows = rows_of(kind, rng, r, p, condition)
    criterion = arguments(name, rng, rows)
    rows = rows * scale
    size = p + 4
    keep = None
    prior = None
    with mpmath.workdps(DIGITS):
        beside = mpmath.matrix(p)
        if "candidates" in besides:
            keep = [0, 3, 3]
        if besides == "kept experiments":
            kept = rows[:3] * 1.5
            keep = edtk.Problem(kept)
            beside += exact_information(kept, np.ones(3))
        if "prior" in besides:
            prior = np.diag(np.square(rows).sum(axis=1).mean(axis=0)) * 1e-9
            beside += size * mpmath.matrix(prior.tolist())
    return rows, criterion, beside, {"size": size, "keep": keep}, prior


@pytest.mark.parametrize(("name", "kind"), some_pairs(list(COSTS), KINDS, 2))
def test_value_and_bound_of_plans_are_right_in_fifty_digits(name, kind):
    """A plan's cost is wrong by less than is told, and no bound is above its exact cost.

    Experiments have one to six rows; others were made before, or a prior counts; the condition
    number is up to 1e12. What doubles cannot hold is refused in words.
    """
    checked = 0
    # Two kinds have the one half of the cases, and two the other; a criterion has one of each.
    for case in CASES[KINDS.index(kind) // 2 :: 2]:
        rows, given, beside, asked, prior = question(name, kind, case)
        problem = edtk.Problem(rows, prior=prior)
        try:
            found = edtk.plan(problem, criterion=criteria.create(name, **given), starts=1, **asked)
        except (RankDeficientError, UserError):
            assert case[2] >= LARGE
            continue
        exact = exact_cost(name, rows, found.counts, given, beside)
        if exact is None:
            continue
        checked += 1
        assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-2
        assert excess(found.told_bound.cost, exact) <= 0
    assert checked


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        *((name, {}) for name in ("A", "D", "E", "G", "O5")),
        ("D", {"most": 2}),
        ("A", {"costs": np.ones(21), "cost_budget": 8.5}),
    ],
)
def test_experiments_that_were_made_far_from_the_origin(name, limits):
    """A line at x = 1e7 is told as well as one at zero, though experiments are kept."""
    u = np.linspace(-1, 1, 21)
    rows = np.column_stack([np.ones(21), 1e7 + u])[:, None, :]
    keep = [0, 20]
    found = edtk.plan(edtk.Problem(rows), 8, name, keep=keep, starts=2, **limits)
    exact = exact_cost(name, rows, found.counts, {})
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-6
    assert excess(found.told_bound.cost, exact) <= 0
    near = edtk.plan(edtk.Problem(rows - np.array([0, 1e7])), 8, "D", keep=keep, starts=2, **limits)
    if name == "D":
        assert found.cost == pytest.approx(near.cost, rel=1e-7)
        assert found.gap == pytest.approx(near.gap, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scale"), some_pairs(["A", "D", "E", "rho_max"], [1e-100, 1.0, 1e-30, 1e100])
)
def test_blocks_far_from_the_origin(name, scale):
    """What all experiments of a block share costs no digits, and no unit hides their effects."""
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(9, 1, 2))
    given = arguments(name, rng, rows)
    rows = scale * (1e6 + rows)
    found = edtk.plan(
        edtk.Problem(rows), criterion=criteria.create(name, **given), blocks=[4, 4], starts=1
    )
    exact = exact_cost(name, rows, found.counts, given, blocks=found.block_counts)
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-7
    assert excess(found.told_bound.cost, exact) <= 0


@pytest.mark.parametrize(
    ("name", "sigma"), some_pairs(["D", "G", "Ds", "rho_max", "I"], [1.0, 0.3])
)
@pytest.mark.slow
def test_blocks_of_nearly_dependent_columns(name, sigma):
    """Neither taking the middle out nor dividing by the noise rounds what tells columns apart."""
    rng = np.random.default_rng(9)
    rows = rows_of(KINDS[0], rng, 3, 4, 1e7)
    given = arguments(name, rng, rows)
    found = edtk.plan(
        edtk.Problem(rows, sigma), criterion=criteria.create(name, **given), blocks=[5, 5], starts=1
    )
    noise = np.full(3, sigma)
    exact = exact_cost(name, rows, found.counts, given, blocks=found.block_counts, sigma=noise)
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-6
    assert excess(found.told_bound.cost, exact) <= 0


@pytest.mark.parametrize(
    ("name", "besides"),
    some_pairs(["A", "c", "I", "Ds", "D"], ["nothing", "kept candidates", "a prior"]),
)
def test_parameters_whose_units_are_fifteen_decades_apart(name, besides):
    """A plan is judged from its own rows, of which none is taken for rounding.

    That a plan is a part of the candidates does not make their entries less exact.
    """
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(9, 2, 2))
    rows[..., 0] *= 3e15
    given = arguments(name, rng, rows)
    prior = np.diag([1e-9 * 9e30, 1e-9]) if besides == "a prior" else None
    keep = [0, 1, 1] if besides == "kept candidates" else None
    found = edtk.plan(
        edtk.Problem(rows, prior=prior), 7, criteria.create(name, **given), keep=keep, starts=1
    )
    with mpmath.workdps(DIGITS):
        beside = 7 * mpmath.matrix(prior.tolist()) if prior is not None else 0
    exact = exact_cost(name, rows, found.counts, given, beside)
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-8
    assert -0.1 < excess(found.told_bound.cost, exact) <= 0


@pytest.mark.parametrize("name", ["A", "D", "G", "c"])
def test_kept_experiments_with_a_noise_of_their_own(name):
    """Rows that were measured before are whitened before they are divided by their noise."""
    rng = np.random.default_rng(4)
    rows = rows_of(KINDS[0], rng, 2, 3, 1e8)
    given = arguments(name, rng, rows)
    sigma = np.array([0.3, 0.7])
    kept = rows[:3] * 1.5
    found = edtk.plan(
        edtk.Problem(rows, 0.3),
        6,
        criteria.create(name, **given),
        keep=edtk.Problem(kept, sigma),
        starts=1,
    )
    with mpmath.workdps(DIGITS):
        beside = exact_information(kept, np.ones(3), sigma)
    exact = exact_cost(name, rows, found.counts, given, beside, sigma=np.full(2, 0.3))
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-6
    assert excess(found.told_bound.cost, exact) <= 0


@pytest.mark.parametrize(
    ("name", "scale"), some_pairs(["A", "D", "E", "G", "rho0"], [1e-100, 1.0, 1e-12, 1e100])
)
def test_proved_plans_in_any_unit(name, scale):
    """The bound of a proof of whole plans is not above the exact cost of the best plan."""
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(8, 2, 2))
    rows[..., 1] = rows[..., 0] + rows[..., 1] / 50
    given = arguments(name, rng, rows)
    problem = edtk.Problem(rows * scale)
    found = edtk.plan(problem, 5, criteria.create(name, **given), keep=[1], prove=20)
    exact = exact_cost(name, rows * scale, found.counts, given)
    assert found.proved_exact
    assert -1e-8 < excess(found.exact_bound.cost, exact) <= 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "far"), some_pairs(["A", "D", "E", "G", "I"], [(3e7, 2), (2e3, 3)])
)
def test_plans_of_a_region_far_from_the_origin(name, far):
    """Kept experiments count with all their digits, also where all points move together."""
    far, p = far
    shifts = np.array([0.0, 0.3])

    def rows(x):
        return (x[:, :1] + shifts)[..., None] ** np.arange(p)

    kept = rows(np.array([[far], [far + 0.5]]))
    given = {"points": kept[:, 0]} if name == "I" else {}
    region = edtk.Region(rows, far, far + 1)
    found = edtk.plan(
        region, p + 4, criteria.create(name, **given), keep=edtk.Problem(kept), starts=1
    )
    beside = exact_information(kept, np.ones(2))
    exact = exact_cost(name, rows(found.points), found.counts, given, beside)
    assert abs(excess(found.cost, exact)) <= found.accuracy < 1e-4
    assert excess(found.told_bound.cost, exact) <= 0


def test_digits_that_are_lost_are_told():
    """The headline of a plan says to what its numbers are right, where that shows."""
    x = np.linspace(1e10, 1e10 + 1, 11)
    far = edtk.Problem(np.column_stack([np.ones(11), x])[:, None, :])
    near = edtk.Problem(np.column_stack([np.ones(11), x - x[0]])[:, None, :])
    assert ", numbers to " in edtk.plan(far, 4, "A").headline()
    assert "numbers to" not in edtk.plan(near, 4, "A").headline()
