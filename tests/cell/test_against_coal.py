"""Distances of a whole milling cell, and its plan, against coal, which shares no code with ours."""

from itertools import product
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import edtk
from edtk.cell.cell import Cell
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Plane, Shape
from edtk.robots.frames import Frames
from edtk.robots.rotations import aligned
from edtk.system.typing import Array

coal: ModuleType = pytest.importorskip("coal")
STUDY = Path(__file__).parents[2] / "studies" / "kr270_cell.toml"


def placed(shape: Shape) -> tuple[object, Array]:
    """A shape of coal, and where it is (4, 4) in the frame of its carrier."""
    pose = np.eye(4)
    if isinstance(shape, Capsule):
        along = shape.end - shape.start
        pose[:3, 3] = (shape.start + shape.end) / 2
        if shape.length > 0:
            pose[:3, :3] = aligned(along / shape.length)
        return coal.Capsule(shape.radius, shape.length), pose
    if isinstance(shape, Box):
        return coal.Box(*(2 * shape.half)), shape.pose
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, 2 * shape.half_height), shape.pose
    assert isinstance(shape, Plane)
    return coal.Halfspace(shape.normal, shape.offset), pose


def world(body: Body, frames: Frames) -> Array:
    """Where the carrier of a body is in one pose (4, 4)."""
    T = np.eye(4)
    if body.carrier is not None:
        rotation, origin = frames.bodies[body.carrier]
        T[:3, :3], T[:3, 3] = rotation.T, origin
    return T


def by_coal(cell: Cell, q: Array) -> Array:
    """Distances (pairs,) of all pairs of bodies in one pose (n,), negative where they overlap."""
    frames = cell.frames(q)
    parts = {}
    for body in cell.bodies:
        T = world(body, frames)
        parts[body.name] = [(s, T @ pose) for s, pose in map(placed, body.shapes)]
    found = []
    for first, second in cell.pairs:
        each = []
        for (a, A), (b, B) in product(parts[first], parts[second]):
            result = coal.DistanceResult()
            transforms = (coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (A, B))
            one, other = transforms
            each.append(coal.distance(a, one, b, other, coal.DistanceRequest(), result))
        found.append(min(each))
    return np.array(found)


def test_distances_are_those_of_coal_wherever_bodies_are_apart() -> None:
    """All pairs of a milling cell: equal where they are apart, and never apart for us alone."""
    study = edtk.load_study(STUDY)
    cell = study.cell
    assert cell is not None
    q = np.random.default_rng(2).uniform(*study.robot.limits, (60, study.robot.n))
    ours = cell.distances(q)
    theirs = np.array([by_coal(cell, one) for one in q])
    apart = theirs > 1e-3
    assert 0.5 < apart.mean() < 0.999
    np.testing.assert_allclose(ours[apart], theirs[apart], atol=2e-5)
    assert (ours[~apart] < 1.1e-3).all()


@pytest.mark.slow
def test_the_plan_of_the_milling_cell_is_free_for_coal_too() -> None:
    """A plan for four experiments keeps the margin by another library's measure."""
    study = edtk.load_study(STUDY).replace(candidates=200, starts=16)
    cell = study.cell
    assert cell is not None
    plan = edtk.plan(study, size=4, criterion="D")
    least = min(by_coal(cell, q).min() for q in plan.whole.q)
    assert least > cell.margin - 2e-5
    assert least == pytest.approx(float(cell.clearance(plan.whole.q).least.min()) + cell.margin)
