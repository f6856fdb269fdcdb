"""Bounds over regions of models that are no polynomials: interval arithmetic, and users' bounds."""

import numpy as np
import pytest
from scipy.optimize import brentq

import criteria
import edtk
from edtk.design.bound import BoundKind
from edtk.design.enclosure.intervals import run_on_boxes
from edtk.design.enclosure.prove_region import enclosure_of, prove_region
from edtk.design.enclosure.region_functions import RegionIntervals
from edtk.design.region import Region
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit

pytestmark = pytest.mark.slow

ROUNDING = 1e-11


def every_function(x):
    """All that runs on intervals, of two variables."""
    u, v = x.T
    one = np.stack([np.exp(u - v), np.log(u + 2), np.sqrt(3 + u * v), np.cos(5 * u), np.sin(4 * v)])
    two = np.stack([np.tanh(u * v), np.cosh(u), np.sinh(v), np.arctan(3 * u), np.abs(u - 0.2)])
    three = np.stack([u**2, u**3, v**-2, (u + 2) ** 0.3, 2.0**u, 1 / (3 + u), u / v, 1 - u, -u + 3])
    four = np.stack([np.expm1(u), np.log1p(v), np.square(u), 0.1 * u / 0.3, (2 + v) ** 0.5, v - u])
    return np.concatenate([one, two, three, four]).T


def test_values_and_derivatives_are_enclosed():
    """At random points of random boxes, wide and narrow; narrow boxes have narrow enclosures."""
    rng = np.random.default_rng(0)
    middle = rng.uniform([-0.9, 0.6], [0.9, 1.9], (400, 2))
    half = 10.0 ** rng.uniform(-9, -1.1, (400, 1)) * np.ones(2)
    low, high = middle - half, middle + half
    value, slope = run_on_boxes(every_function, low, high)
    for _ in range(20):
        x = rng.uniform(low, high)
        f = every_function(x).T
        assert (value.low <= f).all()
        assert (f <= value.high).all()
        h = 1e-6
        for j in range(2):
            step = h * np.eye(2)[j]
            slopes = (every_function(x + step) - every_function(x - step)).T / (2 * h)
            # A step may cross a kink; its own error is below 1e-8.
            smooth = np.abs(x[:, 0] - 0.2) > 2 * h
            away = np.maximum(slope.low[j] - slopes, slopes - slope.high[j])
            assert (away[:, smooth] <= 2e-8).all()
    width = (value.high - value.low).max(axis=0)
    assert (width <= 40 * half[:, 0] + 1e-13).all()


def test_waves_have_their_tops():
    """A cosine over more than a turn, and around its top and bottom."""
    low = np.array([[-0.1], [3.0], [0.5], [-9.0]])
    high = np.array([[0.2], [3.3], [1.0], [9.0]])
    value, _ = run_on_boxes(np.cos, low, high)
    np.testing.assert_allclose(value.high[0], [1, np.cos(3.3), np.cos(0.5), 1], atol=1e-14)
    np.testing.assert_allclose(value.low[0], [np.cos(0.2), -1, np.cos(1), -1], atol=1e-14)


def logistic(x):
    """A binary answer: P (1 - P) of the logit is the information."""
    weight = 1 / (2 * np.cosh(x[:, 0] / 2))
    return weight[:, None] * np.stack([np.ones(len(x)), x[:, 0]], axis=-1)


def enzyme(x):
    """Michaelis and Menten at V = 2, K = 1."""
    s = x[:, 0]
    return np.stack([s / (1 + s), -2 * s / (1 + s) ** 2], axis=-1)


def doses(x):
    """Counts of mean exp(1 - 2 x - y)."""
    root = np.exp((1 - 2 * x[:, 0] - x[:, 1]) / 2)
    return np.stack([root, root * x[:, 0], root * x[:, 1]], axis=-1)


def z_of_logistic():
    """The logit of the D-optimum, the root of z tanh(z/2) = 1."""
    return brentq(lambda z: z * np.tanh(z / 2) - 1, 1, 2, xtol=1e-14)


def cost_of(rows, points):
    """D of equal weights on as many points as parameters."""
    A = rows(np.array(points, dtype=float))
    return len(A) * abs(np.linalg.det(A)) ** (-2 / len(A))


@pytest.mark.parametrize(
    ("rows", "low", "high", "points"),
    [
        (enzyme, 0, 4, [[2 / 3], [4]]),
        (logistic, -10, 10, [[-z_of_logistic()], [z_of_logistic()]]),
        (lambda x: np.exp(-0.4 * x) * np.column_stack([0 * x + 1, -x]), 0, 30, [[0], [2.5]]),
        (doses, [0, 0], [5, 5], [[0, 0], [0, 2], [1, 0]]),
    ],
    ids=["Michaelis-Menten", "logistic", "decay", "counts"],
)
def test_textbook_optima_of_nonlinear_models_are_proved(rows, low, high, points):
    """D rests on as many points as parameters; cost and proved bound enclose it to 1e-7."""
    found = edtk.relax(Region(rows, low, high), "D", prove=1e-7)
    cost = cost_of(rows, points)
    assert found.kind is BoundKind.PROVED
    assert found.gap <= 1e-7
    assert found.continuum_bound.cost <= cost * (1 + ROUNDING)
    assert cost * (1 - ROUNDING) <= found.cost <= cost * (1 + 1e-7)
    assert found.covering.boxes < 5000
    np.testing.assert_allclose(found.points, np.array(points, dtype=float), atol=1e-3)


@pytest.mark.parametrize("name", ["A", "E", "O2", "O5"])
def test_other_criteria_of_a_nonlinear_model(name):
    """One that is not monotone, per trace, too; 1e4 points are no more sensitive than U."""
    region = Region(enzyme, 0, 4, prior=np.diag([0.1, 0.2]), sigma=0.3)
    found = edtk.relax(region, name, prove=1e-5)
    assert found.gap <= 1e-5
    x = np.linspace(0, 4, 10_001)[:, None]
    values = found.sensitivities(x) * found.largest.values[:, None]
    # Boxes are about multipliers of another scale.
    own, searched = (np.linalg.norm(one) for one in (found.covering.multipliers, found.multipliers))
    values *= own / searched
    assert (values.max(axis=1) <= found.covering.upper * (1 + 1e-13)).all()


def ends_of_enzyme(low, high):
    """Both rows from the ends: s/(1 + s) rises, and s/(1 + s)^2 does up to one."""
    bend = np.clip(1.0, low, high)
    at_ends = [np.column_stack(enzyme(s).T) for s in (low, high, bend)]
    return np.minimum.reduce(at_ends) - 1e-15, np.maximum.reduce(at_ends) + 1e-15


def floats_only(x):
    """The enzyme as a function that runs on nothing but floats."""
    return enzyme(np.asarray(x, dtype=float))


def test_an_enclosure_by_the_user():
    """Without derivatives it takes more boxes, and gives the same bound."""
    given = Region(floats_only, 0, 4, enclosure=ends_of_enzyme)
    found = edtk.relax(given, "D", prove=1e-4)
    cost = cost_of(enzyme, [[2 / 3], [4]])
    assert found.gap <= 1e-4
    assert found.continuum_bound.cost <= cost * (1 + ROUNDING)
    derived = edtk.relax(Region(enzyme, 0, 4), "D", prove=1e-4)
    assert derived.covering.boxes < found.covering.boxes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"rows: it runs neither on polynomials nor on intervals \("),
        (
            {"enclosure": lambda low, high: (0 * low, 0 * high)},
            r"enclosure: values have the shape \(2, 64, 1\); expected two of \(64, 2\)",
        ),
        ({"enclosure": lambda low, high: low}, "enclosure: fails for boxes of shape"),
        (
            {"enclosure": lambda low, high: ends_of_enzyme(low, high)[::-1]},
            "enclosure: a least value is above the largest one",
        ),
        (
            {"enclosure": lambda low, high: (enzyme(low), enzyme(low))},
            "enclosure: a value is outside its enclosure at x = ",
        ),
    ],
)
def test_what_is_no_enclosure_is_refused_before_the_work(options, message):
    """One line says what is wrong, and where."""
    with pytest.raises(ArgumentError, match=message) as caught:
        edtk.relax(Region(floats_only, 0, 4, **options), prove=1e-3)
    assert "\n" not in str(caught.value)


def test_constraints_leave_out_boxes():
    """Below a curve that is no polynomial; no point there is more sensitive."""
    region = Region(doses, [0, 0], [2, 2], constraints=lambda x: np.exp(-x[:, 0]) - x[:, 1])
    found = edtk.relax(region, "D", prove=1e-3)
    assert found.gap <= 1e-3
    x = np.random.default_rng(0).uniform(0, 2, (100_000, 2))
    x = x[region.at(x).feasible]
    problem = found.judged.region.problem(x)
    assert problem.sensitivities(found.covering.multipliers).max() <= found.covering.upper[0]


def test_a_needle_between_all_points_is_found():
    """A peak of a width of 1e-5, of which no point of a grid has heard."""

    def rows(x):
        u = x[:, 0]
        needle = 3 * np.exp(-((3e5 * (u - 0.1234567)) ** 2))
        return np.stack([np.ones_like(u), u + needle], axis=-1)

    region = Region(rows, -1, 1)
    searched = edtk.relax(region, "D")
    assert searched.cost == pytest.approx(1.0, abs=1e-6)
    proved = edtk.relax(region, "D", prove=1e-3)
    assert proved.gap <= 1e-3
    assert proved.cost < 0.5 * searched.searched_bound.cost


def test_time_that_is_up_leaves_an_honest_bound():
    """What boxes are open count with what is known of them."""
    region = Region(enzyme, 0.5, 4)
    enclosure = enclosure_of(region)
    assert isinstance(enclosure, RegionIntervals)
    with time_limit(0.0):
        found = prove_region(region, criteria.create("D"), 1e-9)
    assert found.continuum_bound.cost < 0.9 * found.cost
    assert found.kind is BoundKind.PROVED
