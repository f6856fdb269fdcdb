"""The barrier: its slope, lengths that keep what is positive positive, and how high it is to be."""

import numpy as np
import pytest

from edtk.design.interior_point.step import (
    CREEPING,
    LEAST_FRACTION,
    LONGEST,
    LOWER,
    TO_BOUNDARY,
    merit,
    next_bounds,
    reachable,
    shortened,
    to_boundary,
)

B = 5
K = 3
C = 4


def positive(seed):
    """Positive numbers (b, k, c), some of them small."""
    return 10 ** np.random.default_rng(seed).uniform(-6, 0, size=(B, K, C))


def test_slope_of_the_barrier_function(derivative):
    """By a slack it is ``-mu/s``."""
    s = positive(0)
    mu = np.full(B, 0.3)
    slope = derivative(lambda t: merit(np.zeros(B), s * (1 + t[0]), mu), np.zeros(1))
    np.testing.assert_allclose(slope[..., 0], -mu * K * C, rtol=1e-6)


def test_steps_up_to_the_boundary():
    """Whole steps where all stays far positive; else steps that leave just the reserved share."""
    x = positive(1)
    change = np.random.default_rng(2).normal(size=(B, K, C))
    length = to_boundary(change, x)
    left = (x + length[:, None, None] * change) / x
    np.testing.assert_allclose(left.min(axis=(1, 2)), 1 - TO_BOUNDARY, rtol=1e-9)
    np.testing.assert_array_equal(to_boundary(np.abs(change), x), 1.0)
    np.testing.assert_array_equal(to_boundary(-0.5 * x, x), 1.0)


def test_steps_up_to_a_curved_boundary():
    """No parabola falls below the reserved share on the way; where a step is cut one has it."""
    x = positive(1)
    change, bend = np.random.default_rng(6).normal(size=(2, B, K, C))
    length = to_boundary(change, x, bend)
    t = np.linspace(0, 1, 2001)[:, None, None, None] * length[:, None, None]
    left = ((x + t * change + t**2 * bend / 2) / x).min(axis=(2, 3))
    assert (left >= 1 - TO_BOUNDARY - 1e-9).all()
    cut = length < 1
    assert cut.any()
    np.testing.assert_allclose(left[-1, cut], 1 - TO_BOUNDARY, rtol=1e-6)
    np.testing.assert_array_equal(to_boundary(change, x, 1e9 + 0 * x), 1.0)


def test_no_step_is_longer_than_the_longest():
    """Long steps are scaled to the longest, short ones are left."""
    d = (
        np.random.default_rng(3).normal(size=(B, K, 2))
        * np.array([10.0, 1, 0.5, 1e-3, 0])[:, None, None]
    )
    size = np.abs(d * shortened(d)).max(axis=(1, 2))
    np.testing.assert_allclose(size, np.minimum(LONGEST, np.abs(d).max(axis=(1, 2))))


def test_what_can_be_reached():
    """A free step leaves nothing of ``s z`` to first order; no step leaves the mean as it is."""
    s = positive(4)
    z = positive(5)
    whole = np.ones((B, 1, 1))
    nothing = np.zeros((B, 1, 1))
    np.testing.assert_allclose(
        reachable(s, z, 1e-9 * s, whole), (1 - TO_BOUNDARY) * (s * z).mean(axis=(1, 2)), rtol=1e-6
    )
    np.testing.assert_allclose(reachable(s, z, 1e-9 * s, nothing), (s * z).mean(axis=(1, 2)))
    blocked = reachable(s, z, -1e9 * s, whole)
    assert (blocked > 0.9 * (s * z).mean(axis=(1, 2))).all()


@pytest.mark.parametrize(
    ("gain", "promise", "low", "high"),
    [
        (0.5, 1e-3, LOWER * 1e-3, 0.01),  # as it should be: down by the factor at most
        (0.5, 1.0, LEAST_FRACTION / 3, 0.01),  # but not far below what the step promised
        (0.5 * CREEPING, 1.0, 0.01, 0.01),  # creeping: up again
        (0.0, 1e-6, LOWER * 1e-3, LOWER * 1e-3),  # in vain: down
    ],
)
def test_bounds_of_the_next_barrier(gain, promise, low, high):
    """Mu falls after a good or a vain step, rises after a creeping one, and stays in its range."""
    one = np.ones(1)
    found = next_bounds(1e-3 * one, gain * one, promise * one, 1e-9, 0.03, 3)
    np.testing.assert_allclose(found[:, 0], [low, high])
    np.testing.assert_allclose(next_bounds(1e-9 * one, one, 0 * one, 1e-8, 0.03, 3)[0], 1e-8)
