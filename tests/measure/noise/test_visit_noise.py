"""The covariance of a visit: its parts, its slope, and what repeats average out."""

from dataclasses import replace

import numpy as np
import pytest
from waving import waving

from edtk.measure.noise import Tracker, VisitNoise

ROWS = 10
N = 5
NO_LOAD = np.zeros(6)
MODEL = waving(ROWS, N, 2)
NOISE = VisitNoise(
    tracker=Tracker(np.array([4.0, -3.0, 2.0]), (1e-5, 5e-6), (1.5e-5, 6e-6)),
    tracked=((0, 0), (2, 6)),
    repeatability=np.array([1e-5, 0.0, 2e-5, 3e-5, 1e-5]),
    white=np.array([1e-6] * 9 + [4e-5]),
    discrepancy=np.array([1e-4] * 9 + [0.0]),
)
Q = np.random.default_rng(3).uniform(-2, 2, (3, 2, N))


def dense(noise, q, visits):
    """Sigma (rows, rows) of one pose, from matrices."""
    frames = MODEL.at(q)
    J = MODEL.motion_of(frames).T
    V = J @ np.diag(noise.repeatability**2) @ J.T
    for point, row in noise.tracked if noise.tracker is not None else ():
        beam = MODEL.points_of(frames)[point] - noise.tracker.position
        r = np.linalg.norm(beam)
        u = beam / r
        e, c = (a + b * r for a, b in (noise.tracker.along, noise.tracker.across))
        T = e**2 * np.outer(u, u) + c**2 * (np.eye(3) - np.outer(u, u))
        V[row : row + 3, row : row + 3] += T
    return noise.readings * V + np.diag(noise.white**2 + visits * noise.discrepancy**2)


VARIANTS = {
    "whole": NOISE,
    "one reading": replace(NOISE, readings=1),
    "no tracker": replace(NOISE, tracker=None, tracked=()),
    "rigid": replace(NOISE, repeatability=np.zeros(N)),
    "exact model": replace(NOISE, discrepancy=np.zeros(ROWS)),
}


@pytest.mark.parametrize("noise", VARIANTS.values(), ids=VARIANTS)
def test_parts(noise):
    """Tracker and joints count once a reading, white noise and the discrepancy once a visit."""
    visits = np.array([[1.0, 2.0], [3.0, 1.0], [5.0, 7.0]])
    Sigma = noise.covariance_of(MODEL, MODEL.at(Q), NO_LOAD, visits)
    assert Sigma.shape == (ROWS, ROWS, 3, 2)
    for k in np.ndindex(3, 2):
        expected = dense(noise, Q[k], visits[k])
        np.testing.assert_allclose(Sigma[(..., *k)], expected, rtol=0, atol=1e-13 * 1e-7)
    np.testing.assert_array_equal(Sigma, Sigma.swapaxes(0, 1))
    assert noise.shares == (noise.discrepancy > 0).any()


@pytest.mark.parametrize("noise", VARIANTS.values(), ids=VARIANTS)
def test_slope(noise, derivative):
    """The derivative of <S, Sigma> by all joints is its finite difference."""
    S = np.random.default_rng(4).normal(size=(ROWS, ROWS))
    S = (S + S.T) * 1e8
    frames = MODEL.at(Q)
    lifted = np.broadcast_to(S[..., None, None], (ROWS, ROWS, 3, 2))
    slopes = noise.slope_of(MODEL, frames, lifted, NO_LOAD)
    for k in np.ndindex(3, 2):
        expected = derivative(
            lambda q: np.array([(S * noise.covariance_of(MODEL, MODEL.at(q), NO_LOAD)).sum()]), Q[k]
        )[0]
        np.testing.assert_allclose(slopes[(..., *k)], expected, rtol=0, atol=1e-8)


def test_markers_move_together():
    """Without errors of the tracker, markers of one visit have correlation one, joint by joint."""
    alone = replace(NOISE, tracker=None, white=np.zeros(ROWS), discrepancy=np.zeros(ROWS))
    one = replace(alone, repeatability=np.array([0, 0, 1e-5, 0, 0]))
    V = one.scatter_of(MODEL, MODEL.at(Q[0, 0]))
    sizes = np.sqrt(np.diag(V))
    np.testing.assert_allclose(np.abs(V / np.outer(sizes, sizes)), 1.0, rtol=1e-12)


def test_visits():
    """Of v visits each counts with V + v D: together as their mean of covariance V/v + D."""
    frames = MODEL.at(Q[0, 0])
    V = NOISE.scatter_of(MODEL, frames)
    A = np.random.default_rng(5).normal(size=(ROWS, 4))
    last = np.zeros((4, 4))
    one = A.T @ np.linalg.solve(NOISE.covariance_of(MODEL, frames, NO_LOAD), A)
    for v in range(1, 6):
        Sigma = NOISE.covariance_of(MODEL, frames, NO_LOAD, v)
        M = v * A.T @ np.linalg.solve(Sigma, A)
        mean = A.T @ np.linalg.solve(V / v + np.diag(NOISE.discrepancy**2), A)
        np.testing.assert_allclose(M, mean, rtol=1e-9)
        rounding = 1e-9 * np.linalg.eigvalsh(one).max()
        assert np.linalg.eigvalsh(M - last).min() > -rounding
        assert np.linalg.eigvalsh(v * one - M).min() > -rounding
        last = M
