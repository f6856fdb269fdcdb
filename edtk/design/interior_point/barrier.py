"""The logarithmic barrier of many descents: its value, the lengths of steps, and its weight mu.

Shapes: b starts, k experiments each, c slacks of an experiment. Each of the c slacks s > 0 has a
multiplier z > 0, and ``s z = mu`` on the central path.
"""

import numpy as np

from edtk.system.typing import Array

# Share of the way to a constraint that one step may go: tau of Nocedal and Wright, Eq. (19.9),
# with the value that they propose.
TO_BOUNDARY = 0.995
# Longest step of a variable, in parts of its range: beyond, a quadratic model of robot poses says
# nothing, as an angle has turned by a radian.
LONGEST = 0.3
# Least factor on mu from one step to the next: faster, iterates end at a wall far from the optimum.
LOWER = 0.1
# Part of a step's promise, an experiment, below which the next mu does not fall: while a step
# promises much, the start is far from its end, and an almost absent barrier lets it run into walls.
LEAST = 0.01
# Share of a step's promise below which the start creeps along a wall. Its steps are cut short by
# slacks that are almost zero; a higher barrier pushes it off the wall.
CREEPING = 0.03
# Gain of a step in vain: none of its lengths lowered the barrier function.
NOTHING = 1e-12
TINY = 1e-300  # a denominator that divides nothing by zero


def merit(f: Array, s: Array, mu: Array) -> Array:
    """Barrier function ``f - mu sum log s`` (b,), which steps lower.

    Args:
        f: Values (b,).
        s: Slacks (b, k, c).
        mu: Weights (b,).
    """
    return np.asarray(f - mu * np.log(s).sum(axis=(1, 2)))


def to_boundary(change: Array, x: Array) -> Array:
    """Lengths (b,), at most one, at which positive numbers stay positive.

    The largest a with ``x + a change >= (1 - tau) x``, Eq. (19.9) of Nocedal and Wright.

    Args:
        change: Changes (b, k, c) by the whole step.
        x: Positive numbers (b, k, c).
    """
    return np.minimum(1.0, TO_BOUNDARY / np.maximum((-change / x).max(axis=(1, 2)), TINY))


def shortened(d: Array) -> Array:
    """Factors (b, 1, 1) that make no step of the variables d (b, k, d) longer than the longest."""
    longest = np.abs(d).max(axis=(1, 2), keepdims=True)
    return np.minimum(1.0, LONGEST / np.maximum(longest, TINY))


def reachable(s: Array, z: Array, ds: Array, short: Array) -> Array:
    """Means (b,) of ``s z`` where a step without a barrier would lead, up to the constraints.

    Where the step is free to go the mean is small, and so may mu be: the predictor of Mehrotra's
    rule.

    Args:
        s: Slacks (b, k, c).
        z: Multipliers (b, k, c).
        ds: Changes of the slacks (b, k, c) by the step.
        short: Largest part of the step that is taken (b, 1, 1).
    """
    dz = -z - z / s * ds
    s = s + np.minimum(short, to_boundary(ds, s)[:, None, None]) * ds
    z = z + np.minimum(short, to_boundary(dz, z)[:, None, None]) * dz
    return np.asarray((s * z).mean(axis=(1, 2)))


def next_bounds(
    mu: Array, gain: Array, promise: Array, floor: float, first: float, k: int
) -> Array:
    """Bounds (2, b) between which the next mu is chosen.

    After a good step mu may take any value from a tenth of itself up to the first one. After a
    step that crept it is raised tenfold at least. After a step in vain it is lowered: the barrier
    function has no lower value nearby, so that the start is at its minimum for this mu.

    Args:
        mu: The last ones (b,).
        gain: By how much the last steps lowered the barrier function (b,).
        promise: By how much they would have lowered it along their initial slope (b,).
        floor: The least mu of all.
        first: The mu at the beginning, of all experiments together.
        k: Number of experiments.
    """
    failed = gain <= NOTHING
    creeping = gain < CREEPING * promise
    most = first / k
    lower = np.maximum(np.maximum(floor, LOWER * mu), LEAST * promise / k)
    higher = np.minimum(most, mu / LOWER)
    return np.stack([np.where(creeping & ~failed, higher, lower), np.where(failed, lower, most)])
