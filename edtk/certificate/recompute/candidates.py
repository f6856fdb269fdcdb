"""The candidates of a certificate, drawn anew from their seed."""

from collections.abc import Callable, Iterator

import numpy as np

from edtk.certificate.recompute.effort import MOST_SECONDS, of_experiment, of_sample
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

CHUNK = 16384
BARREN = 30  # chunks without a feasible pose after which the drawing gives up


def candidates(
    setting: Setting,
    seed: list[int],
    sampling: str,
    number: int,
    multipliers: int = 1,
    parts: int = 1,
) -> Iterator[Array]:
    """The first feasible experiments (k, n + d) of a seeded sequence, `number` of them, in chunks.

    Points of the unit cube, random or of a scrambled Sobol sequence, are stretched to the limits
    of the free joints and to the loads; infeasible poses are dropped.

    Args:
        setting: Feasible set and loads.
        seed: Seed of the sequence.
        sampling: "random" or "sobol".
        number: Number of feasible experiments.
        multipliers: Number of multipliers whose sensitivities each of them is to have.
        parts: Number of such sequences in a certificate, which share the time that it may take.

    Raises:
        ValueError: No feasible pose turns up, or too many samples are needed.
    """
    # A million candidates of the milling example, of whose samples one in three is feasible, need
    # 3e6 samples and 10 s.
    seconds = MOST_SECONDS / parts
    left_seconds = seconds - number * of_experiment(setting, multipliers) / 1e6
    most = int(max(left_seconds, 0.0) * 1e6 / of_sample(setting))
    if number > most:
        message = f"{number:.3g} candidates take longer than the {seconds:.2g} s that they may take"
        raise ValueError(message)
    n = len(setting.fixed)
    draw = _cube_of(seed, sampling, len(setting.free) + setting.load.size)
    left = number
    samples = 0
    barren = 0
    while left > 0:
        x = _stretched(setting, draw(CHUNK))
        x = x[setting.workspace.violation(x[:, :n]) <= 0][:left]
        left -= len(x)
        samples += CHUNK
        barren = 0 if len(x) else barren + 1
        if barren > BARREN:
            raise ValueError("no feasible candidate turns up")
        if left and samples > most:
            raise ValueError(f"{samples:.3g} samples hold fewer feasible ones than {number:.3g}")
        if len(x):
            yield x


def _cube_of(seed: list[int], sampling: str, size: int) -> Callable[[int], Array]:
    """A function that draws the next k points (k, size) of the unit cube."""
    rng = np.random.default_rng(seed)
    if sampling == "sobol":
        from scipy.stats import qmc  # takes half a second, which random points need not pay

        return qmc.Sobol(size, rng=rng).random

    def uniform(k: int) -> Array:
        return rng.random((k, size))

    return uniform


def _stretched(setting: Setting, cube: Array) -> Array:
    """Experiments (k, n + d) of points of the unit cube."""
    free = setting.free
    n = len(setting.fixed)
    lower, upper = setting.limits[:, free]
    x = np.empty((len(cube), n + setting.load.size))
    x[:, :n] = setting.fixed
    x[:, free] = lower + (upper - lower) * cube[:, : len(free)]
    x[:, n:] = setting.load.draw(cube[:, len(free) :])
    return x
