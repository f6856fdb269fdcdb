"""Experiments drawn anew: the candidates of a certificate, and a search for better ones nearby."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

CHUNK = 16384
BARREN = 100  # chunks without a feasible pose after which the drawing gives up


def load_size(load: dict[str, Any]) -> int:
    """Number of design variables of a load: none, a size, an index, or a force in polar form."""
    if load.get("F_N") is not None:
        return 0
    if load.get("list_F_N") is not None or load.get("direction") is not None:
        return 1
    return 3


def draw_load(load: dict[str, Any], cube: Array) -> Array:
    """Load variables (k, d) of points of the unit cube (k, d)."""
    if load.get("list_F_N") is not None:
        number = len(load["list_F_N"])
        return np.minimum(np.floor(number * cube), number - 1)
    if cube.shape[1] < 3:
        return cube
    elevation = np.arcsin(np.clip(2 * cube[:, 1] - 1, -1.0, 1.0))
    azimuth = np.pi * (2 * cube[:, 2] - 1)
    return np.stack([np.cbrt(cube[:, 0]), elevation, azimuth], axis=1)


def wrenches(load: dict[str, Any], u: Array) -> Array:
    """Wrenches (k, 6) [N, N m] of load variables (k, d)."""
    found = np.zeros((len(u), 6))
    if load.get("F_N") is not None:
        found[:] = [*load["F_N"], *load.get("T_Nm", (0, 0, 0))]
    elif load.get("list_F_N") is not None:
        found[:, :3] = np.array(load["list_F_N"], dtype=float)[np.rint(u[:, 0]).astype(int)]
    elif load.get("direction") is not None:
        direction = np.array(load["direction"], dtype=float)
        found[:, :3] = u * load["F_max_N"] * direction / np.linalg.norm(direction)
    else:
        r, elevation, azimuth = u.T
        flat = np.cos(elevation)
        force = [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
        found[:, :3] = load["F_max_N"] * (r * np.stack(force)).T
    return found


def load_limits(load: dict[str, Any]) -> Array:
    """Bounds (2, d) between which a search may move the load variables; an index does not move."""
    size = load_size(load)
    if size < 3:
        return np.array([[0.0] * size, [1.0] * size])
    return np.array([[-1.0, -np.pi, -2 * np.pi], [1.0, np.pi, 2 * np.pi]])


def candidates(setting: Setting, seed: Any, sampling: str, number: int) -> Iterator[Array]:
    """The first feasible experiments (k, n + d) of a seeded sequence, `number` of them, in chunks.

    Points of the unit cube, random or of a scrambled Sobol sequence, are stretched to the limits
    of the free joints and to the loads; infeasible poses are dropped.

    Raises:
        ValueError: No feasible pose turns up.
    """
    n = len(setting.fixed)
    free = setting.free
    size = len(free) + load_size(setting.load)
    rng = np.random.default_rng(seed)
    draw: Callable[[int], Array] = lambda k: rng.random((k, size))  # noqa: E731
    if sampling == "sobol":
        from scipy.stats import qmc

        draw = qmc.Sobol(size, rng=rng).random
    lower, upper = setting.chain.limits[:, free]
    left = number
    barren = 0
    while left > 0:
        cube = draw(CHUNK)
        x = np.empty((CHUNK, n + size - len(free)))
        x[:, :n] = setting.fixed
        x[:, free] = lower + (upper - lower) * cube[:, : len(free)]
        x[:, n:] = draw_load(setting.load, cube[:, len(free) :])
        x = x[setting.violation(x[:, :n]) <= 0][:left]
        left -= len(x)
        barren = 0 if len(x) else barren + 1
        if barren > BARREN:
            raise ValueError("no feasible candidate turns up")
        yield x


def climb(setting: Setting, x: Array, height: Callable[[Array], Array], rounds: int = 120) -> Array:
    """Experiments (k, v) uphill of feasible ones (k, v), by steps of chance that shrink.

    No derivative is used. A step that is feasible and higher is taken; the others shrink the next.

    Args:
        setting: Feasible set and loads.
        x: Where to begin (k, v).
        height: Function of experiments (k, v) that gives (k,).
        rounds: Number of steps of each start.
    """
    rng = np.random.default_rng(0)
    n = len(setting.fixed)
    bounds = np.concatenate([setting.chain.limits, load_limits(setting.load)], axis=1)
    movable = np.zeros(x.shape[1])
    movable[setting.free] = 1.0
    movable[n:] = setting.load.get("list_F_N") is None
    span = (bounds[1] - bounds[0]) * movable
    best = np.array(x)
    level = height(best)
    step = np.full(len(x), 0.1)
    for _ in range(rounds):
        trial = best + step[:, None] * span * rng.standard_normal(best.shape)
        trial = np.clip(trial, bounds[0], bounds[1])
        trial = np.where(movable > 0, trial, best)
        there = height(trial)
        taken = (there > level) & (setting.violation(trial[:, :n]) <= 0)
        best[taken] = trial[taken]
        level[taken] = there[taken]
        # One success in five keeps the step (Rechenberg's rule for steps of chance).
        step *= np.where(taken, 1.5, 0.9)
    return best
