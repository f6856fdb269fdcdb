"""Neighbours of experiments, and what is read off them."""

import numpy as np
import pytest
from designs import LOADED

from edtk.design.candidate_source import sample_feasible
from edtk.design.interior_point.objective import STEP, Neighbourhood

on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)


@on_every_load
def test_neighbours(space):
    """The experiments come first, then each moved along one movable variable after another."""
    x = sample_feasible(space, 6, 0).reshape(2, 3, -1)
    near = Neighbourhood(space, x)
    around = near.experiments.x
    lower, upper = space.limits
    assert around.shape == (1 + len(space.movable), *x.shape)
    np.testing.assert_array_equal(around[0], x)
    for a, variable in enumerate(space.movable):
        change = np.zeros(space.size)
        change[variable] = STEP * (upper - lower)[variable]
        np.testing.assert_allclose(
            around[1 + a] - x, np.broadcast_to(change, x.shape), rtol=0, atol=1e-14
        )


@on_every_load
def test_second_derivatives(space):
    """Of a quadratic form the differences of slopes are its matrix, in parts of the ranges."""
    x = sample_feasible(space, 6, 1).reshape(2, 3, -1)
    near = Neighbourhood(space, x)
    Q = np.random.default_rng(2).normal(size=(space.size, space.size))
    Q = Q + Q.T
    H = near.second(near.first(near.experiments.x @ Q))
    move = space.movable
    expected = Q[np.ix_(move, move)] * np.outer(near.span, near.span)
    size = np.abs(expected).max()
    np.testing.assert_allclose(H, np.broadcast_to(expected, H.shape), rtol=0, atol=1e-7 * size)
    np.testing.assert_array_equal(H, np.swapaxes(H, -1, -2))


@on_every_load
def test_curved_slacks(space, derivative):
    """Second derivatives of slacks are differences of gradients, off the poles of the tilt."""
    x = sample_feasible(space, 12, 2)[:, None]
    near = Neighbourhood(space, x)
    C = near.second(near.first(near.experiments.slack_gradient))
    move = space.movable
    used = 0
    for one, exact in zip(x[:, 0], C[:, 0], strict=True):
        if abs(space.workspace.robot.forward(one[: len(space.fixed)])[2, 2]) > 0.8:
            continue
        used += 1

        def slope(y, one=one):
            full = one.copy()
            full[move] = y
            return space.at(full).slack_gradient[:, move]

        expected = derivative(slope, one[move]) * near.span[:, None] * near.span
        np.testing.assert_allclose(exact, expected, rtol=0, atol=2e-4 * np.abs(expected).max())
    assert used >= 4
