"""Clearances of an arm in its cell: batches, derivatives, pairs, and the slack of searches."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.cell.cell import Cell, Clear, Placed, every_pair
from edtk.cell.shapes import Body, Capsule, Plane
from edtk.robots.load_robot import load_robot
from tests.support.cells import cell_of, surroundings


@pytest.fixture(params=["kuka_kr270", "palletiser"])
def cell(request):
    return cell_of(load_robot(request.param))


def poses(cell, count, seed=1):
    return np.random.default_rng(seed).uniform(*cell.robot.limits, size=(count, cell.robot.n))


def test_the_clearance_is_the_least_distance_and_names_its_pair(cell):
    q = poses(cell, 400)
    distances = cell.distances(q)
    found = cell.clearance(q)
    assert found.least == pytest.approx(distances.min(axis=1), abs=1e-8)
    of_pair = np.take_along_axis(distances, found.pair[:, None], axis=1)[:, 0]
    assert of_pair == pytest.approx(found.least, abs=1e-8)
    assert 0 < found.free.mean() < 1


def test_poses_are_free_where_the_clearance_is_not_negative(cell):
    q = poses(cell, 2000)
    assert (cell.free(q) == cell.clearance(q).free).all()


def test_a_margin_is_taken_off_the_clearance():
    plain, wide = (cell_of(load_robot("kuka_kr270"), margin) for margin in (0.0, 0.05))
    q = poses(plain, 100)
    assert wide.clearance(q).least == pytest.approx(plain.clearance(q).least - 0.05, abs=1e-8)
    assert (wide.free(q) == (plain.clearance(q).least >= 0.05)).all()


def test_batches_of_any_shape_are_the_same_as_single_poses(cell):
    q = poses(cell, 6).reshape(2, 3, -1)
    found = cell.clearance(q)
    assert found.least.shape == (2, 3)
    assert cell.gradient(q).shape == q.shape
    for index in np.ndindex(2, 3):
        one = cell.clearance(q[index])
        assert one.least == pytest.approx(found.least[index], abs=1e-9)
        assert one.names(()) == found.names(index)


@pytest.mark.parametrize("away", [0.0, 3e3])
def test_no_lower_bound_of_a_pair_is_above_its_distance(cell, away):
    """Single precision leaves what it loses, kilometres from the origin, too."""
    shift = away * np.array([0.6, -0.64, 0.48])
    solids = cell.solids
    own = replace(solids.standing, middle=solids.standing.middle + solids.standing.rotation @ shift)
    normals, offsets = solids.planes
    moved = replace(solids, standing=own, planes=(normals, offsets + normals @ shift))
    placed = Placed(
        *(ends + shift[:, None, None] for ends in solids.placed(cell.frames(poses(cell, 500))))
    )
    bounds = moved.bounds(placed)
    pair, pose = (one.ravel() for one in np.indices(bounds.shape))
    near = moved.exactly(placed, pair, pose)
    left = near.nearest.distance - bounds[near.pair, near.pose]
    assert (left >= 0).all()
    assert left.min() < 1e-3 + 1e-5 * away


def differences(function, q, h=1e-6):
    steps = h * np.eye(q.shape[-1])
    return np.stack([(function(q + e) - function(q - e)) / (2 * h) for e in steps], axis=-1)


def test_the_gradient_is_what_the_clearance_changes_by(cell):
    q = poses(cell, 300)
    found = cell.gradient(q)
    expected = differences(lambda q: cell.clearance(q).least, q)
    assert found == pytest.approx(expected, abs=1e-5)


def slack(cell, q):
    return Clear(cell).slack(cell.robot.frames(q))[0]


def test_the_slack_of_searches_is_positive_in_free_poses_alone(cell):
    q = poses(cell, 3000)
    least = cell.clearance(q).least
    found = slack(cell, q)
    assert (least[found >= 0] >= 0).all()
    # Several pairs that are equally near cost a few millimetres, never more.
    assert (found[least >= 0.015] > 0).all()


def test_the_slack_has_the_derivative_that_it_says_also_at_the_end_of_its_reach(cell):
    q = poses(cell, 2000)
    least = cell.clearance(q).least
    near = q[(least > -0.3) & (least < 0.06)][:150]
    found = Clear(cell).gradient(cell.robot.frames(near))[0].T
    expected = differences(lambda q: slack(cell, q), near)
    assert found == pytest.approx(expected, abs=1e-5)


def test_the_slack_of_one_pair_is_zero_where_it_touches():
    robot = load_robot("kuka_kr270")
    ball = Body("ball", 5, (Capsule(np.zeros(3), np.zeros(3), 0.2),))
    q = np.zeros(robot.n)
    height = float(robot.frames(q, [5]).bodies[5][1][2])
    for above, error in ((0.0, 1e-9), (0.01, 1e-4)):
        floor = Body("floor", None, (Plane(np.array([0.0, 0, 1]), height - 0.2 - above),))
        cell = Cell(robot, (ball, floor), 0.0, every_pair((ball, floor)))
        assert cell.clearance(q).least == pytest.approx(above, abs=1e-9)
        assert float(slack(cell, q)) == pytest.approx(above, abs=error)


def test_a_cell_with_nothing_to_look_at_is_free():
    robot = load_robot("kuka_kr270")
    cell = Cell(robot, (), 0.0, ())
    q = np.zeros((2, robot.n))
    found = cell.clearance(q)
    assert np.isinf(found.least).all()
    assert found.names(0) is None
    assert cell.free(q).all()
    assert (cell.gradient(q) == 0).all()
    assert cell.distances(q).shape == (2, 0)
    assert (slack(cell, q) > 0).all()


def test_pairs_that_name_no_body_or_two_that_move_together_are_refused():
    robot = load_robot("kuka_kr270")
    bodies = tuple(surroundings())
    with pytest.raises(ValueError, match="no body 'wall'; the cell has table, column"):
        Cell(robot, bodies, 0.0, (("table", "wall"),))
    with pytest.raises(ValueError, match="'table' and 'floor' move together"):
        Cell(robot, bodies, 0.0, (("table", "floor"),))
    with pytest.raises(ValueError, match="two bodies have one name"):
        Cell(robot, (*bodies, bodies[0]), 0.0, ())
