"""Columns of what a model of springs lacks, against robots that have it."""

import numpy as np
import pytest

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import correlated
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.robots.load_robot import load_robot

ROBOT = load_robot("kuka_kr270")
K = np.array([4e-7, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
RNG = np.random.default_rng(3)
Q = RNG.uniform(-1, 1, (4, 6))
W = np.hstack([RNG.normal(size=(4, 3)) * 1e3, RNG.normal(size=(4, 3)) * 100])
MODEL = ElastostaticModel(ROBOT)
PIECES = MissingPieces.of(ROBOT, K, MODEL.torque_of(MODEL.frames(Q), W).T)


def test_springs_across():
    """Both springs across a joint move the tool as a ball joint does, less what its own does."""
    found = PIECES.shared(MODEL, Q, W)
    frames = ROBOT.frames(Q)
    for j in range(6):
        lever = (frames.position - frames.origins[j]).T
        moment = np.cross(lever, W[:, :3]) + W[:, 3:]
        axis = frames.axes[j].T
        turned = moment - axis * (axis * moment).sum(axis=1)[:, None]
        moved = K[j] * np.cross(turned, lever)
        both = found[..., j] + found[..., 6 + j]
        np.testing.assert_allclose(both, moved, rtol=1e-9, atol=1e-12)


def test_turns_are_what_springs_do():
    """The piece that is another one in each pose has the columns of the springs, times these."""
    np.testing.assert_allclose(PIECES.turns(MODEL, Q, W), MODEL.regressor(Q, W) * K, rtol=1e-12)


def test_friction_holds_a_load():
    """Large loads of either sign lose the same; a small one loses in proportion.

    Shares ``v / sqrt(2)`` with v of mean and variance one have the squares of shares of variance
    one that are correlated by a half: so plans, which know no sign, count the same.
    """
    torque = MODEL.torque_of(MODEL.frames(Q), W).T
    held = PIECES.shared(MODEL, Q, W)[..., 12:]
    motion = MODEL.regressor(Q, W) / torque[:, None]
    sign = torque / np.hypot(torque, 0.1 * PIECES.load)
    alone = motion * (K * PIECES.load * sign)[:, None]
    np.testing.assert_allclose(held, -alone / np.sqrt(2), rtol=1e-9, atol=1e-15)
    mean = PIECES.mean[12:]
    assert not PIECES.mean[:12].any()
    squares = held @ (np.eye(6) + np.outer(mean, mean)) @ held.mT
    np.testing.assert_allclose(squares, alone @ correlated(6) @ alone.mT, rtol=1e-9, atol=1e-15)
    less = PIECES.shared(MODEL, Q, 1e-7 * W)[..., 12:]
    twice = PIECES.shared(MODEL, Q, 2e-7 * W)[..., 12:]
    np.testing.assert_allclose(twice, 2 * less, rtol=1e-9)


def test_a_rigid_joint_tilts_as_its_neighbour():
    """Beside a joint of no compliance springs across are those of the next one that bends."""
    stiff = MissingPieces(np.where(np.arange(6) == 0, 0.0, K), PIECES.load)
    np.testing.assert_array_equal(stiff.size(ROBOT)[:2], [K[1], K[1]])


def test_errors_of_possible_springs():
    """Errors in a task have the shares, the springs and the turns of its own pose in them."""
    V = RNG.normal(size=(2, 5, 5))
    possible = PossibleSprings(
        np.array([0.3, 0.7]), np.array([0.0, 0.1]), RNG.normal(size=(2, 5)), V @ V.mT
    )
    A, T = RNG.normal(size=(4, 3, 5)), RNG.normal(size=(4, 3, 6))
    mean, covariance = possible.errors(A, T)
    np.testing.assert_allclose(mean[1, 2], A[2] @ possible.mean[1])
    own = A[2] @ possible.covariance[1] @ A[2].T + 0.1**2 * T[2] @ T[2].T
    np.testing.assert_allclose(covariance[1, 2], own)
    assert possible.spread(2) == pytest.approx(
        sum(
            w * (C[3:, 3:] + np.outer(m[3:], m[3:]))
            for w, C, m in zip(possible.weights, possible.covariance, possible.mean, strict=True)
        )
    )
