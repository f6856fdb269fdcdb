"""Newton directions: exact where the Hessian is positive definite, down in any case."""

import numpy as np
import pytest

from edtk.design.interior_point.step import LEAST_CURVATURE, newton_direction

B = 6
K = 3
D = 4


def whole(own, joint):
    """Hessians (b, kd, kd) of blocks and what couples them."""
    H = joint.copy()
    for i in range(own.shape[1]):
        part = slice(i * own.shape[2], (i + 1) * own.shape[2])
        H[:, part, part] += own[:, i]
    return H


def case(seed):
    """Symmetric blocks, coupling, and slopes, at random."""
    rng = np.random.default_rng(seed)
    own = rng.normal(size=(B, K, D, D))
    joint = rng.normal(size=(B, K * D, K * D))
    slope = rng.normal(size=(B, K, D))
    return own + np.swapaxes(own, -1, -2), 0.1 * joint @ np.swapaxes(joint, -1, -2), slope


def positive(own):
    """Blocks that are positive definite."""
    return own @ np.swapaxes(own, -1, -2) + np.eye(D)


@pytest.mark.parametrize("late", [False, True])
def test_newton(late):
    """Where the Hessian is positive definite the step solves ``H d = -slope``, for every start."""
    own, joint, slope = case(0)
    d = newton_direction(positive(own), joint, slope, np.full(B, late))
    left = (whole(positive(own), joint) @ d.reshape(B, -1, 1))[..., 0] + slope.reshape(B, -1)
    np.testing.assert_allclose(left, 0, atol=1e-9)


@pytest.mark.parametrize("late", [False, True])
def test_every_step_leads_down(late):
    """Whatever the blocks, with a coupling that is positive semidefinite no step leads up."""
    for seed in range(20):
        own, joint, slope = case(seed)
        assert (np.linalg.eigvalsh(whole(own, joint))[:, 0] < 0).any()
        assert (
            (newton_direction(own, joint, slope, np.full(B, late)) * slope).sum(axis=(1, 2)) < 0
        ).all()


def test_a_saddle_is_left_along_its_negative_direction():
    """Near the end each negative eigenvalue changes its sign, and small ones are raised."""
    V = np.linalg.qr(np.random.default_rng(1).normal(size=(K * D, K * D)))[0]
    e = np.array([-2.0, -1e-9, 1e-9, *np.arange(1.0, K * D - 2)])
    joint = (V * e) @ V.T
    slope = V @ np.ones(K * D)
    d = newton_direction(
        np.zeros((1, K, D, D)), joint[None], slope.reshape(1, K, D), np.array([True])
    )
    expected = -V @ (1 / np.r_[2.0, LEAST_CURVATURE, LEAST_CURVATURE, e[3:]])
    np.testing.assert_allclose(d.ravel(), expected, atol=1e-6 / LEAST_CURVATURE)


def test_starts_do_not_see_each_other():
    """A start that needs mending does not change the step of one that does not, early or late."""
    own, joint, slope = case(3)
    own[::2] = positive(own[::2])
    late = np.arange(B) % 3 == 0
    together = newton_direction(own, joint, slope, late)
    for i in range(B):
        alone = newton_direction(
            own[i : i + 1], joint[i : i + 1], slope[i : i + 1], late[i : i + 1]
        )
        np.testing.assert_allclose(together[i], alone[0], rtol=1e-9)


def test_several_slopes_at_once():
    """Steps of several slopes are those of each of them."""
    own, joint, slope = case(4)
    slopes = np.stack([slope, 2 * slope, slope[::-1]])
    late = np.arange(B) % 2 == 0
    together = newton_direction(own, joint, slopes, late)
    for some, steps in zip(slopes, together, strict=True):
        np.testing.assert_allclose(
            newton_direction(own, joint, some, late), steps, rtol=1e-9, atol=1e-12
        )


@pytest.mark.parametrize("starts", [1, 2])
def test_negative_eigenvalues_of_a_block_change_their_signs(starts):
    """Far from the end a block that is not positive counts as its absolute value, alone or not."""
    V = np.linalg.qr(np.random.default_rng(2).normal(size=(D, D)))[0]
    e = np.array([-2.0, 1.0, 3.0, 4.0])
    own = np.tile((V * e) @ V.T, (starts, 1, 1, 1))
    slope = np.tile(V @ np.ones(D), (starts, 1, 1))
    joint = np.zeros((starts, D, D))
    d = newton_direction(own, joint, slope, np.zeros(starts, dtype=bool))
    np.testing.assert_allclose(d[:, 0], np.tile(-V @ (1 / np.abs(e)), (starts, 1)), rtol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_eigenvalues_of_all_sizes_leave_a_direction_down(seed):
    """At a start that is all but singular, curvatures of 1e22 hide those of 1e3 in rounding."""
    rng = np.random.default_rng(seed)
    V = np.linalg.qr(rng.normal(size=(D, D)))[0]
    e = np.array([-1e22, -1e11, -5e3, 1e22])
    slope = rng.normal(size=(1, 1, D))
    own = ((V * e) @ V.T)[None, None]
    d = newton_direction(own, np.zeros((1, D, D)), slope, np.ones(1, dtype=bool))
    assert (d * slope).sum() < 0
    # In each direction it goes no further than the least curvature that can be told beside 1e22.
    assert (np.abs(d[0, 0] @ V) <= 1.01 * np.abs(slope[0, 0] @ V) / 1e10).all()
