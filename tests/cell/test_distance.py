"""Distances of segments from solids, against dense sampling and differences."""

import numpy as np
import pytest

from edtk.cell.distance import (
    segment_to_box,
    segment_to_convex,
    segment_to_plane,
    segment_to_segment,
    signed_box,
    signed_cylinder,
)

COUNT = 300
STEPS = np.linspace(0.0, 1.0, 201)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def along(a, b):
    """Points (3, k, 201) of segments."""
    return a[:, :, None] + STEPS * (b - a)[:, :, None]


def solids(rng):
    """Signed distances by points and indices, of some boxes and some cylinders."""
    half = rng.uniform(0.1, 1.0, (3, COUNT))
    radius, height = rng.uniform(0.1, 1.0, (2, COUNT))
    return {
        "box": lambda x, i: signed_box(x, half[:, i]),
        "cylinder": lambda x, i: signed_cylinder(x, radius[i], height[i]),
    }


def hit(sampled, found, a, b):
    """Whether a distance is none above sampled ones, and at most half a step's way below."""
    step = np.linalg.norm(b - a, axis=0) / (len(STEPS) - 1)
    assert (found <= sampled + 1e-9).all()
    assert (found >= sampled - step / 2 - 1e-9).all()


def test_two_segments_are_as_far_apart_as_their_nearest_samples(rng):
    a, b, c, d = rng.normal(size=(4, 3, COUNT))
    c[:, :50] = a[:, :50] + 1.0
    d[:, :50] = b[:, :50] + 1.0  # parallel
    b[:, 50:60] = a[:, 50:60]  # points
    d[:, 55:65] = c[:, 55:65]
    found = segment_to_segment(a, b, c, d).distance
    x, y = along(a, b)[..., ::4], along(c, d)[..., ::4]
    apart = np.linalg.norm(x[..., :, None] - y[..., None, :], axis=0).min(axis=(1, 2))
    step = (np.linalg.norm(b - a, axis=0) + np.linalg.norm(d - c, axis=0)) / 50
    assert (found <= apart + 1e-9).all()
    assert (found >= apart - step / 2 - 1e-9).all()


def test_segments_that_cross_touch_and_part_across_both():
    a, b = np.array([[-1.0], [0], [0]]), np.array([[1.0], [0], [0]])
    c, d = np.array([[0.0], [-1], [0]]), np.array([[0.0], [1], [0]])
    found = segment_to_segment(a, b, c, d)
    assert found.distance[0] == 0
    assert abs(found.normal[:, 0]) == pytest.approx([0, 0, 1])


def test_one_segment_within_another_parts_across(rng):
    a, b = np.array([[-1.0], [0], [0]]), np.array([[1.0], [0], [0]])
    found = segment_to_segment(a, b, 0.5 * a, 0.5 * b)
    assert found.distance[0] == 0
    assert found.normal[0, 0] == pytest.approx(0)
    assert np.linalg.norm(found.normal) == pytest.approx(1)


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_a_segment_is_as_far_from_a_solid_as_its_nearest_sample(rng, kind):
    signed = solids(rng)[kind]
    a, b = rng.normal(size=(2, 3, COUNT))
    b[:, :20] = a[:, :20]
    found = segment_to_convex(a, b, signed)
    every = np.arange(COUNT)
    each = [signed(x, every)[0] for x in np.moveaxis(along(a, b), -1, 0)]
    hit(np.min(each, axis=0), found.distance, a, b)
    at_point = signed(found.point, every)[0]
    assert at_point == pytest.approx(found.distance, abs=1e-8)


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_points_of_solids_have_the_distance_of_their_nearest_surface_sample(rng, kind):
    size = np.array([0.3, 0.4, 0.2])
    x = rng.uniform(-1, 1, (3, 200))
    surface = rng.uniform(-1, 1, (3, 60000)) * size[:, None]
    if kind == "box":
        face = rng.integers(3, size=surface.shape[1])
        surface[face, np.arange(len(face))] = size[face] * rng.choice([-1, 1], len(face))
        distance, _ = signed_box(x, size[:, None])
    else:
        angle = rng.uniform(-np.pi, np.pi, surface.shape[1])
        r = size[0] * np.sqrt(rng.uniform(0, 1, surface.shape[1]))
        r[::2] = size[0]
        surface[1] = r * np.sin(angle)
        surface[0] = r * np.cos(angle)
        surface[2, 1::2] = size[2] * np.sign(surface[2, 1::2])
        distance, _ = signed_cylinder(x, np.full(200, size[0]), np.full(200, size[2]))
    nearest = np.array([np.linalg.norm(surface - p[:, None], axis=0).min() for p in x.T])
    assert np.abs(distance) == pytest.approx(nearest, abs=0.02)
    assert (np.abs(distance) <= nearest + 1e-12).all()


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_directions_are_the_derivatives_of_distances_even_deep_inside(rng, kind):
    signed = solids(rng)[kind]
    a, b = 0.5 * rng.normal(size=(2, 3, COUNT))
    found = segment_to_convex(a, b, signed)
    assert (found.distance < 0).sum() > 20
    h = 1e-6
    for axis, unit in enumerate(np.eye(3)[:, :, None] * h):
        ends = [segment_to_convex(a + s * unit, b + s * unit, signed).distance for s in (1, -1)]
        assert found.normal[axis] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-4)


def test_the_closed_form_of_a_box_is_what_a_search_finds(rng):
    """Distance, direction and point, of segments beside, along, on and in boxes, and of points."""
    half = rng.uniform(0.1, 1.0, (3, COUNT))
    a, b = rng.normal(size=(2, 3, COUNT))
    b[:, :20] = a[:, :20]  # points
    b[0, 20:60], b[1, 40:80] = a[0, 20:60], a[1, 40:80]  # along faces and edges
    a[2, 80:100] = half[2, 80:100]  # that begin on a face's plane
    found = segment_to_box(a, b, half)
    searched = segment_to_convex(a, b, lambda x, i: signed_box(x, half[:, i]))
    apart = found.distance > 1e-6
    assert 50 < apart.sum() < COUNT - 50
    assert found.distance == pytest.approx(searched.distance, abs=1e-8)
    assert found.normal[:, apart] == pytest.approx(searched.normal[:, apart], abs=1e-4)
    assert signed_box(found.point, half)[0] == pytest.approx(found.distance, abs=1e-8)
    assert np.linalg.norm(found.normal[:, apart], axis=0) == pytest.approx(1.0)


def test_a_search_that_may_end_early_tells_what_is_nearer_exactly(rng):
    signed = solids(rng)["box"]
    a, b = rng.normal(size=(2, 3, COUNT))
    exact = segment_to_convex(a, b, signed).distance
    early = segment_to_convex(a, b, signed, 0.1).distance
    near = exact < 0.1
    assert 20 < near.sum() < COUNT - 20
    assert early[near] == pytest.approx(exact[near], abs=1e-9)
    assert (early[~near] >= 0.1 - 1e-9).all()


def test_a_segment_is_as_far_above_a_plane_as_its_lower_end():
    a, b = np.array([[0.0], [0], [2]]), np.array([[0.0], [1], [0.5]])
    found = segment_to_plane(a, b, np.array([[0.0], [0], [1]]), np.array([0.2]))
    assert found.distance == pytest.approx([0.3])
    assert found.point[:, 0] == pytest.approx(b[:, 0])
