"""A region of points: derivatives, feasibility, and errors that name the argument."""

import numpy as np
import pytest

import edtk
from edtk.design.region import Region
from edtk.design.relaxation.search_region import RegionGrid
from edtk.design.user_model import inside_differences
from edtk.system.errors import ArgumentError, UserError


def waves(x):
    """Two rows of three regressors at points (n, 2)."""
    u, v = x.T
    first = np.stack([np.ones_like(u), np.sin(u), u * v], axis=-1)
    second = np.stack([v, np.cos(u + v), np.exp(v)], axis=-1)
    return np.stack([first, second], axis=1)


def waves_gradient(x):
    """Its derivatives (n, 2, 3, 2)."""
    u, v = x.T
    zero = np.zeros_like(u)
    by_u = [[zero, np.cos(u), v], [zero, -np.sin(u + v), zero]]
    by_v = [[zero, zero, u], [zero + 1, -np.sin(u + v), np.exp(v)]]
    return np.moveaxis(np.array([by_u, by_v]), (0, 3), (3, 0))


def line(x):
    """A straight line."""
    return np.column_stack([np.ones(len(x)), x])


def test_differences_inside_a_box():
    """Ten digits of a derivative, in the middle and on the bounds, and no point outside."""
    limits = np.array([[-1.0, 0.0], [1.0, 2.0]])

    def function(x):
        assert (x >= limits[0]).all()
        assert (x <= limits[1]).all()
        return waves(x)

    x = np.array([[0.3, 0.7], [-1, 0], [1, 2], [-1, 1.1], [1 - 1e-7, 2 - 1e-9]])
    found = inside_differences(function, x, limits)
    np.testing.assert_allclose(found, waves_gradient(x), atol=2e-9)
    np.testing.assert_allclose(found[0], waves_gradient(x)[0], atol=3e-10)


def test_a_gradient_is_used_and_checked():
    """With a gradient derivatives are exact, and a wrong one is found out."""
    sigma = [0.5, 2.0]
    x = np.array([[0.2, 0.4], [-1.0, 2.0]])
    by_hand = Region(waves, [-1, 0], [1, 2], gradient=waves_gradient, sigma=sigma)
    expected = waves_gradient(x) / np.array(sigma)[:, None, None]
    np.testing.assert_array_equal(by_hand.derivative_at(x), expected)
    by_difference = Region(waves, [-1, 0], [1, 2], sigma=sigma)
    np.testing.assert_allclose(by_difference.derivative_at(x), expected, atol=1e-8)
    turned = Region(
        waves, [-1, 0], [1, 2], gradient=lambda x: np.moveaxis(waves_gradient(x), -1, 1)
    )
    np.testing.assert_array_equal(turned.derivative_at(x), waves_gradient(x))
    with pytest.raises(ArgumentError, match="gradient: it is not the derivative of the rows"):
        Region(waves, [-1, 0], [1, 2], gradient=lambda x: 2 * waves_gradient(x))


def test_slopes_of_points():
    """The slope of <B, A> is that of a difference, for points of any shape."""
    region = Region(waves, [-1, 0], [1, 2], gradient=waves_gradient)
    x = np.random.default_rng(0).uniform(0, 1, (4, 3, 2))
    B = np.random.default_rng(1).normal(size=(4, 3, 2, 3))
    slope = region.at(x).slope(B)
    for i in range(2):
        h = np.zeros(2)
        h[i] = 1e-6
        change = ((region.at(x + h).regressor - region.at(x - h).regressor) * B).sum(axis=(-1, -2))
        np.testing.assert_allclose(slope[..., i], change / 2e-6, atol=1e-8)


def test_information_is_that_of_a_problem():
    """Rows, noise and prior mean the same as in a problem of arrays."""
    prior = np.diag([1.0, 2.0, 3.0])
    region = Region(waves, [-1, 0], [1, 2], sigma=[0.5, 2.0], prior=prior)
    x = np.random.default_rng(0).uniform(0, 1, (5, 2))
    w = np.array([1.0, 2, 0, 3, 1])
    problem = edtk.Problem(waves(x), [0.5, 2.0], prior=prior)
    expected = problem.information(w)
    np.testing.assert_allclose(region.problem(x).information(w), expected)
    np.testing.assert_allclose(region.at(x[None]).information(w[None])[0], expected)


def test_a_grid_keeps_what_is_feasible():
    """Corners, middle and points on a constraint are there, and nothing outside."""
    region = Region(line, [-1, -1], [1, 1], constraints=lambda x: 1 - (x**2).sum(axis=1))
    grid = RegionGrid.of(region, 500)
    radius = np.linalg.norm(grid.x, axis=1)
    assert radius.max() <= 1 + 1e-9
    assert (np.abs(radius - 1) < 0.01).sum() > 20
    assert radius.min() == 0
    free = RegionGrid.of(Region(line, np.zeros(8), np.ones(8)), 1000)
    corners = np.isin(free.x, (0.0, 1.0)).all(axis=1)
    assert corners.sum() == 256
    assert len(free.x) > 700


def test_maxima_of_a_grid():
    """The points that no neighbour exceeds, the largest first."""
    grid = RegionGrid.of(Region(line, 0, 4 * np.pi), 1001)
    values = np.sin(grid.x[:, 0]) * np.exp(-0.1 * grid.x[:, 0])
    np.testing.assert_allclose(grid.maxima(values, 2)[:, 0], np.pi * np.array([0.5, 2.5]), atol=0.2)


@pytest.mark.parametrize(
    ("one", "many", "low", "high"),
    [
        (lambda x: [1, x, x**2], lambda x: np.vander(x[:, 0], 3, increasing=True), 0, 2),
        (lambda x: [1, x[0], x[0] ** 2], lambda x: np.vander(x[:, 0], 3, increasing=True), 0, 2),
        (lambda x: waves(x[None])[0], waves, [0, 0], [1, 2]),
    ],
    ids=["number", "point", "rows"],
)
def test_a_function_of_one_point_is_called_point_by_point(one, many, low, high):
    """Rows, gradient and constraints of one point are those of many."""
    gradients = {"gradient": lambda x: waves_gradient(x[None])[0]} if np.ndim(low) else {}
    single = Region(one, low, high, constraints=lambda x: 1.5 - np.sum(x), **gradients)
    together = Region(many, low, high, constraints=lambda x: 1.5 - x.sum(axis=1))
    x = np.random.default_rng(0).uniform(low, high, (7, np.size(low)))
    np.testing.assert_array_equal(single.rows_at(x), together.rows_at(x))
    np.testing.assert_array_equal(single.slack_at(x), together.slack_at(x))
    np.testing.assert_allclose(single.derivative_at(x), together.derivative_at(x), atol=1e-8)


def test_a_function_of_one_point_can_be_proved():
    """It runs on polynomials as one of many points does."""
    region = Region(lambda x: [1, x[0], x[1], x[0] * x[1]], [-1, -1], [1, 1])
    assert edtk.relax(region, "D", prove=0.01).proved_bound.cost == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"low": 1, "high": 1}, "low, high: bounds 1 and 1 of variable 1; expected low < high"),
        ({"low": 0, "high": np.inf}, "low, high: a bound is not finite"),
        ({"low": [0, 0], "high": 1}, "high: "),
        ({"rows": lambda x: x[:, 0]}, "rows: values have the shape"),
        ({"rows": lambda x: np.ones((2, 2, 2))}, "rows: values have the shape"),
        ({"rows": lambda x: 1 / (x - 0.5) * [1, 2]}, "rows: a value is not finite at x = 0.5"),
        ({"rows": lambda x: line(x) * len(x)}, "rows: values of many points differ"),
        ({"rows": lambda x: x @ np.ones(3)}, "rows: fails for points of shape"),
        ({"constraints": lambda x: 1 - x[:, 1]}, "constraints: fails for points of shape"),
        ({"gradient": lambda x: np.zeros((len(x), 2))}, "gradient: values have the shape"),
        ({"variables": ("a", "b")}, "variables: a, b; expected 1 different names"),
        ({"parameters": ("a", "b", "c")}, "3 names for 2 parameters"),
        ({"constraints": 3}, "constraints: expected a function of points, or a list"),
        ({"constraints": [3]}, "constraints: expected a function of points, or a list"),
        ({"rows": lambda x: line(x) * 1j}, "rows: fails .*: values are complex"),
        ({"low": "a"}, "low, high: expected numbers"),
        ({"sigma": [1.0, 2.0]}, r"sigma: shape \(2,\); expected a number, or 1 of them"),
        ({"prior": np.full((2, 2), np.nan)}, "the prior must be finite, symmetric"),
        ({"prior": [[1, 2], [0, 1]]}, "the prior must be finite, symmetric"),
        ({"prior": -np.eye(2)}, "the prior must be finite, symmetric"),
        ({"sigma": -1.0}, "sigma must be finite and positive"),
        ({"prior": np.eye(3)}, "the prior must be"),
    ],
)
def test_what_is_wrong_is_named(arguments, message):
    """One line says which argument is wrong, and where."""
    given = {"rows": line, "low": 0, "high": 1} | arguments
    with pytest.raises(ValueError, match=message) as caught:
        Region(**given)
    assert "\n" not in str(caught.value)


def test_a_model_that_fails_somewhere_names_the_point():
    """A pole between the points where a model is tried is found when it is reached."""
    region = Region(lambda x: line(x) / (x - 0.25), 0, 1)
    with pytest.raises(UserError, match=r"rows: a value is not finite at x = 0\.25"):
        region.problem([[0.1], [0.25]])


@pytest.mark.slow
def test_a_model_may_be_undefined_outside_its_constraints():
    """Searches look a step beyond a constraint: a root that ends there does no harm."""

    def dome(x):
        return np.column_stack([np.ones(len(x)), np.sqrt(1.0001 - (x**2).sum(axis=1))])

    region = Region(dome, [-1, -1], [1, 1], constraints=lambda x: 1 - (x**2).sum(axis=1))
    assert edtk.relax(region, "D", candidates=400).gap < 1e-6
    assert (region.at(np.array([[1.0, 1.0]])).regressor == 0).all()


def test_without_a_feasible_point():
    """The constraint that excludes most of the grid is named."""
    region = Region(line, [0, 0], [1, 1], constraints=[lambda x: x[:, 0], lambda x: -1 - x[:, 0]])
    with pytest.raises(UserError, match=r"no feasible point among \d+; constraint 2 excludes 100%"):
        edtk.relax(region)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda region: edtk.relax(region, candidates=1), "candidates 1: expected a whole number"),
        (lambda region: edtk.relax(region, candidates=10**9), "expected 2 to 1000000 points"),
        (lambda region: edtk.relax(region, candidates=9.5), "candidates 9.5: expected a whole"),
        (lambda region: edtk.relax(region, size=0), "size 0: expected a whole number, 1 or more"),
        (lambda region: edtk.plan(region, 2.5), "size 2.5: expected a whole number"),
        (lambda region: edtk.plan(region, "4"), "size 4: expected a whole number"),
        (lambda region: edtk.plan(region, 4, seed=-1), "seed -1: expected a whole number, 0 or"),
        (lambda region: edtk.plan(region, 4, starts=0), "starts 0: expected a whole number, 1 or"),
    ],
)
def test_numbers_are_whole(call, message):
    """Counts are whole numbers that make sense, and their argument is named."""
    with pytest.raises(ArgumentError, match=message):
        call(Region(line, 0, 1))


def test_it_shows_itself():
    """The repr is one line with names, bounds and parameters."""
    region = Region(line, 0, 4, parameters=("a", "b"), constraints=lambda x: x[:, 0])
    assert repr(region) == "<Region: x in [0, 4] under 1 constraint; 2 parameters (a, b)>"
