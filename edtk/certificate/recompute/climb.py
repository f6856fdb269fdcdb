"""A search for experiments of larger sensitivity, which no derivative guides."""

from collections.abc import Callable

import numpy as np

from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

LONGER = 1.5  # one success in five or so keeps the step, by Rechenberg's rule for steps of chance
SHORTER = 0.9
ROUNDS = 120


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
