"""A plan that is rounded to the steps of a controller, and as good as before."""

from itertools import product, takewhile

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace, plan_costs
from edtk.measure.pose_table import controller_step, rounded
from edtk.robots.joint import AT_LIMIT
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

WIDER = (0, 1, 2)  # steps beyond the neighbouring ones that are tried, in turn
MOST_TRIED = 20_000  # poses; all those nearby of seven joints
SAME_LOAD = 1e-6  # of the range of the load: a smaller difference is none
# Relative increase of the cost by rounding; at a constraint it is 1e-6 as a rule.
LOSS_BY_ROUNDING = 1e-5
GAIN_OF_PASS = 1e-6  # relative improvement for which another pass is made
ROUNDING_PASSES = 10
WIDEST = 16  # steps
EQUAL_POSES = 0.5  # steps up to which poses are equal for a controller


def to_steps(space: DesignSpace, x: Array) -> Array:
    """Joint variables (k, n) at the controller's nearest steps, or at a limit that lies there.

    Args:
        space: The feasible set.
        x: Design variables (k, v).
    """
    n = len(space.fixed)
    q = rounded(space.workspace.robot, x[:, :n])
    lower, upper = space.workspace.robot.hard_limits
    # A limit in degrees may have been converted with another last bit.
    within = np.clip(q, lower, upper)
    return np.where(np.abs(within - q) <= AT_LIMIT, within, q)


def steps_around(space: DesignSpace, x: Array, wider: int) -> Array:
    """Feasible experiments (n, v) whose designed joints are at the steps around those of one.

    Args:
        space: Model and feasible set.
        x: Design variables (v,) of the one.
        wider: Steps beyond the two neighbouring ones of each joint.
    """
    robot = space.workspace.robot
    step = controller_step(robot)[space.free]
    shown = robot.shown(x[: robot.n])
    offsets = np.array(list(product(range(-wider, 2 + wider), repeat=len(step))))
    near = np.tile(shown, (len(offsets), 1))
    near[:, space.free] = (np.floor(shown[space.free] / step) + offsets) * step
    tried = np.tile(x, (len(offsets), 1))
    tried[:, space.free] = robot.of_shown(near)[:, space.free]
    tried[:, space.free] = to_steps(space, tried)[:, space.free]
    return np.asarray(tried[space.at(tried).feasible])


def number_around(space: DesignSpace, wider: int) -> int:
    """Number of these steps."""
    return int((2 * (1 + wider)) ** len(space.free))


def round_poses(
    space: DesignSpace,
    criterion: Criterion,
    x: Array,
    repeats: Array,
    merge: bool = True,
    within: float = 1.0,
) -> tuple[Array, Array]:
    """Round the poses of a plan to the steps of a controller, and merge those that are then equal.

    Each designed joint is rounded to the nearest step. A pose that would leave the feasible set, or
    hide a marker that is read at the edge of what an instrument sees, takes the best feasible one
    of those nearby instead. Without any it stays as it is.

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
    for i in np.flatnonzero(~space.at(x).feasible | _hides(space, exact, x)).tolist():
        x[i] = _nearby(space, criterion, x, repeats, i, exact[i])
    return _merged(space, x, repeats, within) if merge else (x, repeats)


def _hides(space: DesignSpace, exact: Array, x: Array) -> Mask:
    """Which experiments (k,) hide a marker that is read where they were before (k or 1, v)."""
    if space.sight is None:
        return np.zeros(len(x), dtype=bool)
    n = len(space.fixed)
    return np.asarray((space.sight.seen(exact[:, :n]) & ~space.sight.seen(x[:, :n])).any(axis=-1))


def _nearby(
    space: DesignSpace, criterion: Criterion, x: Array, repeats: Array, i: int, exact: Array
) -> Array:
    """The best feasible experiment (v,) of those around experiment i, or that one itself.

    One that hides no marker that was read is looked for farther away: at the edge of what is seen
    a marker that is lost made 6 % of the error.
    """
    nearby = exact[None]
    for wider in WIDER:
        if number_around(space, wider) > MOST_TRIED:
            break
        tried = steps_around(space, exact, wider)
        read = tried[~_hides(space, exact[None], tried)]
        if len(read):
            return best_of_tried(space, criterion, x, repeats, i, read)
        nearby = tried if len(tried) else nearby
    return best_of_tried(space, criterion, x, repeats, i, nearby)


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
    enough = plan_cost(space, criterion, x, repeats) * (1 + LOSS_BY_ROUNDING)
    rounded = round_poses(space, criterion, x, repeats, merge)
    if not plan_cost(space, criterion, *rounded) > enough:
        return rounded
    apart = round_poses(space, criterion, x, repeats, merge=False)[0]
    found = _improved(space, criterion, apart, repeats)
    if not merge:
        return found, repeats
    merged = round_poses(space, criterion, found, repeats)
    if not plan_cost(space, criterion, *merged) > plan_cost(space, criterion, found, repeats) * (
        1 + GAIN_OF_PASS
    ):
        return merged
    return round_poses(space, criterion, found, repeats, within=EQUAL_POSES)


def _improved(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> Array:
    """Experiments (k, v) on steps, each in turn at the best of those around it."""
    x = x.copy()
    cost = plan_cost(space, criterion, x, repeats)
    few = takewhile(lambda wider: number_around(space, wider) <= MOST_TRIED, range(WIDEST + 1))
    wider = max(few, default=0)
    for _ in range(ROUNDING_PASSES):
        before = cost
        for i in np.flatnonzero(repeats > 0).tolist():
            # Without time one plan that tells all is enough.
            if out_of_time() and np.isfinite(cost):
                return x
            tried = steps_around(space, x[i], wider)
            if not len(tried):
                continue
            moved = x.copy()
            moved[i] = best_of_tried(space, criterion, x, repeats, i, tried)
            # Repeats that share an error have changed what the others tell.
            reached = plan_cost(space, criterion, moved, repeats)
            if reached < cost:
                x, cost = moved, reached
        if not cost < before * (1 - GAIN_OF_PASS):
            break
    return x


def plan_cost(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> float:
    """The cost of a plan."""
    return float(plan_costs(criterion, space.at(x[None]), repeats[None])[0])
