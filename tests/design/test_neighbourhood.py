"""Neighbours of experiments, and what is read off them."""

import numpy as np
import pytest
from designs import LOADED

from edtk.design import sample_feasible
from edtk.design.neighbourhood import STEP, Neighbourhood

on_every_load = pytest.mark.parametrize("design", LOADED.values(), ids=LOADED)


@on_every_load
def test_neighbours(design):
    """First come the experiments themselves, then each moved along one movable variable; what is fixed stays."""
    x = sample_feasible(design, 6, 0).reshape(2, 3, -1)
    near = Neighbourhood(design, x)
    around = near.experiments.x
    lower, upper = design.limits
    assert around.shape == (1 + len(design.movable), *x.shape)
    np.testing.assert_array_equal(around[0], x)
    for a, variable in enumerate(design.movable):
        change = np.zeros(design.size)
        change[variable] = STEP * (upper - lower)[variable]
        np.testing.assert_allclose(around[1 + a] - x, np.broadcast_to(change, x.shape), rtol=0, atol=1e-14)


@on_every_load
def test_second_derivatives(design):
    """Of a quadratic form of the variables, differences of its slopes are its matrix, in parts of the ranges."""
    x = sample_feasible(design, 6, 1).reshape(2, 3, -1)
    near = Neighbourhood(design, x)
    Q = np.random.default_rng(2).normal(size=(design.size, design.size))
    Q = Q + Q.T
    H = near.second(near.first(near.experiments.x @ Q))
    move = design.movable
    expected = Q[np.ix_(move, move)] * np.outer(near.span, near.span)
    size = np.abs(expected).max()
    np.testing.assert_allclose(H, np.broadcast_to(expected, H.shape), rtol=0, atol=1e-7 * size)
    np.testing.assert_array_equal(H, np.swapaxes(H, -1, -2))


@on_every_load
def test_curved_slacks(design, derivative):
    """Second derivatives of the slacks are finite differences of their gradients, away from the poles of the tilt."""
    x = sample_feasible(design, 12, 2)[:, None]
    near = Neighbourhood(design, x)
    C = near.second(near.first(near.experiments.slack_gradient))
    move, used = design.movable, 0
    for one, exact in zip(x[:, 0], C[:, 0], strict=True):
        if abs(design.workspace.robot.forward(one[: len(design.fixed)])[2, 2]) > 0.8:
            continue
        used += 1

        def slope(y, one=one):
            full = one.copy()
            full[move] = y
            return design.at(full).slack_gradient[:, move]

        expected = derivative(slope, one[move]) * near.span[:, None] * near.span
        np.testing.assert_allclose(exact, expected, rtol=0, atol=2e-4 * np.abs(expected).max())
    assert used >= 4
