"""A plan that is rounded to the steps of a controller, and as good as before."""

from itertools import takewhile

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.round_poses import MOST_TRIED, best_of_tried, round_poses
from edtk.design.exact.steps_around import number_around, steps_around
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

LOSS = 1e-5  # relative increase of the cost by rounding; at a constraint it is 1e-6 as a rule
GAIN = 1e-6  # relative improvement for which another pass is made
PASSES = 10
WIDEST = 16  # steps
EQUAL = 0.5  # steps up to which poses are equal for a controller


def round_plan(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, merge: bool = True
) -> tuple[Array, Array]:
    """Round the poses of a plan to the steps of a controller, at next to no loss.

    A plan is flat around its optimum, so that the nearest steps are as good, see `round_poses`. It
    is not where poses differ by little and the differences count: two poses on both sides of one in
    which a joint has no torque keep that joint's compliance apart from the others, and a thousandth
    of a degree made 15 % of the error. Pose by pose then takes the best of the steps around it.

    Args:
        space: Model and feasible set.
        criterion: The criterion that the plan is good for.
        x: Design variables (k, v) of its experiments, all feasible.
        repeats: Their repetitions (k,).
        merge: Whether poses that are then equal are merged.

    Returns:
        Design variables and repetitions of the same kind, of perhaps fewer experiments.
    """
    enough = _cost(space, criterion, x, repeats) * (1 + LOSS)
    rounded = round_poses(space, criterion, x, repeats, merge)
    if not _cost(space, criterion, *rounded) > enough:
        return rounded
    apart = round_poses(space, criterion, x, repeats, merge=False)[0]
    found = _improved(space, criterion, apart, repeats)
    if not merge:
        return found, repeats
    merged = round_poses(space, criterion, found, repeats)
    if not _cost(space, criterion, *merged) > _cost(space, criterion, found, repeats) * (1 + GAIN):
        return merged
    return round_poses(space, criterion, found, repeats, within=EQUAL)


def _improved(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> Array:
    """Experiments (k, v) on steps, each in turn at the best of those around it."""
    x = x.copy()
    cost = _cost(space, criterion, x, repeats)
    few = takewhile(lambda wider: number_around(space, wider) <= MOST_TRIED, range(WIDEST + 1))
    wider = max(few, default=0)
    for _ in range(PASSES):
        before = cost
        for i in np.flatnonzero(repeats > 0).tolist():
            if out_of_time():
                return x
            tried = steps_around(space, x[i], wider)
            if not len(tried):
                continue
            moved = x.copy()
            moved[i] = best_of_tried(space, criterion, x, repeats, i, tried)
            # Repeats that share an error have changed what the others tell.
            reached = _cost(space, criterion, moved, repeats)
            if reached < cost:
                x, cost = moved, reached
        if not cost < before * (1 - GAIN):
            break
    return x


def _cost(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> float:
    """The cost of a plan."""
    return float(criterion.cost(space.at(x[None]).information(repeats[None]))[0])
