"""Capsules and boxes contain the triangles that they are fitted to, and stand out little."""

import numpy as np
import pytest

from edtk.cell.containing import containing, inside
from edtk.cell.shapes import Box, Capsule

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def hull(points):
    """Triangles of the convex hull of points."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).simplices]


def on(triangles, count=4000, seed=0):
    """Points on triangles, corners and edges among them."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(3), count)
    weights[: count // 4] = np.eye(3)[rng.integers(3, size=count // 4)]
    weights[count // 4 : count // 2, 0] = 0
    weights /= weights.sum(axis=1)[:, None]
    return np.einsum("kc,kcx->kx", weights, triangles[rng.integers(len(triangles), size=count)])


def in_any(shapes, points):
    return np.any([inside(shape, points) for shape in shapes], axis=0)


def test_shapes_do_not_depend_on_how_many_corners_are_looked_at_at_once(monkeypatch) -> None:
    """Also where several corners are as high in a direction, as those of a box are."""
    part = np.concatenate([hull(CUBE), hull(CUBE * 0.5 + [0.5, 0.5, 1.0])])
    at_once = containing(part, boxes=True)
    monkeypatch.setattr("edtk.cell.containing.CORNERS_AT_ONCE", 7)
    assert [str(one) for one in containing(part, boxes=True)] == [str(one) for one in at_once]


@pytest.mark.parametrize("boxes", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_every_point_of_a_surface_is_within_a_shape(seed: int, boxes: bool) -> None:
    """No point of an L-shaped part, wherever it lies, is outside of all shapes."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    arm = hull(CUBE * [0.8, 0.1, 0.1])
    foot = hull(CUBE * [0.1, 0.1, 0.5] + [0.7, 0, 0])
    triangles = np.concatenate([arm, foot]) @ turn.T + rng.normal(size=3)
    shapes = containing(triangles, boxes=boxes)
    assert in_any(shapes, on(triangles)).all()
    assert 2 <= len(shapes) <= 6


def test_a_rod_is_one_capsule_and_a_ball_a_ball() -> None:
    """The capsule of a round rod has its radius, and that of a ball has no length."""
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rod = hull(np.concatenate([ring, ring + np.array([0, 0, 1.0])]))
    (capsule,) = containing(rod, most=1)
    assert isinstance(capsule, Capsule)
    assert capsule.radius == pytest.approx(0.055, abs=0.005)
    assert abs((capsule.end - capsule.start)[2]) == pytest.approx(0.97, abs=0.03)
    points = np.random.default_rng(0).normal(size=(300, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1)[:, None]
    (ball,) = containing(hull(points + 1), most=1)
    assert isinstance(ball, Capsule)
    assert ball.radius < 0.21
    assert ball.length < 0.02


def test_a_wide_part_gets_several_capsules_that_are_tighter() -> None:
    """Capsules of a plate stand out less the more there are."""
    plate = hull(CUBE * [0.6, 0.4, 0.05])
    volumes = []
    for most in (1, 4, 8):
        shapes = containing(plate, tight=0.005, most=most)
        assert len(shapes) <= most
        volumes.append(sum(np.pi * s.radius**2 * (s.length + 4 / 3 * s.radius) for s in shapes))
        assert in_any(shapes, on(plate)).all()
    assert volumes[0] > 2 * volumes[1] > 2 * volumes[2]


def test_what_stands_gets_boxes() -> None:
    """A cuboid along the axes is held by itself, and a flat or a tiny part has some thickness."""
    (box,) = containing(hull(CUBE * [1.0, 2.0, 0.5]), boxes=True)
    assert isinstance(box, Box)
    assert box.half == pytest.approx([0.5, 1.0, 0.25])
    flat = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=float)
    for boxes in (False, True):
        shapes = containing(flat, boxes=boxes)
        assert in_any(shapes, on(flat)).all()
