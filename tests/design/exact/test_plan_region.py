"""Exact plans in regions: printed optima off any grid, laws, and what a person sees."""

import numpy as np
import pytest
from matplotlib import pyplot

import criteria
import edtk
from edtk.design.exact.plan_region import plan_region
from edtk.design.region import Region
from edtk.system.errors import ArgumentError, UserError

D = criteria.create("D")


def parabola(x):
    """A full quadratic of two variables."""
    u, v = x.T
    return np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)


def poisson(x):
    """Counts of mean exp(x)."""
    root = np.exp(x[:, 0] / 2)
    return np.stack([root, root * x[:, 0]], axis=-1)


SQUARE = Region(parabola, [-1, -1], [1, 1])


@pytest.mark.slow
def test_box_and_draper_with_six():
    """Box and Draper (Biometrika 58, 1971): three corners, (-d, -d), (1, 3d), (3d, 1).

    With d = (4 - sqrt 13)/3 = 0.1315, up to the symmetries of the square.
    """
    d = (4 - np.sqrt(13)) / 3
    points = np.array([[-1, -1], [1, -1], [-1, 1], [-d, -d], [1, 3 * d], [3 * d, 1]])
    best = np.exp(2 * np.linalg.slogdet(parabola(points))[1] / 6)
    r = plan_region(SQUARE, 6, D)
    assert r.value == pytest.approx(best, rel=1e-8)
    np.testing.assert_array_equal(r.counts, np.ones(6))
    # The absolute coordinates are the same in all images of the plan.
    found = np.sort(np.abs(r.points).ravel())
    np.testing.assert_allclose(found, np.sort(np.abs(points).ravel()), atol=1e-5)


@pytest.mark.slow
def test_box_and_draper_with_seven():
    """Printed: the corners, (-0.092, -0.092), (1, 0.067), (0.067, 1)."""
    r = plan_region(SQUARE, 7, D)
    expected = np.sort([*np.ones(8), 0.092, 0.092, 1, 0.067, 0.067, 1])
    np.testing.assert_allclose(np.sort(np.abs(r.points).ravel()), expected, atol=6e-4)


@pytest.mark.slow
def test_nine_points_are_the_grid():
    """With nine experiments the 3 x 3 grid is best: det M = 5184."""
    r = plan_region(SQUARE, 9, D)
    assert r.value == pytest.approx(5184 ** (1 / 6), rel=1e-9)
    np.testing.assert_allclose(np.abs(r.points), np.round(np.abs(r.points)), atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("m", [2, 5, 8])
def test_two_parameters_have_two_points(m):
    """On two points det M is n (m - n) times the squared determinant of the rows: the points are
    those of the relaxation, and the experiments are shared as evenly as possible.
    """
    region = Region(poisson, -10, 2)
    r = plan_region(region, m, D)
    # Points 0 and 2 = x_max - 2 and x_max; det of the rows is exp((0 + 2)/2) 2.
    assert r.value == pytest.approx(2 * np.e * np.sqrt((m // 2) * (m - m // 2)), rel=1e-9)
    np.testing.assert_allclose(r.points[:, 0], [0, 2], atol=1e-6)
    assert r.counts.sum() == m
    assert r.bound == pytest.approx(m * np.e, rel=1e-7)
    assert r.efficiency == pytest.approx(r.value / r.bound)


@pytest.mark.slow
def test_a_plan_for_one_prediction_measures_there():
    """The best plan for a value of a parabola is singular: all experiments at one point."""
    c = criteria.create("c", c=[1.0, 0.5, 0.25])
    found = edtk.plan(Region(lambda x: x ** np.arange(3), -1.0, 1.0), 4, c)
    np.testing.assert_allclose(found.points, [[0.5]], atol=1e-12)
    assert found.value == pytest.approx(1 / 4, rel=1e-9)


@pytest.mark.slow
def test_points_stay_inside():
    """On the disc a plan reaches its bound where weights are multiples of 1/m, and stays inside."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), x])

    region = Region(rows, [-1, -1], [1, 1], constraints=lambda x: 1 - (x**2).sum(axis=1))
    r = plan_region(region, 6, D, starts=2)
    assert np.linalg.norm(r.points, axis=1).max() <= 1 + 1e-9
    assert r.efficiency == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
def test_the_seed_decides():
    """The same seed gives the same plan; the value hardly depends on it."""
    first = plan_region(SQUARE, 8, D, seed=3, starts=12)
    again = plan_region(SQUARE, 8, D, seed=3, starts=12)
    other = plan_region(SQUARE, 8, D, seed=4, starts=12)
    np.testing.assert_array_equal(first.points, again.points)
    assert other.value == pytest.approx(first.value, rel=1e-3)


@pytest.mark.slow
def test_impossible_questions():
    """Too few experiments, and numbers that are not positive, are named in one line."""
    with pytest.raises(ArgumentError, match="size 0: expected one or more"):
        plan_region(SQUARE, 0, D)
    with pytest.raises(ArgumentError, match="starts 0: expected one or more"):
        plan_region(SQUARE, 6, D, starts=0)
    with pytest.raises(UserError, match="no plan of 5 experiments identifies"):
        plan_region(SQUARE, 5, D, starts=2)


def test_kept_experiments_count():
    """Beside two experiments at one point of the pair, two more go to the other one."""
    region = Region(poisson, -10, 2)
    kept = region.problem([[2.0], [2.0]])
    r = plan_region(region, 4, D, starts=4, keep=kept)
    assert r.size == 4
    assert r.kept == 2
    np.testing.assert_allclose(r.points, [[0.0]], atol=1e-6)
    assert r.counts.tolist() == [2]
    # The plan is the best one of four, of which two were made already.
    assert r.value == pytest.approx(4 * np.e, rel=1e-9)
    assert r.bound == pytest.approx(4 * np.e, rel=1e-6)
    with pytest.raises(ArgumentError, match="size 2: expected one or more beside 2 kept"):
        plan_region(region, 2, D, keep=kept)
    with pytest.raises(ArgumentError, match="keep: kept experiments have 1 parameters, expected 2"):
        plan_region(region, 4, D, keep=edtk.Problem(np.ones((1, 1, 1))))


@pytest.mark.slow
def test_a_bayesian_plan_has_the_prior_once():
    """The precision R adds to the information of all experiments; one of them may be enough."""
    R = np.diag([2.0, 5.0])
    region = Region(poisson, -10, 2, parameters=("a", "b"))
    criterion = criteria.create("bayes_D", precision=R)
    one = edtk.plan(region, 1, criterion)
    x = np.linspace(-10, 2, 2001)
    posterior = region.problem(x[:, None]).blocks() + R
    best = np.linalg.det(posterior).max() ** 0.5
    assert one.value == pytest.approx(best, rel=1e-5)
    assert one.value >= best * (1 - 1e-12)
    three = edtk.plan(region, 3, criterion)
    M = region.problem(three.points).information(three.counts) + R
    assert three.value == pytest.approx(np.linalg.det(M) ** 0.5, rel=1e-12)
    design = edtk.relax(region, criterion, size=3)
    assert 3 * design.bound == pytest.approx(three.bound, rel=1e-7)
    assert "bayes_D" in repr(design)
    assert three.efficiency <= 1 + 1e-9


@pytest.mark.slow
def test_the_front_door():
    """`edtk.plan` takes a region, D by default, and says which options are not for it."""
    region = Region(poisson, -10, 2)
    found = edtk.plan(region, 4, starts=2)
    assert found.counts.tolist() == [2, 2]
    assert found.criterion.name == "D"
    assert edtk.plan(region, size=4, criterion=criteria.create("A"), starts=2).criterion.name == "A"
    kept = edtk.plan(region, 4, starts=2, keep=region.problem([1, 2]))
    assert edtk.plan(region, 4, starts=2, keep=[1, 2]).cost == pytest.approx(kept.cost, rel=1e-9)
    with pytest.raises(ArgumentError, match=r"keep: expected points \(n, 1\), or a Problem"):
        edtk.plan(region, 4, keep=[[1, 2]])
    with pytest.raises(ArgumentError, match="most: not for plans of a region"):
        edtk.plan(region, 4, most=1)
    with pytest.raises(ArgumentError, match="block_variance: not for plans of a region"):
        edtk.plan(region, 4, block_variance=1)
    with pytest.raises(ArgumentError, match="size: expected the number of experiments"):
        edtk.plan(region)


def test_it_can_be_read_and_drawn():
    """Text, table, notebook and picture show points and repeats, and what the bound rests on."""
    region = Region(poisson, -10, 2, variables=("dose",))
    r = plan_region(region, 5, D, starts=4)
    assert "searched" in r.headline()
    assert r.to_frame()["count"].tolist() == r.counts.tolist()
    assert "dose" in r.summary()
    assert "dose" in r._repr_html_()
    assert "5 experiments" in r.plot().get_title()
    pyplot.close("all")


@pytest.mark.slow
def test_many_guesses_are_priced_model_by_model():
    """A plan that is best on average over 25 guesses is of few points, and symmetric as they are.

    Steps by all entries of the models together would take gigabytes.
    """
    guesses = [[a, b] for a in np.linspace(-1, 1, 5) for b in np.linspace(0.5, 2, 5)]
    region = edtk.Region.of_model(
        "a + b * x", guesses, (-6, 6), family="binomial", parameters=("a", "b"), robust="bayes"
    )
    plan = edtk.plan(region, size=10, starts=8)
    assert plan.efficiency > 0.999
    np.testing.assert_array_equal(plan.counts, [4, 1, 1, 4])
    np.testing.assert_allclose(plan.points, -plan.points[::-1], atol=1e-6)


@pytest.mark.slow
def test_a_maximin_plan_has_each_point_once():
    """Points that the last, sharpest descent has brought together are one."""
    rng = np.random.default_rng(3)
    both = np.column_stack([rng.normal(0, 0.3, 10), rng.uniform(0.5, 2, 10)])
    guesses = both[:6].round(2).tolist()
    region = edtk.Region.of_model(
        "a + b * x", guesses, (-6, 6), family="binomial", parameters=("a", "b"), robust="maximin"
    )
    plan = edtk.plan(region, size=7, criterion="A", starts=2)
    assert np.diff(plan.points, axis=0).min() > 1e-3
