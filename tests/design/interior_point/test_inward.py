"""Starts on or outside the constraints, moved inside."""

import numpy as np
import pytest
from designs import LOADED

from edtk.design.candidate_source import sample_feasible
from edtk.design.interior_point.descend import MARGIN_OF_START, inward

on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)


@on_every_load
def test_starts_on_a_bound_are_pushed_inside(space):
    """Starts on a bound are moved off it; starts inside by the margin and fixed variables stay."""
    x = sample_feasible(space, 60, 4).reshape(30, 2, -1)
    held = np.setdiff1d(np.arange(space.size), space.movable)
    lower, upper = space.limits
    on = x.copy()
    move = space.movable
    on[::2, 0, move[0]] = lower[move[0]]
    on[1::2, 1, move[-1]] = upper[move[-1]]
    pushed = inward(space, on)
    margin = MARGIN_OF_START * (upper - lower)
    inside = space.at(pushed).slack.min(axis=-1, initial=np.inf) > 0
    assert inside.mean() > 0.9
    edge = np.array(margin[move])
    assert ((pushed[..., move] > lower[move]) & (pushed[..., move] < upper[move]))[inside].all()
    np.testing.assert_array_equal(pushed[..., held], on[..., held])
    away = (on[..., move] >= lower[move] + edge) & (on[..., move] <= upper[move] - edge)
    quiet = away.all(axis=-1) & (space.at(on).slack.min(axis=-1, initial=np.inf) >= MARGIN_OF_START)
    assert quiet.sum() > 10
    np.testing.assert_array_equal(pushed[quiet], on[quiet])
