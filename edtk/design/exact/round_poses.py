"""A plan in poses that a controller takes."""

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.steps_around import number_around, steps_around
from edtk.design.exact.to_steps import to_steps
from edtk.system.typing import Array, Indices, Mask
from edtk.tables.in_file_units import controller_step

WIDER = (0, 1, 2)  # steps beyond the neighbouring ones that are tried, in turn
MOST_TRIED = 20_000  # poses; all those nearby of seven joints
SAME_LOAD = 1e-6  # of the range of the load: a smaller difference is none


def round_poses(
    space: DesignSpace,
    criterion: Criterion,
    x: Array,
    repeats: Array,
    merge: bool = True,
    within: float = 1.0,
) -> tuple[Array, Array]:
    """Round the poses of a plan to the steps of a controller, and merge those that are then equal.

    Each designed joint is rounded to the nearest step. A pose that would leave the feasible set
    takes the best feasible one of those nearby instead. Without any it stays as it is.

    Args:
        space: Model and feasible set.
        criterion: The criterion that the plan is good for.
        x: Design variables (k, v) of its experiments, all feasible.
        repeats: Their repetitions (k,).
        merge: Whether poses that are then equal are merged.
        within: Steps up to which poses are equal.

    Returns:
        Design variables and repetitions of the same kind, of perhaps fewer experiments.
    """
    x = x.copy()
    exact = x.copy()
    x[:, space.free] = to_steps(space, x)[:, space.free]
    for i in np.flatnonzero(~space.at(x).feasible).tolist():
        x[i] = _nearby(space, criterion, x, repeats, i, exact[i])
    return _merged(space, x, repeats, within) if merge else (x, repeats)


def _nearby(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, i: int, exact: Array
) -> Array:
    """The best feasible experiment (v,) of those around experiment i, or that one itself."""
    for wider in WIDER:
        if number_around(space, wider) > MOST_TRIED:
            break
        tried = steps_around(space, exact, wider)
        if len(tried):
            return best_of_tried(space, criterion, x, repeats, i, tried)
    return exact


def best_of_tried(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, i: int, tried: Array
) -> Array:
    """The best (v,) of some experiments (n, v) in the place of experiment i of a plan (k, v)."""
    others = space.problem(x).information(np.where(np.arange(len(x)) == i, 0.0, repeats))
    if space.prior is not None:
        others = others + repeats[i] * space.prior
    costs = criterion.cost(others + repeats[i] * space.problem(tried).blocks())
    return np.asarray(tried[costs.argmin()])


def _merged(space: DesignSpace, x: Array, repeats: Array, within: float) -> tuple[Array, Array]:
    """The experiments without those close to a more repeated one, which takes their repeats."""
    order = np.argsort(-repeats, kind="stable")
    kept: list[int] = []
    total = repeats.copy()
    for i in order:
        same = np.flatnonzero(_same(space, x[kept], x[i], within))
        if len(same):
            total[kept[same[0]]] += repeats[i]
        else:
            kept.append(int(i))
    chosen: Indices = np.sort(np.array(kept, dtype=int))
    return x[chosen], total[chosen]


def _same(space: DesignSpace, x: Array, own: Array, within: float) -> Mask:
    """Whether experiments (k, v) are that of one (v,), to so many steps of the controller."""
    lower, upper = space.load.limits
    robot = space.workspace.robot
    steps = within * controller_step(robot) * (1 + SAME_LOAD)
    most = np.concatenate([steps, SAME_LOAD * (upper - lower)])
    apart = x - own
    apart[..., : robot.n] = robot.shown_change(apart[..., : robot.n])
    return np.asarray((np.abs(apart) <= most).all(axis=-1))
