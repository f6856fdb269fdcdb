"""The sensitivity: prices of poses, their gradients, and the ascent to the dearest pose nearby."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, KR270
from scipy.optimize import nnls

from criteria import create
from edtk.design import relax, sample_feasible
from edtk.design.sensitivity import Sensitivity

on_each = pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
both = pytest.mark.parametrize("per_trace", [False, True], ids=["plain", "per trace"])


def multiplier(design, seed=0):
    """What D pays near a random design: every direction of the parameters has its price."""
    q = sample_feasible(design, 30, (seed, 9))
    return np.linalg.inv(design.problem(q).mean)


def indefinite(design, seed=0):
    """A multiplier as criteria have that are not monotone: some directions are paid for, others fined."""
    V = np.linalg.cholesky(multiplier(design, seed))
    return V @ np.diag((-1.0) ** np.arange(len(V))) @ V.T


either = pytest.mark.parametrize("Z_of", [multiplier, indefinite])


@either
@both
@on_each
def test_price_is_the_inner_product_with_the_information(design, per_trace, Z_of):
    """The price of a pose is <Z, A'A/sigma^2>, divided by the trace of that where asked, and independent of others.

    Rounding is eps times the sum of the absolute products, with some ten additions in a row.
    """
    Z, q = Z_of(design), sample_feasible(design, 50, 1)
    M = design.problem(q).blocks()
    size = np.trace(M, axis1=1, axis2=2) if per_trace else 1.0
    price = Sensitivity(design, Z, per_trace)
    error = 64 * np.finfo(float).eps * np.einsum("ij,kij->k", np.abs(Z), np.abs(M)) / size
    assert (np.abs(price(q) - np.einsum("ij,kij->k", Z, M) / size) <= error).all()
    assert (np.abs(price.gradient(q)[0] - price(q)) <= error).all()
    assert abs(price(q[7:8])[0] - price(q)[7]) <= error[7]


@either
@both
@on_each
def test_gradient(design, per_trace, Z_of, derivative):
    """The derivative by every joint is the finite difference, prismatic joints and fixed ones included."""
    price = Sensitivity(design, Z_of(design), per_trace)
    q = sample_feasible(design, 6, 2)
    slope = price.gradient(q)[1]
    assert slope.shape == q.shape
    for x, expected in zip(q, slope, strict=True):
        numeric = derivative(lambda y: price(y[None])[0], x)
        np.testing.assert_allclose(numeric, expected, rtol=0, atol=1e-8 * np.abs(slope).max())


@both
def test_prices_are_linear_in_the_multiplier(per_trace):
    """A sum of multipliers pays the sum of their prices, and has the sum of their slopes."""
    q, Y, Z = sample_feasible(KR270, 20, 3), multiplier(KR270, 1), indefinite(KR270, 2)
    one, other, sum_ = (Sensitivity(KR270, z, per_trace) for z in (Y, Z, Y + 2 * Z))
    for value, a, b in zip(sum_.gradient(q), one.gradient(q), other.gradient(q), strict=True):
        np.testing.assert_allclose(value, a + 2 * b, rtol=0, atol=1e-11 * np.abs(np.r_[a, b]).max())


def test_per_trace_is_blind_to_the_amount_of_information():
    """Tenfold load, hundredfold information: prices per trace stay, plain prices grow a hundredfold."""
    strong, q = replace(KR270, wrench=10 * KR270.wrench), sample_feasible(KR270, 20, 4)
    Z = multiplier(KR270)
    np.testing.assert_allclose(Sensitivity(strong, Z, True)(q), Sensitivity(KR270, Z, True)(q), rtol=1e-11)
    np.testing.assert_allclose(Sensitivity(strong, Z)(q), 100 * Sensitivity(KR270, Z)(q), rtol=1e-11)


def optimal(design, per_trace):
    """The price of the optimum over some candidates: D's, or the condition number's per trace."""
    problem = design.problem(sample_feasible(design, 300, 9))
    return Sensitivity(design, relax(problem, create("O2" if per_trace else "D")).multipliers[0], per_trace)


@both
@on_each
def test_ascend_never_goes_down_and_stays_feasible(design, per_trace):
    """From a feasible pose the ascent ends in a feasible pose that is no cheaper; joints that are not free stay."""
    price, starts = optimal(design, per_trace), sample_feasible(design, 6, 5)
    before = price(starts)
    unit = float(np.abs(before).max())
    ends = np.array([price.ascend(q, unit, 1e-6) for q in starts])
    assert design.workspace.contains(ends).all()
    assert (price(ends) >= before - 1e-14 * unit).all()
    assert (price(ends) > before + 1e-3 * unit).sum() >= 4
    held = np.setdiff1d(np.arange(starts.shape[1]), design.free)
    np.testing.assert_array_equal(ends[:, held], starts[:, held])


@both
@on_each
def test_no_pose_nearby_is_dearer_than_the_end_of_an_ascent(design, per_trace):
    """Around the end of an ascent no feasible pose among thousands at random is dearer.

    The ascent ends where a step gains less than 1e-10 of the unit, and keeps 1e-9 away from every constraint,
    which costs about as much, as prices change by some units per radian.
    """
    price, starts = optimal(design, per_trace), sample_feasible(design, 4, 6)
    unit, rng = float(np.abs(price(starts)).max()), np.random.default_rng(0)
    limits, tried = design.workspace.robot.limits[:, design.free], 0
    for start in starts:
        end = price.ascend(start, unit, 1e-10)
        for radius in (1e-2, 1e-3):
            near = np.tile(end, (2000, 1))
            near[:, design.free] += rng.uniform(-radius, radius, size=(2000, len(design.free)))
            near[:, design.free] = np.clip(near[:, design.free], *limits)
            near = near[design.workspace.contains(near)]
            tried += len(near)
            assert price(near).max() <= price(end[None])[0] + 1e-8 * unit
    assert tried > 2000


@on_each
def test_an_ascent_ends_at_a_stationary_point(design):
    """At the end of an ascent the slope is a non-negative combination of the slopes of the active constraints.

    A step that gains no more than 1e-10 leaves a slope of sqrt(2 * 1e-10 * curvature), the latter below 50 units
    per squared radian.
    """
    price, starts = optimal(design, per_trace=False), sample_feasible(design, 8, 7)
    unit = float(price(starts).max())
    for start in starts:
        end = price.ascend(start, unit, 1e-10)[None]
        slope = price.gradient(end)[1][0, design.free] / unit
        active = design.workspace.gradient(end)[0][design.workspace.slack(end)[0] < 1e-6][:, design.free]
        assert nnls(np.vstack([active, np.zeros_like(slope)]).T, -slope)[1] < 1e-4
