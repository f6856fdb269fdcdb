"""Columns of what a model of springs lacks, against robots that have it."""

import numpy as np
import pytest
from scipy.stats import norm

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import SPREAD_OF_SHARES, correlated, scatter
from edtk.measure.missing_pieces import SPREAD_ACROSS, MissingPieces, PieceColumns, PossibleSprings
from edtk.robots.load_robot import load_robot

ROBOT = load_robot("kuka_kr270")
K = np.array([4e-7, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
RNG = np.random.default_rng(3)
Q = RNG.uniform(-1, 1, (4, 6))
W = np.hstack([RNG.normal(size=(4, 3)) * 1e3, RNG.normal(size=(4, 3)) * 100])
MODEL = ElastostaticModel(ROBOT)
PIECES = MissingPieces.of(ROBOT, K, MODEL.torque_of(MODEL.frames(Q), W).T)
COLUMNS = PIECES.columns(MODEL, Q, W)


def test_springs_across():
    """Both springs across a joint move the tool as a ball joint does, less what its own does."""
    found = COLUMNS.across
    frames = ROBOT.frames(Q)
    for j in range(6):
        lever = (frames.position - frames.origins[j]).T
        moment = np.cross(lever, W[:, :3]) + W[:, 3:]
        axis = frames.axes[j].T
        turned = moment - axis * (axis * moment).sum(axis=1)[:, None]
        moved = K[j] * np.cross(turned, lever)
        both = found[..., j] + found[..., 6 + j]
        np.testing.assert_allclose(both, moved, rtol=1e-9, atol=1e-12)


def test_a_link_bends_as_springs_at_its_ends_and_in_its_middle():
    """Springs about all axes, those of the middle four times as soft, move the tool as a beam does.

    A beam turns at each place by its moment there; the sum along it is taken by Gauss's rule.
    """
    frames = ROBOT.frames(Q)

    def moved(place):
        lever = (frames.position - place).T
        return np.cross(np.cross(lever, W[:, :3]) + W[:, 3:], lever)

    assert PIECES.links == (1, 2, 3, 4)
    nodes, shares = np.polynomial.legendre.leggauss(7)
    for place, j in enumerate(PIECES.links):
        root, end = frames.origins[j - 1], frames.origins[j]
        along = ((1 + x) / 2 * (end - root) + root for x in nodes)
        beam = sum(w / 2 * moved(at) for w, at in zip(shares, along, strict=True))
        middle = COLUMNS.across[..., 12 + place :: 4][..., :3].sum(axis=-1) / K[j - 1]
        three = (moved(root) + 4 * middle + moved(end)) / 6
        np.testing.assert_allclose(three, beam, rtol=1e-9, atol=1e-9)


def test_turns_are_what_springs_do():
    """The piece that is another one in each pose has the columns of the springs, times these."""
    np.testing.assert_allclose(COLUMNS.turns, MODEL.regressor(Q, W) * K, rtol=1e-12)


def test_friction_holds_a_load():
    """Springs see ``max(|tau| - s m, 0)`` where friction holds the share s of all usual loads."""
    torque = COLUMNS.torque
    motion = COLUMNS.turns / (K * torque)[:, None]
    for size in (0.02, 0.3, 2.0):
        # Shares whose mean square is one hold s if all are alike.
        alike = np.full(6, 1 / scatter(SPREAD_OF_SHARES))
        left = COLUMNS.turns.sum(axis=-1) + size * COLUMNS.held(size) @ alike
        load = np.sign(torque) * np.maximum(np.abs(torque) - size * PIECES.load, 0)
        np.testing.assert_allclose(left, np.einsum("mrj,mj->mr", motion, K * load), atol=1e-15)
    assert not COLUMNS.held(0.0).any()


def test_shares_are_about_alike_and_hardly_any_is_negative():
    """They have the mean products of shares that are: none pushes, no stiffness is negative."""
    for kind, spread, most in ((0, SPREAD_ACROSS, 0.16), (1, SPREAD_OF_SHARES, 0.03)):
        mean = COLUMNS.mean[COLUMNS.kinds == kind]
        products = scatter(spread) ** 2 * (np.eye(len(mean)) + np.outer(mean, mean))
        np.testing.assert_allclose(products, correlated(len(mean), spread), rtol=1e-12)
        assert norm.cdf(-mean).max() < most


def test_a_rigid_joint_tilts_as_its_neighbour():
    """Beside a joint of no compliance springs across are those of the next one that bends."""
    stiff = MissingPieces(np.where(np.arange(6) == 0, 0.0, K), PIECES.load)
    np.testing.assert_array_equal(stiff.size(ROBOT)[:2], [K[1], K[1]])


def test_errors_of_possible_springs():
    """Errors in a task have the shares, the springs and the turns of its own pose in them."""
    V = RNG.normal(size=(3, 10, 10))
    weights = np.array([0.3, 0.5, 0.2])
    held, turn = np.array([0.0, 0.3, 0.0]), np.array([0.0, 0.1, 0.1])
    possible = PossibleSprings(weights, held, turn, RNG.normal(size=(3, 10)), V @ V.mT)
    U, T, A = (RNG.normal(size=(4, 3, w)) for w in (2, 6, 2))
    columns = PieceColumns(U, T, RNG.normal(size=(4, 6)), np.ones(6))
    mean, covariance = possible.errors(columns, A)
    for i in range(3):
        X = np.concatenate([columns.shared(held[i]), A], axis=-1)[2]
        np.testing.assert_allclose(mean[i, 2], X @ possible.mean[i])
        own = X @ possible.covariance[i] @ X.T + turn[i] ** 2 * T[2] @ T[2].T
        np.testing.assert_allclose(covariance[i, 2], own)
    each = possible.errors(columns.by_row(), A.reshape(12, 1, 2))[0]
    np.testing.assert_allclose(each.reshape(mean.shape), mean)
    assert possible.spread(2) == pytest.approx(
        sum(
            w * (C[8:, 8:] + np.outer(m[8:], m[8:]))
            for w, C, m in zip(possible.weights, possible.covariance, possible.mean, strict=True)
        )
    )
