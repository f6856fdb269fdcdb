"""Shapes move with transforms, and bodies that move are made of capsules."""

import numpy as np
import pytest

from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Mesh, Plane, capsule_arrays
from edtk.robots.rotations import transform

PLACED = transform((0.1, -0.2, 0.3), (0.4, 0.5, -0.6))
BALL = Capsule(np.zeros(3), np.zeros(3), 0.1)


def test_the_parts_of_a_body_move_as_one() -> None:
    """A point that lies on every part lies on every moved part, where the transform brings it."""
    point = np.array([0.0, 0.0, 0.1])
    body = Body(
        "rack",
        None,
        (
            Capsule(np.zeros(3), point, 0.05),
            Box(transform((0, 0, -0.2)), np.array([0.1, 0.2, 0.3])),
            Cylinder(transform((0, 0, 0.3)), 0.1, 0.2),
            Plane(np.array([0.0, 0.0, 2.0]), 0.1),
        ),
        meshes=(Mesh(np.array([point, point, point]), np.array([[0, 1, 2]])),),
    )
    moved = PLACED[:3, :3] @ point + PLACED[:3, 3]
    capsule, box, cylinder, plane = body.moved(PLACED).shapes
    assert isinstance(capsule, Capsule)
    assert isinstance(box, Box)
    assert isinstance(cylinder, Cylinder)
    assert isinstance(plane, Plane)
    assert np.allclose(capsule.end, moved)
    assert capsule.length == pytest.approx(0.1)
    assert np.allclose(box.pose @ [0, 0, 0.3, 1], [*moved, 1])
    assert np.allclose(cylinder.pose @ [0, 0, -0.2, 1], [*moved, 1])
    assert plane.normal @ moved == pytest.approx(plane.offset)
    assert np.allclose(body.moved(PLACED).meshes[0].vertices, moved)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Capsule(np.zeros(3), np.zeros(3), 0.0), "radius is 0"),
        (lambda: Box(np.eye(4), np.array([0.1, -0.1, 0.1])), "size is -0.1"),
        (lambda: Cylinder(np.eye(4), 0.1, np.inf), "height is inf"),
        (lambda: Plane(np.zeros(3), 0.0), "length of the normal is 0"),
        (lambda: Body("hand", 5, ()), "hand: has no shape"),
        (lambda: Body("hand", 5, (Box(np.eye(4), np.ones(3)),)), "not made of capsules"),
        (lambda: Body("load", None, (BALL,), hangs_at=np.zeros(3)), "hangs from nothing"),
    ],
)
def test_what_is_no_solid_is_refused(make: object, said: str) -> None:
    """A shape without size, and a body that moves and is no union of capsules, are errors."""
    assert callable(make)
    with pytest.raises(ValueError, match=said):
        make()


def test_capsules_stack_into_arrays() -> None:
    """The arrays of capsules have one row for each, and none of none."""
    starts, ends, radii = capsule_arrays((BALL, Capsule(np.ones(3), np.zeros(3), 0.2)))
    assert starts.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert ends.tolist() == [[0, 0, 0], [0, 0, 0]]
    assert radii.tolist() == [0.1, 0.2]
    assert [array.shape for array in capsule_arrays(())] == [(0, 3), (0, 3), (0,)]
