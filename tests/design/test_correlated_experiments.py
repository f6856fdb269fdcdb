"""Experiments whose rows have a full covariance: information, slopes, and what repeats tell."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, log_cost_slope
from noisy import NOISY, marked, noisy
from scipy.spatial.transform import Rotation

import criteria
from edtk.design.candidate_source import sample_feasible
from edtk.design.plan import Plan
from edtk.design.relaxation.search_continuum import sensitivity_and_slope
from edtk.measure.noise import Tracker

on_every_space = pytest.mark.parametrize("space", NOISY.values(), ids=NOISY)
RNG = np.random.default_rng(6)


def dense(space, x, visits=1.0):
    """A' Sigma^-1 A (p, p) of one experiment, from matrices."""
    n = len(space.fixed)
    frames = space.model.frames(x[:n])
    wrench = space.load.wrench(x[n:])
    A = space.model.regressor(x[:n], wrench)
    Sigma = space.noise.covariance_of(space.model, frames, wrench, visits)
    return A.T @ np.linalg.solve(Sigma, A)


@on_every_space
def test_information(space):
    """Information is A' Sigma^-1 A; v visits have v times that of V + v D."""
    x = sample_feasible(space, 6, 1)
    blocks = space.problem(x).blocks()
    for one, block in zip(x, blocks, strict=True):
        np.testing.assert_allclose(block, dense(space, one), rtol=1e-8)
    repeats = np.array([[1.0, 2.0, 4.0], [3.0, 1.0, 0.0]])
    M = space.at(x.reshape(2, 3, -1)).information(repeats)
    for own, times, found in zip(x.reshape(2, 3, -1), repeats, M, strict=True):
        expected = sum(r * dense(space, one, max(r, 1)) for one, r in zip(own, times, strict=True))
        np.testing.assert_allclose(found, expected, rtol=1e-8)


@on_every_space
def test_slope_of_information(space, derivative):
    """The derivative of <Z, M> by every design variable is its finite difference."""
    p = space.model.p
    root = RNG.normal(size=(p, p))
    for one in sample_feasible(space, 2, 2)[1:]:
        M = space.problem(one[None]).blocks()[0]
        scale = np.sqrt(np.diag(M))
        Z = root @ root.T / np.outer(scale, scale)
        for per_trace in (False, True):
            _, slope = sensitivity_and_slope(space.at(one[None, None]), Z[None], per_trace)

            def value(y, per_trace=per_trace, Z=Z):
                found, _ = sensitivity_and_slope(space.at(y[None, None]), Z[None], per_trace)
                return found[0]

            expected = derivative(value, one)[0]
            np.testing.assert_allclose(
                slope[0, 0], expected, rtol=0, atol=1e-7 * np.abs(expected).max()
            )


@on_every_space
def test_slope_of_plans_with_repeats(space, derivative):
    """The slope of a plan's cost is its finite difference, repeats and discrepancy included."""
    criterion = criteria.create("D")
    x = sample_feasible(space, 5, 3)[None]
    repeats = np.array([[1.0, 2.0, 3.0, 1.0, 5.0]])
    _, slope = log_cost_slope(space, criterion, x, repeats)
    movable = space.movable

    def value(y):
        moved = x.copy()
        moved[0, 2, movable] = y
        return np.log(criterion.cost(space.at(moved).information(repeats)))

    expected = derivative(value, x[0, 2, movable])[0]
    np.testing.assert_allclose(slope[0, 2], expected, rtol=0, atol=1e-7 * np.abs(expected).max())


@on_every_space
def test_white_limit(space):
    """A covariance that is a multiple of one has the information of white noise."""
    rows = space.model.row_count
    sigma = np.linspace(1e-5, 4e-5, rows)
    none = np.zeros(rows)
    alone = replace(
        space.noise,
        tracker=None,
        tracked=(),
        repeatability=np.zeros(space.model.robot.n),
        white=sigma,
        discrepancy=none,
        error=None,
    )
    x = sample_feasible(space, 5, 4)
    white = replace(space, noise=None, sigma=sigma).at(x)
    found = replace(space, noise=alone).at(x)
    np.testing.assert_allclose(found.packed, white.packed, rtol=1e-12)
    B = 2 * white.regressor
    np.testing.assert_allclose(found.slope(B), white.slope(B), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("markers", [False, True])
def test_turned_world(markers):
    """Tracker, robot and load that turn and move together leave the information as it was."""
    space = DESIGNS["kr270"]
    space = noisy(marked(space) if markers else space)
    if markers:
        # The wire's anchor stays where it is, so that it is left out here.
        model = replace(space.model, sensors=space.model.sensors[:3])
        space = noisy(replace(space, model=model))
    R = Rotation.from_rotvec([0.6, -0.3, 1.9]).as_matrix()
    t = np.array([0.7, -1.2, 0.4])
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    own = space.noise.tracker
    robot = replace(space.model.robot, base=T @ space.model.robot.base)
    noise = replace(space.noise, tracker=Tracker(R @ own.position + t, own.along, own.across))
    turned = replace(space, model=replace(space.model, robot=robot), noise=noise)
    x = sample_feasible(space, 20, 5)
    wrench = space.load.wrench(x[:, len(space.fixed) :])
    rotated = np.concatenate([wrench[..., :3] @ R.T, wrench[..., 3:] @ R.T], axis=-1)
    repeats = RNG.integers(1, 4, 20)
    q = x[:, : len(space.fixed)]
    wrenches = np.broadcast_to(wrench, (20, 6))
    before = space.information(Plan(q, wrenches, repeats))
    after = turned.information(Plan(q, np.broadcast_to(rotated, (20, 6)), repeats))
    scale = np.sqrt(np.outer(np.diag(before), np.diag(before)))
    assert np.abs((after - before) / scale).max() < 1e-12


def test_old_path_is_untouched():
    """Without [noise] nothing is whitened by a covariance, and repeats change no array."""
    space = DESIGNS["kr270"]
    here = space.at(sample_feasible(space, 4, 7))
    assert here.visited(np.array([1.0, 2.0, 3.0, 4.0])) is here
    A = space.model.regressor(here.x[:, : len(space.fixed)], space.load.wrench(here.x[:, 6:]))
    np.testing.assert_array_equal(here.regressor, A / space.sigma[:, None])
    exact = noisy(space, discrepancy=0.0)
    there = exact.at(here.x)
    assert there.visited(np.array([1.0, 2.0, 3.0, 4.0])) is there


def test_repeats_are_worth_less():
    """A plan's information is concave in repeats, and never more than its visits' alone."""
    space = NOISY["kr270"]
    x = sample_feasible(space, 4, 8)
    once = space.information(space.plan(x, np.ones(4, dtype=int)))
    last = np.zeros_like(once)
    for times in range(1, 5):
        M = space.information(space.plan(x, np.full(4, times)))
        rounding = 1e-9 * np.linalg.eigvalsh(once).max()
        assert np.linalg.eigvalsh(times * once - M).min() > -rounding
        assert np.linalg.eigvalsh(M - last).min() > -rounding
        last = M


def test_many_repeats_are_worth_what_the_model_leaves():
    """A pose that is repeated r times tells less than A' D^-1 A, and comes near it."""
    space = NOISY["springs that are not ideal"]
    x = sample_feasible(space, 1, 8)[0]
    q, wrench = x[: len(space.fixed)], space.load.wrench(x[len(space.fixed) :])
    frames = space.model.frames(q)
    A = space.model.regressor(q, wrench)
    most = A.T @ np.linalg.solve(space.noise.shared_of(space.model, frames, wrench), A)
    for times in (1, 10, 10**6):
        M = space.information(space.plan(x[None], np.array([times])))
        assert np.linalg.eigvalsh(most - M).min() > -1e-9 * np.linalg.eigvalsh(most).max()
    np.testing.assert_allclose(M, most, rtol=0, atol=1e-3 * np.abs(most).max())


def test_exact_springs_are_those_of_today():
    """A share of zero leaves the information of every plan as it was."""
    before, after = NOISY["kr270"], noisy(DESIGNS["kr270"], share=1e-12)
    plan = before.plan(sample_feasible(before, 3, 9), np.array([2, 1, 5]))
    np.testing.assert_allclose(after.information(plan), before.information(plan), rtol=1e-12)


def test_rows_of_one_pose_are_repeats():
    """A pose in two rows of a plan, or nearer than the noise says, counts as two visits of it."""
    space = NOISY["kr270"]
    x = sample_feasible(space, 3, 9)
    twice = space.information(space.plan(x, np.array([2, 1, 1])))
    rows = space.information(space.plan(x[[0, 1, 2, 0]], np.ones(4, dtype=int)))
    np.testing.assert_allclose(rows, twice, rtol=1e-12)
    near = x[[0, 1, 2, 0]].copy()
    near[3, 1] += np.deg2rad(4.9)
    far = near.copy()
    far[3, 1] += np.deg2rad(0.2)
    blocks = replace(space, noise=space.noise.alone).problem(far).blocks()
    np.testing.assert_allclose(
        space.information(space.plan(far, np.ones(4, dtype=int))), blocks.sum(axis=0), rtol=1e-9
    )
    less = space.information(space.plan(near, np.ones(4, dtype=int)))
    alone = replace(space, noise=space.noise.alone).problem(near).blocks().sum(axis=0)
    assert np.trace(less / alone) < 0.9 * space.model.p
