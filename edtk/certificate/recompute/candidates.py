"""The candidates of a certificate, drawn anew from their seed, and a search beyond them.

The rates are those of one core of a usual machine, in microseconds, rounded up. They need not be
right to better than a factor of two: they keep a small file from keeping a machine busy for hours.
"""

from collections.abc import Callable, Iterator

import numpy as np

from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

MOST_SECONDS = 30.0
PER_JOINT = 0.25  # of a sample's test of feasibility
PER_EXCLUDED = 0.3
PER_FRAME = 0.7  # of one joint, for one instrument
PER_COLUMN = 0.2  # of a parameter of geometry, for one instrument
PER_CUBE = 1e-3  # of a matrix: of a decomposition, by the cube of its order
PER_SQUARE = 0.02  # of a matrix that is filled
CHUNK = 16384
FIRST = 4  # times the candidates that are asked for are drawn first, which often is enough
BARREN = 30 * CHUNK  # samples without a feasible pose after which the drawing gives up
LONGER = 1.5  # one success in five or so keeps the step, by Rechenberg's rule for steps of chance
SHORTER = 0.9
ROUNDS = 120


def of_sample(setting: Setting) -> float:
    """Time to draw a sample, and to see whether it is feasible [us]."""
    return PER_JOINT * len(setting.chain.axes) + PER_EXCLUDED * len(setting.workspace.excluded)


def of_experiment(setting: Setting, multipliers: int = 1) -> float:
    """Time for the rows of an experiment, and for its sensitivities [us]."""
    measured = len(setting.sigma)
    instruments = 1 if setting.physics is None else len(setting.physics.sensors)
    columns = 0 if setting.geometry is None else setting.p
    rows = instruments * (PER_FRAME * len(setting.chain.axes) + PER_COLUMN * columns)
    if setting.noise is not None:
        rows += PER_CUBE * measured**3 + PER_SQUARE * measured**2
    each = measured * (PER_SQUARE * setting.p + PER_CUBE / 5 * setting.p**2)
    return rows + multipliers * each


def of_rows(setting: Setting, experiments: int) -> float:
    """Time for the value of a design, whose rows are decomposed together [us]."""
    rows = experiments * len(setting.sigma)
    visits = 0.0 if setting.noise is None else PER_SQUARE * len(setting.fixed) * experiments**2
    return experiments * of_experiment(setting) + PER_CUBE * rows * setting.p**2 + visits


def of_bounds(setting: Setting, multipliers: int, is_g: bool) -> float:
    """Time for the closed forms of the bounds [us]."""
    decompositions = 60.0 if is_g else 8.0
    return float(multipliers * decompositions * PER_CUBE * np.power(float(setting.p), 3))


def require(microseconds: float, what: str) -> None:
    """Refuse what takes too long.

    Raises:
        ValueError: It does; names what, and both times.
    """
    seconds = microseconds / 1e6
    if not seconds <= MOST_SECONDS:
        message = f"{what} take about {seconds:.2g} s to check, more than the {MOST_SECONDS:g} s"
        raise ValueError(f"{message} that a certificate may take")


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
    chunk = 1 << (FIRST * number - 1).bit_length()
    while left > 0:
        chunk = min(chunk, CHUNK)
        x = _stretched(setting, draw(chunk))
        x = x[setting.workspace.violation(x[:, :n]) <= 0][:left]
        left -= len(x)
        samples += chunk
        barren = 0 if len(x) else barren + chunk
        chunk *= 2  # as Sobol's points, in powers of two
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


def climb(
    setting: Setting, x: Array, height: Callable[[Array], Array], rounds: int = ROUNDS
) -> Array:
    """Experiments (k, v) uphill of feasible ones (k, v), by steps of chance that shrink.

    A step that is feasible and higher is taken, and makes the next one longer; others shorten it.

    Args:
        setting: Feasible set and loads.
        x: Experiments to begin with (k, v).
        height: Function of experiments (k, v) that gives (k,).
        rounds: Number of steps of each start.
    """
    rng = np.random.default_rng(0)  # the same certificate gets the same verdict
    n = len(setting.fixed)
    lower, upper = np.concatenate([setting.limits, setting.load.limits], axis=1)
    movable = np.zeros(x.shape[1], dtype=bool)
    movable[setting.free] = True
    movable[n:] = setting.load.moves
    best = np.array(x)
    level = height(best)
    # A tenth of each range: starts are far from a maximum. 120 failures shrink it 3e5-fold.
    step = np.full(len(x), 0.1)
    for _ in range(rounds):
        trial = best + step[:, None] * (upper - lower) * rng.standard_normal(best.shape)
        trial = np.where(movable, np.clip(trial, lower, upper), best)
        found = height(trial)
        taken = (found > level) & (setting.workspace.violation(trial[:, :n]) <= 0)
        best[taken] = trial[taken]
        level[taken] = found[taken]
        step *= np.where(taken, LONGER, SHORTER)
    return best
