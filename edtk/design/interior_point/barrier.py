"""The logarithmic barrier of many descents: its value, how far a step may go, and how high it is to be next."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TO_BOUNDARY = 0.995  # share of the way to a constraint that one step may go
LONGEST = 0.3  # step of a variable, in parts of its range
LOWER = 0.1  # least factor on the barrier from one step to the next
LEAST = 0.01  # of what a step promised, shared out over the experiments: the barrier of the next one is no lower
CREEPING = 0.03  # share of what a step promised below which it creeps along a wall: the barrier is raised again


def merit(f: Array, s: Array, mu: Array) -> Array:
    """Barrier function ``f - mu sum log s`` (b,) of values (b,) and slacks (b, k, c)."""
    return np.asarray(f - mu * np.log(s).sum(axis=(1, 2)))


def to_boundary(change: Array, x: Array) -> Array:
    """Lengths (b,), at most one, at which positive x (b, k, c) stays positive."""
    return np.minimum(1.0, TO_BOUNDARY / np.maximum((-change / x).max(axis=(1, 2)), 1e-300))


def shortened(d: Array) -> Array:
    """Factors (b, 1, 1) that make steps d (b, k, d) no longer than the longest."""
    return np.minimum(1.0, LONGEST / np.maximum(np.abs(d).max(axis=(1, 2), keepdims=True), 1e-300))


def reachable(s: Array, z: Array, ds: Array, short: Array) -> Array:
    """Means (b,) of ``s z`` where a step without a barrier would lead, up to the constraints.

    Args:
        s: Slacks (b, k, c).
        z: Multipliers (b, k, c).
        ds: Changes of the slacks (b, k, c) by the step.
        short: Most of the step that is taken (b, 1, 1).
    """
    dz = -z - z / s * ds
    s = s + np.minimum(short, to_boundary(ds, s)[:, None, None]) * ds
    z = z + np.minimum(short, to_boundary(dz, z)[:, None, None]) * dz
    return np.asarray((s * z).mean(axis=(1, 2)))


def next_bounds(
    mu: Array, gain: Array, promise: Array, floor: float, first: float, k: int
) -> Array:
    """Bounds (2, b) of the next barriers.

    Args:
        mu: The last ones (b,).
        gain: By how much the last steps lowered the barrier function (b,).
        promise: By how much they would have, had it gone on as it began (b,).
        floor: The least of all.
        first: The one at the beginning, of all experiments together.
        k: Number of experiments.
    """
    failed, creeping, most = gain <= 1e-12, gain < CREEPING * promise, first / k
    lower = np.maximum(np.maximum(floor, LOWER * mu), LEAST * promise / k)
    higher = np.minimum(most, mu / LOWER)
    return np.stack([np.where(creeping & ~failed, higher, lower), np.where(failed, lower, most)])
