"""Pairs of a cell: those that a joint connects, those that always touch, and what hangs."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from edtk.cell.cell import Cell
from edtk.cell.containing import containing, inside
from edtk.cell.legs import prove_legs
from edtk.cell.pairs import pairs_to_look_at
from edtk.cell.robot_bodies import hanging_bodies, robot_bodies
from edtk.cell.shapes import Body, Capsule, Mesh
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import robot_from_dict
from edtk.robots.rotations import transform

ROBOT = load_robot("kuka_kr270")
BODIES = robot_bodies(ROBOT, "kuka_kr270")
OWN = {body.name for body in BODIES}
POINT = np.array([0.3, 0.1, -0.2])


def ball(name, carrier, place, radius=0.05):
    return Body(name, carrier, (Capsule(np.array(place), np.array(place), radius),))


def weight(swing, rope=0.4):
    return hanging_bodies(
        "load", 5, POINT, rope=rope, radius=0.1, height=0.3, swing=swing, rope_radius=0.01
    )


def test_neighbours_are_adjacent_and_nothing_is_left_out() -> None:
    """Each pair of bodies that move against each other is in one list."""
    found = pairs_to_look_at(ROBOT, BODIES, own=OWN)
    assert ("base", "carousel") in found.adjacent
    assert ("forearm", "wrist") in found.adjacent
    assert ("forearm", "flange") in found.looked_at
    assert len(found.adjacent) == 6
    assert len(found.looked_at) + len(found.adjacent) + len(found.always) == 7 * 6 / 2


def test_parts_of_the_arm_that_always_touch_are_listed() -> None:
    """A ring about the wrist that reaches into the forearm is no mistake of a person."""
    ring = ball("ring", 5, [0, 0, 0], 0.3)
    own = {*OWN, "ring"}
    found = pairs_to_look_at(ROBOT, (*BODIES, ring), own=own)
    assert found.always == (("forearm", "ring"),)
    with pytest.raises(ValueError, match=r"'forearm' and 'ring' touch in each of 1024 poses"):
        pairs_to_look_at(ROBOT, (*BODIES, ring), own=OWN)
    ignored = [frozenset(("ring", "forearm"))]
    found = pairs_to_look_at(ROBOT, (*BODIES, ring), own=OWN, ignored=ignored)
    assert not found.always


def test_joints_that_stand_make_pairs_that_always_touch() -> None:
    """A box that the arm leaves when joint 1 turns is in the way where that joint stands."""
    post = ball("post", None, [0.6, 0, 0.75], 0.1)
    assert pairs_to_look_at(ROBOT, (*BODIES, post), own=OWN).looked_at
    with pytest.raises(ValueError, match="'carousel' and 'post' touch"):
        pairs_to_look_at(ROBOT, (*BODIES, post), own=OWN, fixed={0: 0.0})


def test_a_weight_moves_with_its_point_and_does_not_turn() -> None:
    """The derivative of its distance agrees with differences, and its height follows the point."""
    still = ball("post", None, [1.5, 0.4, 0.5])
    cell = Cell(ROBOT, (*weight(0.1), still), 0.0, (("load", "post"),))
    q = np.random.default_rng(0).uniform(*ROBOT.limits, (5, 6))
    step = 1e-6 * np.eye(6)
    up, down = (cell.clearance(q[:, None] + sign * step).least for sign in (1, -1))
    assert np.allclose(cell.gradient(q), (up - down) / 2e-6, atol=1e-6)
    turned = ROBOT.frames(q, [5])
    rotation, origin = turned.bodies[5]
    hook = np.einsum("k,kcn->nc", POINT, rotation) + origin.T
    floor = ball("floor", None, [0, 0, -1000.0], 990.0)
    low = Cell(ROBOT, (*weight(0.0), floor), 0.0, (("load", "floor"),)).distances(q)[:, 0]
    assert np.allclose(low - low[0], hook[:, 2] - hook[0, 2], atol=0.02)


@pytest.mark.parametrize("swing", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("rope", [0.0, 0.5])
def test_all_places_of_a_swinging_weight_are_held(swing: float, rope: float) -> None:
    """Points of weight and rope, turned about the hook by up to the swing, are within."""
    rng = np.random.default_rng(1)
    count = 3000
    around = rng.uniform(0, 2 * np.pi, count)
    side = 0.1 * np.ones(count)
    depth = rope + 0.3 * rng.integers(0, 2, count)
    solid = np.column_stack([side * np.cos(around), side * np.sin(around), -depth])
    line = np.column_stack([0 * side, 0 * side, -rope * rng.uniform(size=count)])
    axis = rng.normal(size=(count, 3)) * [1, 1, 0]
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    angle = rng.uniform(-swing, swing, count)
    for body, points in zip(weight(swing, rope), (solid, line), strict=False):
        turned = (
            points * np.cos(angle)[:, None]
            + np.cross(axis, points) * np.sin(angle)[:, None]
            + axis * (np.sum(axis * points, axis=1) * (1 - np.cos(angle)))[:, None]
        )
        assert body.hangs_at is POINT
        held = np.any([inside(shape, turned) for shape in body.capsules], axis=0)
        assert held.all()


def test_a_weight_can_swing_into_what_carries_it() -> None:
    """The weight is looked at with the last joint's body, in poses and on legs; its rope is not."""
    arm = (*BODIES, *weight(0.0, rope=0.05))
    found = pairs_to_look_at(ROBOT, arm, own=OWN)
    assert ("flange", "load") in found.looked_at
    cell = Cell(ROBOT, arm, 0.0, (("flange", "load"),))
    q = np.deg2rad([[0, -90, 90, 0, 0, 0], [0, -90, 90, 0, -120, 0], [0, -90, 90, 170, 0, 0]])
    assert len(set(cell.clearance(q).least.round(3))) == 3
    step = 1e-6 * np.eye(6)
    up, down = (cell.clearance(q[:, None] + sign * step).least for sign in (1, -1))
    assert np.allclose(cell.gradient(q), (up - down) / 2e-6, atol=1e-6)
    legs = prove_legs(cell, q[[0, 0, 1]], q[[1, 2, 2]])
    along = np.linspace(0, 1, 2000)[:, None, None]
    sampled = cell.clearance(q[[0, 0, 1]] + along * (q[[1, 2, 2]] - q[[0, 0, 1]])).least
    assert (legs.free == (sampled.min(axis=0) >= 0)).all()


def test_meshes_decide_of_parts_that_pass_close_by() -> None:
    """A pair whose capsules touch is left out where its meshes never do."""
    plate = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (0, 0.02)])
    triangles = plate[ConvexHull(plate).simplices]
    mesh = Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))

    def part(name, carrier, height):
        body = Body(name, carrier, containing(triangles, most=2), "URDF", (mesh,))
        return body.moved(transform([0, 0, height]))

    robot = robot_from_dict(
        {
            "name": "turntable",
            "source": "test",
            "joints": [
                {"name": n, "origin_m": [0, 0, 0], "axis": [0, 0, 1], "limits_deg": [-90, 90]}
                for n in ("a", "b")
            ],
        }
    )
    for height, never in ((0.05, True), (0.015, False)):
        bodies = (part("below", None, 0.0), part("above", 1, height))
        found = pairs_to_look_at(robot, bodies, 0.0, own=("below", "above"))
        assert (found.never == (("below", "above"),)) == never
        assert (found.always == (("below", "above"),)) == (not never)
