"""The candidates of a certificate, drawn anew from their seed."""

from collections.abc import Callable, Iterator

import numpy as np

from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

CHUNK = 16384
BARREN = 30  # chunks without a feasible pose after which the drawing gives up
# Samples that are drawn at most. They take up to a minute on one core: a certificate that asks
# for more must not keep a machine busy for hours. A million candidates of the milling example, of
# whose samples one in three is feasible, need 3e6.
MOST_SAMPLES = 30_000_000
USUAL_JOINTS = 8  # the time that a sample takes grows with the joints beyond
COSTLY = 20  # excluded poses or multipliers that take as long as the sample itself


def candidates(
    setting: Setting, seed: list[int], sampling: str, number: int, multipliers: int = 1
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

    Raises:
        ValueError: No feasible pose turns up, or too many samples are needed.
    """
    joints = max(1.0, len(setting.fixed) / USUAL_JOINTS)
    burden = joints + (len(setting.workspace.excluded) + multipliers) / COSTLY
    most = int(MOST_SAMPLES / burden)
    if number > most:
        raise ValueError(f"{number:.3g} candidates are more than the {most:.3g} samples drawn here")
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
