"""Poses as a controller takes them, and plans that are judged as they are printed."""

import numpy as np
import pytest
from designs import KR270, LOADED, STUDY

from criteria import create
from edtk.cell.sight import AllSeen
from edtk.design.candidate_source import sample_feasible
from edtk.design.exact.round_poses import round_poses, to_steps
from edtk.design.plan import Plan
from edtk.measure.pose_table import DIGITS, in_file_units, pose_factors
from edtk.study.run_study import random_case

CRITERION = create("A")


def at_the_edge(space, count):
    """Poses (count, v) at the edge of the feasible set, as close to it as numbers come."""
    inside = sample_feasible(space, count, 5)
    lower, upper = space.limits
    outside = inside.copy()
    movable = space.free
    outside[:, movable] = np.random.default_rng(6).uniform(
        lower[movable] - 1, upper[movable] + 1, size=(count, len(movable))
    )
    outside[space.at(outside).feasible] += 10 * (upper - lower)
    for _ in range(60):
        middle = (inside + outside) / 2
        feasible = space.at(middle).feasible[:, None]
        inside = np.where(feasible, middle, inside)
        outside = np.where(feasible, outside, middle)
    return inside


@pytest.mark.parametrize("name", ["kr270 fixed", "odd fixed", "odd bounded"])
def test_feasible_and_as_good_as_before(name):
    """Every designed joint has three decimals, at the edge of the feasible set too."""
    space = LOADED[name]
    x = at_the_edge(space, 12)
    repeats = np.arange(1.0, 13.0)
    found, times = round_poses(space, CRITERION, x, repeats)
    np.testing.assert_array_equal(times, repeats)
    assert space.at(found).feasible.all()
    free = space.free
    factors = pose_factors(space.workspace.robot)[free]
    values = found[:, free] / factors
    np.testing.assert_allclose(values, np.round(values, DIGITS), atol=1e-9)
    assert np.abs(values - x[:, free] / factors).max() <= 3.001 * 10**-DIGITS
    rest = [j for j in range(space.size) if j not in free]
    np.testing.assert_array_equal(found[:, rest], x[:, rest])
    costs = CRITERION.cost(space.at(np.array([x, found])).information(np.array([repeats] * 2)))
    assert costs[1] == pytest.approx(costs[0], rel=1e-3)


def test_markers_at_the_edge_of_what_is_seen_are_read_as_before():
    """Rounding to the nearest steps would hide some of them, which cost a row or three each."""
    marker = {"name": "a", "position_mm": [0, 100, 0], "normal": [0, 1, 0], "acceptance_deg": 60}
    tracker = {"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]}
    keys = {
        "noise": tracker,
        "measurement": {},
        "marker": [marker, {"name": "b", "position_mm": [0, 0, 80]}],
        "sight": {},
    }
    space = STUDY.replace(**keys).space
    x = sample_feasible(space, 300, 5)
    seen = space.sight.seen(x[:, :6])[:, 0]
    read, hidden = x[seen][:12], x[~seen][:12]
    for _ in range(60):
        middle = (read + hidden) / 2
        seen = space.sight.seen(middle[:, :6])[:, :1]
        read, hidden = np.where(seen, middle, read), np.where(seen, hidden, middle)
    read = read[space.at(read).feasible]
    nearest = to_steps(space, read)
    assert not space.sight.seen(nearest[:, :6])[:, 0].all()
    found, _ = round_poses(space, CRITERION, read, np.ones(len(read)), merge=False)
    assert space.sight.seen(found[:, :6])[:, 0].all()
    factors = pose_factors(space.workspace.robot)[space.free]
    steps = found[:, space.free] / factors
    np.testing.assert_allclose(steps, np.round(steps, DIGITS), atol=1e-9)


@pytest.mark.slow
def test_markers_in_a_corner_of_what_is_seen_are_read_as_before():
    """Where two markers are at their edges, no step nearby may read both: farther ones do.

    Newton's steps bring poses to where both look away by all but a ten-millionth of what they may.
    """
    markers = [
        {"name": name, "position_mm": place, "normal": normal, "acceptance_deg": 50}
        for name, place, normal in (
            ("a", [0, 100, 0], [0, 1, 0]),
            ("b", [0, 0, 80], [0.9, 0.3, 0.3]),
        )
    ]
    tracker = {"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]}
    space = STUDY.replace(noise=tracker, measurement={}, marker=markers, sight={}).space
    x = sample_feasible(space, 300, 5)
    every = AllSeen(space.sight)
    for _ in range(30):
        frames = space.sight.robot.frames(x[:, :6])
        gradient = every.gradient(frames)[:, space.free]
        G = np.moveaxis(gradient, -1, 0)
        short = 1e-7 - every.slack(frames).T
        x[:, space.free] += 0.5 * (np.linalg.pinv(G) @ short[..., None])[..., 0]
    feasible = space.at(x).feasible & (np.abs(short).max(axis=-1) < 1e-8)
    x = x[feasible & space.sight.seen(x[:, :6]).all(axis=-1)]
    assert len(x) > 5
    assert not space.sight.seen(to_steps(space, x)[:, :6]).all()
    found, _ = round_poses(space, CRITERION, x, np.ones(len(x)), merge=False)
    assert space.sight.seen(found[:, :6]).all()


def test_poses_that_are_equal_for_a_controller_are_one():
    """Poses within a step are merged into the most repeated one, whose number becomes the sum."""
    x = sample_feasible(KR270, 3, 4)
    step = np.deg2rad(1e-3)
    near = x[[0, 1, 2, 1, 0]]
    near[3, 2] += 0.6 * step
    near[4, 1] += 2.6 * step
    found, times = round_poses(KR270, CRITERION, near, np.array([1.0, 1, 2, 4, 1]))
    assert times.tolist() == [1, 2, 5, 1]
    assert len(found) == 4


def test_a_file_gives_the_same_plan_back(tmp_path):
    """Poses come back from the printed digits bit by bit, and so does the cost."""
    x, times = round_poses(KR270, CRITERION, sample_feasible(KR270, 4, 4), np.ones(4))
    plan = KR270.plan(x, times.astype(int))
    path = tmp_path / "plan.csv"
    robot = KR270.workspace.robot
    plan.to_csv(path, robot)
    back = Plan.from_csv(path, robot, {}, None)
    assert back.q.tobytes() == (plan.q + 0.0).tobytes()
    assert CRITERION.cost(KR270.information(back)) == CRITERION.cost(KR270.information(plan))
    cells = path.read_text().splitlines()[1].split(",")[:6]
    assert all(len(cell.partition(".")[2]) <= DIGITS for cell in cells)


def test_a_rounding_that_conversion_leaves_is_not_printed():
    """A number of three decimals is printed as such; any other is as it is; zero has no sign."""
    robot = KR270.workspace.robot
    values = np.array([[12.345, -0.0, 6.4e-8, 1 / 3, 179.999, -1e-12]])
    shown = in_file_units(robot, values * pose_factors(robot))
    assert shown[0, [0, 4]].tolist() == [12.345, 179.999]
    assert not np.signbit(shown[0, [1, 5]]).any()
    np.testing.assert_allclose(shown[0, [2, 3]], [6.4e-8, 1 / 3], rtol=1e-12)


def test_a_random_plan_too():
    """The plan that others are compared with is printed, and judged, as a controller takes it."""
    plan = random_case(STUDY, 3, 0).plan
    values = np.rad2deg(plan.q)
    np.testing.assert_allclose(values, np.round(values, DIGITS), atol=1e-9)
