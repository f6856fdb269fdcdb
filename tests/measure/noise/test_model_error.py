"""What the model leaves out: its size, its slope, and what repeats of a pose tell at most."""

import numpy as np
import pytest
from designs import DESIGNS
from noisy import NOISY

from edtk.design.candidate_source import sample_feasible
from edtk.measure.model_error import ModelError, groups_of

MODELS = NOISY
RNG = np.random.default_rng(12)


def scene(space, count=3):
    """Motion (n, rows, m), loads (n, m) and groups of some poses, and a model's error."""
    x = sample_feasible(space, count, 1)
    n = space.model.robot.n
    frames = space.model.frames(x[:, :n])
    wrench = np.broadcast_to(space.load.wrench(x[:, n:]), (count, 6))
    error = ModelError(RNG.uniform(1e-7, 3e-6, n), turn=0.07, anywhere=0.04)
    torque = space.model.torque_of(frames, wrench)
    groups = groups_of(space.model.whole_instruments)
    return x[:, :n], wrench, space.model.motion_of(frames), torque, groups, error


@pytest.mark.parametrize("space", MODELS.values(), ids=MODELS)
def test_parts(space):
    """Springs that turn by another share, and errors in any direction, have these covariances."""
    _, _, motion, torque, groups, error = scene(space)
    E = error.covariance(error.bends(motion, torque), groups)
    for pose in range(motion.shape[-1]):
        b = motion[..., pose].T * (error.k * torque[:, pose])
        dense = error.turn**2 * b @ b.T
        squares = (b**2).sum(axis=1)
        for group in set(groups.tolist()):
            own = np.diag(np.where(groups == group, squares[groups == group].mean(), 0.0))
            dense += error.anywhere**2 * own
        np.testing.assert_allclose(E[..., pose], dense, rtol=1e-12, atol=1e-25)


@pytest.mark.parametrize("space", MODELS.values(), ids=MODELS)
def test_slope(space, derivative):
    """The derivative of <S, E> by all joints is its finite difference."""
    q, wrench, motion, torque, groups, error = scene(space)
    model = space.model
    rows = motion.shape[1]
    S = RNG.normal(size=(rows, rows))
    S = 1e10 * (S + S.T)
    lifted = np.broadcast_to(S[..., None], (rows, rows, len(q)))
    B, s = error.slope_weights(motion, torque, lifted, groups)
    frames = model.frames(q)
    slope = model.motion_slope_of(frames, B) + model.torque_slope_of(frames, wrench, s)

    def value(at, pose):
        frames = model.frames(at)
        bends = error.bends(model.motion_of(frames), model.torque_of(frames, wrench[pose]))
        return np.array([(S * error.covariance(bends, groups)).sum()])

    for pose in range(len(q)):
        expected = derivative(lambda at, pose=pose: value(at, pose), q[pose])[0]
        scale = np.abs(expected).max()
        np.testing.assert_allclose(slope[:, pose], expected, rtol=0, atol=1e-7 * scale)


def test_share():
    """An error by a share moves a position by this share of what springs do, in the mean square."""
    _, _, motion, torque, groups, error = scene(DESIGNS["kr270"])
    one = ModelError.of_share(error.k, 0.05)
    bends = one.bends(motion, torque)
    found = np.einsum("rrm->m", one.covariance(bends, groups))
    np.testing.assert_allclose(found, 0.05**2 * (bends**2).sum(axis=(0, 1)), rtol=1e-12)
    none = ModelError.of_share(error.k, 0.0)
    assert not none.covariance(none.bends(motion, torque), groups).any()
