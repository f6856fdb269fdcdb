"""Nonlinear models of textbooks and papers: points, weights and values as they are printed."""

from functools import cache

import numpy as np
import pytest

import edtk
from criteria import create
from edtk import Region

COMPARTMENT = "c * (exp(-a * t) - exp(-b * t))"
OF_HORSE = {"a": 0.05884, "b": 4.298, "c": 21.80}
DAY = {"t": (0.05, 30.0)}
THIRDS = (1 / 3, 1 / 3, 1 / 3)
HALVES = (0.5, 0.5)


def compartment(c=None):
    """Theophylline in a horse (Atkinson, Chaloner, Herzberg and Juritz 1993)."""
    return Region.of_model(COMPARTMENT, OF_HORSE, DAY), "D" if c is None else create("c", c=c)


def area():
    """Slope of the area under the curve, ``c (1/a - 1/b)``."""
    a, b, c = OF_HORSE.values()
    return compartment([-c / a**2, c / b**2, 1 / a - 1 / b])


def time_of_the_peak():
    """Slope of ``log(b/a) / (b - a)``."""
    a, b, _ = OF_HORSE.values()
    t = np.log(b / a) / (b - a)
    return compartment([(t - 1 / a) / (b - a), (1 / b - t) / (b - a), 0.0])


def peak():
    """Slope of the largest concentration; the time of the peak has no part in it."""
    a, b, c = OF_HORSE.values()
    t = np.log(b / a) / (b - a)
    return compartment([-c * t * np.exp(-a * t), c * t * np.exp(-b * t), peak_of(t) / c])


def peak_of(t):
    """The concentration."""
    a, b, c = OF_HORSE.values()
    return c * (np.exp(-a * t) - np.exp(-b * t))


def of_line(weight):
    """A line in z whose readings have a weight (Ford, Torsney and Wu 1992)."""

    def rows(z):
        return (np.sqrt(weight(z)) * np.column_stack([np.ones(len(z)), z]))[:, None]

    return Region(rows, [-6.0], [6.0]), "D"


def complementary_log_log():
    """``1 - F = exp(-exp(z))``, by the link of the family."""
    model = Region.of_model(
        "a + b * z", {"a": 0, "b": 1}, {"z": (-6, 3)}, "binomial", link="cloglog"
    )
    return model, "D"


def double_exponential():
    """``F = exp(-|z|) / 2`` below zero: a weight ``F'^2 / (F (1 - F)) = 1 / (2 exp|z| - 1)``."""
    return of_line(lambda z: 1 / (2 * np.exp(np.abs(z)) - 1))


def of(formula, theta, box, criterion="D", **options):
    """What makes a region of a model, with its criterion."""
    return lambda: (Region.of_model(formula, theta, box, **options), criterion)


# Model; printed points with a unit of their last digit; printed weights.
PRINTED = {
    "compartment D": (compartment, [0.2288, 1.3886, 18.417], 1e-3, THIRDS),
    "compartment area": (area, [0.2327, 17.6339], 5e-3, (0.0135, 0.9865)),
    "compartment time of the peak": (time_of_the_peak, [0.1793, 3.5671], 5e-3, (0.6062, 0.3938)),
    "compartment peak": (peak, [1.0122], 1e-3, (1.0,)),
    "complementary log-log": (complementary_log_log, [-1.338, 0.980], 1e-3, HALVES),
    # Two points a, -a of weight v beside zero: det M is largest at 4 v (1 - w(a)) = 1 and
    # 2 (exp(a) - 1) = a exp(a).
    "double exponential": (double_exponential, [-1.594, 0, 1.594], 1e-3, (0.2819, 0.4362, 0.2819)),
    # Box and Hunter 1965, a catalysed reaction.
    "catalyst": (
        of(
            "a * c * x / (1 + a * x + b * y)",
            {"a": 2.9, "b": 12.2, "c": 0.69},
            {"x": (0, 3), "y": (0, 3)},
        ),
        [[0.28, 0.0], [3.0, 0.0], [3.0, 0.795]],
        1e-2,
        THIRDS,
    ),
    # Ricker's fish: zeros of a Laguerre polynomial (Karlin and Studden 1966).
    "Ricker": (
        of("a * x * exp(-b * x)", {"a": 2, "b": 0.5}, {"x": (0, 20)}),
        [3 - np.sqrt(3), 3 + np.sqrt(3)],
        1e-4,
        HALVES,
    ),
    "growth": (of("a * exp(b * x)", {"a": 1, "b": 2}, {"x": (0, 3)}), [2.5, 3], 1e-4, HALVES),
    "power": (
        of("a * x**b", {"a": 3, "b": 0.5}, {"x": (0.1, 10)}),
        [10 * np.exp(-2), 10],
        1e-4,
        HALVES,
    ),
    # Dette, Bretz, Pepelyshev and Pinheiro 2008: exponential and log-linear responses to a dose.
    "exponential dose": (
        of("a + b * exp(x / c)", {"a": 0, "b": 0.08, "c": 0.8}, {"x": (0, 1)}),
        [0, (0.2 * np.exp(1.25) + 0.8) / (np.exp(1.25) - 1), 1],
        1e-4,
        THIRDS,
    ),
    "log-linear dose": (
        of("a + b * log(x + c)", {"a": 0, "b": 0.07, "c": 0.2}, {"x": (0, 1)}),
        [0, 1.2 * 0.2 * np.log(1.2 / 0.2) - 0.2, 1],
        1e-4,
        THIRDS,
    ),
    # The dose of half the answers, -a/b, is told by those at this dose alone.
    "median dose": (
        of(
            "a + b * x",
            {"a": -2, "b": 1},
            {"x": (-5, 10)},
            create("c", c=[-1, -2]),
            family="binomial",
        ),
        [2],
        1e-9,
        (1.0,),
    ),
    # Errors in proportion to the response make a line of both.
    "proportional decay": (
        of(
            "a * exp(-b * x)",
            {"a": 2, "b": 1},
            {"x": (0, 3)},
            sigma=lambda x, theta: 0.1 * theta[0] * np.exp(-theta[1] * x[:, 0]),
        ),
        [0, 3],
        1e-6,
        HALVES,
    ),
}


@cache
def relaxed(made):
    """The region of a model, and its design."""
    region, criterion = made()
    return region, edtk.relax(region, criterion)


@pytest.mark.parametrize("name", PRINTED)
def test_designs_are_those_in_print(name):
    """Points to a unit of their last digit, and their weights; a cost that is no larger.

    An optimum for one combination has fewer points than parameters, and is as exact.
    """
    made, points, unit, weights = PRINTED[name]
    region, found = relaxed(made)
    printed = np.reshape(points, (len(weights), -1))
    M = region.problem(printed).information(np.array(weights))
    assert found.gap < 1e-6
    assert found.cost <= found.criterion.cost(M) * (1 + 1e-6)
    near = np.abs(found.points[:, None] - printed).max(axis=-1) <= unit
    assert near.any(axis=1).all()
    np.testing.assert_allclose(found.weights @ near, weights, atol=2e-4)
    assert len(found.points) == len(printed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "value"), [(area, 2193.9), (time_of_the_peak, 0.02814), (peak, 1.0)]
)
def test_values_of_the_compartment_model_are_those_in_print(model, value):
    """What the slopes of area, time and height of the peak cost (Atkinson et al. 1993)."""
    assert relaxed(model)[1].cost == pytest.approx(value, rel=2e-4)
