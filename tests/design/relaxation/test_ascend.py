"""The ascent to the largest sensitivity nearby."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from designs import DESIGNS, LOADED
from scipy.optimize import nnls
from test_sensitivity import both, multiplier, sensitivities

from criteria import create
from edtk.design.candidate_source import sample_feasible
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.search_continuum import ascend
from edtk.robots.loads.free_load import FreeLoad

pytestmark = pytest.mark.slow

on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)


def uphill(space, x, Z, per_trace=False, unit=1.0, accuracy=1e-6):
    """Ends (n, v) of ascents from experiments (n, v) under one multiplier (p, p)."""
    return ascend(space, x, np.tile(Z, (len(x), 1, 1)), per_trace, unit, accuracy)


@cache
def optimal(space, per_trace):
    """The multiplier of the optimum over some candidates, of D or per trace of O2."""
    problem = space.problem(sample_feasible(space, 300, 9))
    return relax(problem, create("O2" if per_trace else "D")).multipliers[0]


@both
@on_every_load
def test_ascend_never_goes_down_and_stays_feasible(space, per_trace):
    """A feasible start leads to a feasible end of no less sensitivity; fixed variables stay."""
    Z = optimal(space, per_trace)
    starts = sample_feasible(space, 6, 5)
    before = sensitivities(space, starts, Z, per_trace)[0]
    unit = float(np.abs(before).max())
    ends = uphill(space, starts, Z, per_trace, unit)
    after = sensitivities(space, ends, Z, per_trace)[0]
    assert space.at(ends).feasible.all()
    assert (after >= before - 1e-14 * unit).all()
    assert (after > before + 1e-3 * unit).sum() >= 4
    held = np.setdiff1d(np.arange(space.size), space.movable)
    np.testing.assert_array_equal(ends[:, held], starts[:, held])


@on_each
def test_each_start_climbs_under_its_own_multiplier(space):
    """Beside ascents under other multipliers an experiment ends as high as alone."""
    Z = np.array([multiplier(space, s) for s in range(4)])
    starts = sample_feasible(space, 4, 5)
    together = ascend(space, starts, Z)
    for start, end, z in zip(starts, together, Z, strict=True):
        alone = sensitivities(space, ascend(space, start[None], z[None]), z)[0][0]
        beside = sensitivities(space, end[None], z)[0][0]
        assert alone == pytest.approx(beside, abs=2e-6)  # twice the accuracy


@both
@on_each
def test_no_pose_nearby_has_a_larger_sensitivity(space, per_trace):
    """Among thousands of feasible poses around an end none has more than the accuracy allows."""
    Z = optimal(space, per_trace)
    starts = sample_feasible(space, 4, 6)
    accuracy = 1e-8
    unit = float(np.abs(sensitivities(space, starts, Z, per_trace)[0]).max())
    rng = np.random.default_rng(0)
    limits = space.workspace.robot.limits[:, space.free]
    tried = 0
    for end in uphill(space, starts, Z, per_trace, unit, accuracy):
        largest = sensitivities(space, end[None], Z, per_trace)[0][0]
        for radius in (1e-2, 1e-3):
            near = np.tile(end, (2000, 1))
            near[:, space.free] += rng.uniform(-radius, radius, size=(2000, len(space.free)))
            near[:, space.free] = np.clip(near[:, space.free], *limits)
            near = near[space.at(near).feasible]
            tried += len(near)
            found = sensitivities(space, near, Z, per_trace)[0]
            assert found.max() <= largest + accuracy * unit
    assert tried > 2000


@on_each
def test_an_ascent_ends_at_a_stationary_point(space):
    """At an end the slope is a non-negative combination of those of the active constraints.

    A step that gains no more than 1e-10 leaves a slope of sqrt(2 * 1e-10 * curvature), the latter
    below 50 units per squared radian.
    """
    Z = optimal(space, per_trace=False)
    starts = sample_feasible(space, 8, 7)
    unit = float(sensitivities(space, starts, Z)[0].max())
    for end in uphill(space, starts, Z, unit=unit, accuracy=1e-10):
        slope = sensitivities(space, end[None], Z)[1][0, space.free] / unit
        active = space.workspace.gradient(end)[space.workspace.slack(end) < 1e-6][:, space.free]
        assert nnls(np.vstack([active, np.zeros_like(slope)]).T, -slope)[1] < 1e-4


@on_each
def test_the_largest_force_is_the_best(space):
    """Sensitivities grow with the square of a force: the way up ends at the largest one.

    A force that is short by a share s has 2 s less sensitivity, and 1e-6 is the accuracy.
    """
    free = replace(space, load=FreeLoad(2500.0))
    Z = optimal(free, per_trace=False)
    starts = sample_feasible(free, 8, 3)
    unit = float(sensitivities(free, starts, Z)[0].max())
    ends = uphill(free, starts, Z, unit=unit, accuracy=1e-6)
    short = 1 - ends[:, len(space.fixed)]
    assert (2 * short * sensitivities(free, ends, Z)[0] <= 1e-6 * unit).all()
