"""Sensitivities over a region as polynomials, with an error that covers all rounding."""

from fractions import Fraction

import numpy as np
import pytest

import criteria
from edtk.design.enclosure.region_functions import RegionPolynomials
from edtk.design.region import Region
from edtk.design.relaxation.proof import normalised


def quadratic(x):
    """Two sensors: a full quadratic, and its gradient along a line."""
    u, v = x.T
    one = np.ones_like(u)
    first = np.stack([one, u, v, u**2, u * v, v**2], axis=-1)
    second = np.stack([0 * u, one, one, 2 * u, u + v, 2 * v], axis=-1)
    return np.stack([first, second], axis=1)


def disc(x):
    """Inside a circle."""
    return 4 - (x**2).sum(axis=1)


def region(rows=quadratic, **options):
    """A region about a point far from the origin, whose parameters differ in size."""
    options = {"sigma": [0.1, 0.7], "prior": np.diag(np.arange(1.0, 7))} | options
    return Region(rows, [0.3, -2], [1.7, 5], constraints=disc, **options)


def multiplier(seed=0):
    """A multiplier whose entries differ in size and cancel."""
    B = np.random.default_rng(seed).normal(size=(6, 6)) * 10.0 ** np.arange(-3, 3)
    return B @ B.T


@pytest.mark.parametrize(
    ("name", "stated"), [("D", None), ("O2", None), ("D", 2)], ids=["D", "per trace", "stated"]
)
def test_it_is_the_sensitivity(name, stated):
    """At random points, for a stated degree too, and per trace for a criterion of degree zero."""

    def floats(x):
        return quadratic(np.asarray(x, dtype=float))

    given = region(quadratic if stated is None else floats, degree=stated)
    criterion = criteria.create(name)
    Z = multiplier()
    enclosed = RegionPolynomials.of(given).enclosed(Z, criterion)
    low, high = given.limits
    u = np.random.default_rng(1).uniform(-1, 1, (300, 2))
    x = enclosed.experiments(u)
    np.testing.assert_allclose(x, (low + high) / 2 + u * (high - low) / 2)
    expected = normalised(given.problem(x), criterion).sensitivities(Z)
    np.testing.assert_allclose(enclosed.objectives[0](u), expected, rtol=1e-11)
    slack = enclosed.slacks[0](u)
    np.testing.assert_allclose(slack, disc(x), atol=2e-10)
    assert (slack > disc(x)).all()


def test_its_error_covers_the_rounding():
    """The coefficients are compared with the polynomial in rational numbers, without rounding."""
    given = region()
    found = RegionPolynomials.of(given).quadratic(multiplier())
    rows = given.polynomial_rows().exact
    Z = np.array([[Fraction(z) for z in row] for row in multiplier().tolist()])
    prior = np.array([[Fraction(z) for z in row] for row in given.prior.tolist()])
    exact = np.full(found.coefficients.shape, Fraction(0), dtype=object)
    exact[0, 0] += (Z * prior).sum()
    for k in np.ndindex(3, 3):
        for m in np.ndindex(3, 3):
            product = sum(row[:, k[0], k[1]] @ Z @ row[:, m[0], m[1]] for row in rows)
            exact[k[0] + m[0], k[1] + m[1]] += product
    rounded = np.array([[Fraction(c) for c in row] for row in found.coefficients.tolist()])
    off = float(np.abs(rounded - exact).sum())
    assert 0 < off <= found.error
    assert found.error <= 1e-12 * found.size


def test_rows_that_are_not_exact_count_in_the_error():
    """A function that errs by 1e-10 of its size gives a polynomial that is off by about as much."""

    def noisy(x):
        x = np.asarray(x, dtype=float)
        return quadratic(x) * (1 + 1e-11 * np.sin(1e5 * x.sum(axis=1)))[:, None, None]

    Z = multiplier()
    given = region(noisy, degree=2)
    found = RegionPolynomials.of(given).quadratic(Z)
    u = np.random.default_rng(2).uniform(-1, 1, (2000, 2))
    x = given.limits.mean(axis=0) + u * np.ptp(given.limits, axis=0) / 2
    away = np.abs(found(u) - given.problem(x).sensitivities(Z)).max()
    clean = RegionPolynomials.of(region()).quadratic(Z)
    assert 100 * clean.error < away <= found.error


def test_other_parameters_give_the_same_polynomial():
    """In parameters k = T k' the multiplier is ``T^-1 Z T^-T``."""
    T = np.random.default_rng(3).normal(size=(6, 6))
    S = np.linalg.inv(T)
    Z = multiplier()
    given = region()
    base = RegionPolynomials.of(given).quadratic(Z)
    other = RegionPolynomials.of(given.in_units(T, np.ones(6))).quadratic(S @ Z @ S.T)
    np.testing.assert_allclose(other.coefficients, base.coefficients, atol=1e-9 * base.size)
