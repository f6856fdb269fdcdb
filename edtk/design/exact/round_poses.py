"""A plan in poses that a controller takes."""

from itertools import product

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.to_steps import to_steps
from edtk.system.typing import Array, Indices, Mask
from edtk.tables.in_file_units import controller_step

WIDER = (0, 1, 2)  # steps beyond the neighbouring ones that are tried, in turn
MOST_TRIED = 20_000  # poses; all those nearby of seven joints
SAME_LOAD = 1e-6  # of the range of the load: a smaller difference is none


def round_poses(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, merge: bool = True
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

    Returns:
        Design variables and repetitions of the same kind, of perhaps fewer experiments.
    """
    x = x.copy()
    exact = x.copy()
    x[:, space.free] = to_steps(space, x)[:, space.free]
    for i in np.flatnonzero(~space.at(x).feasible).tolist():
        x[i] = _nearby(space, criterion, x, repeats, i, exact[i])
    return _merged(space, x, repeats) if merge else (x, repeats)


def _nearby(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, i: int, exact: Array
) -> Array:
    """The best feasible experiment (v,) of those around experiment i, or that one itself."""
    robot = space.workspace.robot
    step = controller_step(robot)[space.free]
    shown = robot.shown(exact[: robot.n])
    others = space.problem(x).information(np.where(np.arange(len(x)) == i, 0.0, repeats))
    if space.prior is not None:
        others = others + repeats[i] * space.prior
    for wider in WIDER:
        around = 2 * (1 + wider)
        if around ** len(step) > MOST_TRIED:
            break
        offsets = np.array(list(product(range(-wider, 2 + wider), repeat=len(step))))
        tried = np.tile(exact, (len(offsets), 1))
        below = np.floor(shown[space.free] / step)
        near = np.tile(shown, (len(offsets), 1))
        near[:, space.free] = (below + offsets) * step
        tried[:, space.free] = robot.of_shown(near)[:, space.free]
        tried[:, space.free] = to_steps(space, tried)[:, space.free]
        tried = tried[space.at(tried).feasible]
        if len(tried):
            own = space.problem(tried).blocks()
            return np.asarray(tried[criterion.cost(others + repeats[i] * own).argmin()])
    return exact


def _merged(space: DesignSpace, x: Array, repeats: Array) -> tuple[Array, Array]:
    """The experiments without those within a step of a more repeated one, whose repeats add up."""
    order = np.argsort(-repeats, kind="stable")
    kept: list[int] = []
    total = repeats.copy()
    for i in order:
        same = np.flatnonzero(_same(space, x[kept], x[i]))
        if len(same):
            total[kept[same[0]]] += repeats[i]
        else:
            kept.append(int(i))
    chosen: Indices = np.sort(np.array(kept, dtype=int))
    return x[chosen], total[chosen]


def _same(space: DesignSpace, x: Array, own: Array) -> Mask:
    """Whether experiments (k, v) are that of one (v,), to a step of the controller."""
    lower, upper = space.load.limits
    robot = space.workspace.robot
    steps = controller_step(robot) * (1 + SAME_LOAD)
    within = np.concatenate([steps, SAME_LOAD * (upper - lower)])
    apart = x - own
    apart[..., : robot.n] = robot.shown_change(apart[..., : robot.n])
    return np.asarray((np.abs(apart) <= within).all(axis=-1))
