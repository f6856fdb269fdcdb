"""Plans on the steps of a controller are as good as before, where small differences count too."""

import numpy as np
import pytest
from designs import KR270
from gantry import ROBOT, STUDY
from loaded_arm import STUDY as LOADED

from criteria import create
from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.design.candidate_source import sample_feasible
from edtk.design.design_space import plan_costs
from edtk.design.exact.refine import refine
from edtk.design.exact.round_poses import LOSS_BY_ROUNDING, round_plan, round_poses
from edtk.study.study import load_study
from edtk.system.time_limit import time_limit

# Best plans of three experiments before rounding: the wrist has a small torque of one sign in the
# pose that is measured twice, and of the other sign in the second. So its compliance, which does
# not matter, is told apart from those that do.
SINGULAR = (
    [[-148.088386, 2.284571, -143.139766], [-148.089395, 2.285035, -143.135013]],
    [[-148.088422, 2.284630, -143.137584], [-148.088492, 2.285056, -143.139172]],
)
REPEATS = np.array([2.0, 1.0])


@pytest.fixture(scope="module")
def gantry(tmp_path_factory):
    """The study of the arm."""
    folder = tmp_path_factory.mktemp("gantry")
    (folder / "gantry.toml").write_text(ROBOT)
    (folder / "study.toml").write_text(STUDY)
    return load_study(folder / "study.toml")


def cost(space, criterion, x, repeats):
    """The cost of one plan."""
    return float(criterion.cost(space.problem(x).information(repeats)))


def singular(study, number):
    """One of the plans above: its space, its criterion and its experiments (2, v)."""
    space = study.space
    x = np.tile(sample_feasible(space, 1, 0), (2, 1))
    x[:, space.free] = np.deg2rad(SINGULAR[number])
    return space, study.criterion("rho0"), x


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_small_differences_that_count(gantry, number):
    """The nearest steps cost more than 1e-3; the plan on steps costs what it did before."""
    space, criterion, x = singular(gantry, number)
    before = cost(space, criterion, x, REPEATS)
    nearest = cost(space, criterion, *round_poses(space, criterion, x, REPEATS, merge=False))
    assert nearest > before * 1.001
    found, repeats = round_plan(space, criterion, x, REPEATS)
    assert repeats.sum() == REPEATS.sum()
    assert cost(space, criterion, found, repeats) <= before * (1 + LOSS_BY_ROUNDING)
    steps = np.rad2deg(found[:, space.free]) * 1000
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert space.at(found).feasible.all()


@pytest.mark.slow
def test_poses_a_step_apart_are_one_only_if_that_costs_nothing(gantry):
    """Of the second plan the nearest steps are one pose for a controller; its plan keeps two."""
    space, criterion, x = singular(gantry, 1)
    assert len(round_poses(space, criterion, x, REPEATS)[0]) == 1
    found, repeats = round_plan(space, criterion, x, REPEATS)
    assert repeats.tolist() == REPEATS.tolist()
    # Without merging it is the same plan.
    np.testing.assert_array_equal(found, round_plan(space, criterion, x, REPEATS, merge=False)[0])


def test_a_prior_counts_once(gantry):
    """Beside a prior that tells the wrist, the nearest steps do; nothing is moved further."""
    space, criterion, x = singular(gantry, 0)
    prior = np.diag([0.0, 0.0, 1e13])
    knowing = space.with_kept(prior, 3)
    found, repeats = round_plan(knowing, criterion, x, REPEATS)
    nearest = round_poses(knowing, criterion, x, REPEATS)
    np.testing.assert_array_equal(found, nearest[0])
    np.testing.assert_array_equal(repeats, nearest[1])


def test_ordinary_plans_take_the_nearest_steps():
    """Where the plan is flat around its optimum, the steps are those of `round_poses`."""
    criterion = create("A")
    x = refine(KR270, criterion, sample_feasible(KR270, 4, 4)[None], np.ones((1, 4)))[0][0]
    found, repeats = round_plan(KR270, criterion, x, np.ones(4))
    nearest, times = round_poses(KR270, criterion, x, np.ones(4))
    np.testing.assert_array_equal(found, nearest)
    np.testing.assert_array_equal(repeats, times)
    before = cost(KR270, criterion, x, np.ones(4))
    assert abs(cost(KR270, criterion, found, repeats) / before - 1) < LOSS_BY_ROUNDING


def test_without_time_a_plan_on_steps_tells_all():
    """Visits whose second joint is at one step tell it no more; one of them moves, time or not."""
    designs = GeometryDesigns.of(LOADED)
    criterion, space = designs.criterion("rho0"), designs.space(6)
    turned = [0.75812465, 0.27897028, 0.27879475, -1.05687726, 1.00012068, -0.13857653]
    above = np.array([2.86, -2.57, -2.57, -1.96, 1.00, 3.23]) * 1e-6  # of -60 deg [rad]
    x = np.column_stack([turned, np.deg2rad(-60.0) + above, [0, 1, 1, 1, 1, 0]])
    repeats = np.ones(6)

    def costs(*plan):
        return plan_costs(criterion, space.at(plan[0][None]), plan[1][None])[0]

    assert np.isfinite(costs(x, repeats))
    assert np.isinf(costs(*round_poses(space, criterion, x, repeats)))
    with time_limit(0.0):
        found = round_plan(space, criterion, x, repeats)
    assert costs(*found) < 1.1 * costs(x, repeats)
