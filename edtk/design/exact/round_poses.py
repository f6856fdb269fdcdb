"""A plan that is rounded to the steps of a controller, or spread out, and as good as before."""

from dataclasses import dataclass, replace
from itertools import product, takewhile

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace, plan_costs
from edtk.design.exact.apportion import apportion
from edtk.design.plan import Plan
from edtk.measure.pose_table import controller_step, rounded
from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import joint_distance
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
MOST_POSES = 400  # of a plan that is spread; beyond them poses are repeated
POSES_TRIED = 384  # poses near each pose, of which the best takes its place
# Distances to the poses that are tried, in parts of that between poses: from a fine improvement to
# another place altogether.
NEAREST_TRIED = 0.02
FARTHEST_TRIED = 6.0
SPREADING_PASSES = 24  # over all poses, at most
VISITS = 2400  # of all passes together: the time of many poses is bounded
GAIN_BY_SPREADING = 1e-5  # relative improvement by a pass for which another one is made
MARGIN_OF_DISTANCE = 1e-6  # beyond the distance between poses, against rounding


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
    enough = _cost(space, criterion, x, repeats) * (1 + LOSS_BY_ROUNDING)
    rounded = round_poses(space, criterion, x, repeats, merge)
    if not _cost(space, criterion, *rounded) > enough:
        return rounded
    apart = round_poses(space, criterion, x, repeats, merge=False)[0]
    found = _improved(space, criterion, apart, repeats)
    if not merge:
        return found, repeats
    merged = round_poses(space, criterion, found, repeats)
    if not _cost(space, criterion, *merged) > _cost(space, criterion, found, repeats) * (
        1 + GAIN_OF_PASS
    ):
        return merged
    return round_poses(space, criterion, found, repeats, within=EQUAL_POSES)


def _improved(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> Array:
    """Experiments (k, v) on steps, each in turn at the best of those around it."""
    x = x.copy()
    cost = _cost(space, criterion, x, repeats)
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
            reached = _cost(space, criterion, moved, repeats)
            if reached < cost:
                x, cost = moved, reached
        if not cost < before * (1 - GAIN_OF_PASS):
            break
    return x


def _cost(space: DesignSpace, criterion: Criterion, x: Array, repeats: Array) -> float:
    """The cost of a plan."""
    return float(plan_costs(criterion, space.at(x[None]), repeats[None])[0])


def spread(
    space: DesignSpace,
    criterion: Criterion,
    x: Array,
    repeats: Array,
    kept: Plan | None = None,
) -> Array:
    """Move the poses of a plan apart, at the least loss.

    Poses that are nearer to each other than `VisitNoise.within`, both with a load or both without,
    share what the model leaves out. Around an optimum, where the criterion is flat, they can all be
    elsewhere. Each pose in turn takes the best place among random ones nearby that are feasible and
    keep the distance. A pose without such a place stays where it is, and shares; so does each whose
    turn comes when the time is over (`time_limit`).

    Args:
        space: Model and feasible set, with noise that visits share.
        criterion: The criterion that the plan is good for.
        x: Design variables (k, v) of its experiments, all feasible.
        repeats: Their repetitions (k,).
        kept: Kept experiments, from which the distance is kept too.

    Returns:
        Design variables (k, v), in joint variables that a controller takes.
    """
    assert space.noise is not None
    n = len(space.fixed)
    q, loaded = np.empty((0, n)), np.empty(0)
    if kept is not None:
        q, loaded = kept.q, np.any(kept.wrench, axis=1).astype(float)
    search = _Spread(
        space, criterion, space.noise.within * (1 + MARGIN_OF_DISTANCE), repeats, q, loaded
    )
    for i in range(len(x)):
        if out_of_time():
            return x
        if search.is_crowded(x, i):
            x = search.moved(x, i, at_any_cost=True)
    cost = _cost(space, criterion, x, repeats)
    for _ in range(min(SPREADING_PASSES, max(1, VISITS // len(x)))):
        for i in range(len(x)):
            if out_of_time():
                return x
            x = search.moved(x, i)
        last = cost
        cost = _cost(space, criterion, x, repeats)
        if not cost < last * (1 - GAIN_BY_SPREADING):
            break
    return x


def divided(x: Array, repeats: Array) -> tuple[Array, Array]:
    """Make equal poses of the repeats of a plan, one a visit as far as they are not too many.

    Args:
        x: Design variables (k, v).
        repeats: Repetitions (k,).

    Returns:
        Design variables and repetitions of the same sum.
    """
    visits = int(repeats.sum())
    poses = apportion(repeats, min(visits, MOST_POSES))
    shares = [
        np.full(count, times // count) + (np.arange(count) < times % count)
        for times, count in zip(repeats.astype(int), poses, strict=True)
        if count
    ]
    return np.repeat(x, poses, axis=0), np.concatenate(shares).astype(float)


@dataclass(frozen=True, eq=False)
class _Spread:
    """The parts of a search that stay the same.

    Attributes:
        space: Model and feasible set.
        criterion: The criterion to improve.
        distance: Least distance between poses [rad].
        repeats: Visits (k,) of the poses.
        kept: Further poses (c, n) to keep away from.
        loaded: Whether each of these (c,) is loaded.
    """

    space: DesignSpace
    criterion: Criterion
    distance: float
    repeats: Array
    kept: Array
    loaded: Array

    def is_crowded(self, x: Array, i: int) -> bool:
        """Whether pose i is too near one before it."""
        return bool(self._away(x[:i], x[i]).min(initial=np.inf) < self.distance)

    def moved(self, x: Array, i: int, at_any_cost: bool = False) -> Array:
        """The plan with pose i at its best place nearby.

        Args:
            x: Design variables (k, v).
            i: Index of the pose.
            at_any_cost: Whether it moves even where that makes the plan worse.
        """
        rest = np.delete(x, i, axis=0)
        # Crowded poses are moved one after another: only those that have their place count.
        placed = x[:i] if at_any_cost else rest
        tried = self._nearby(x[i], i)
        tried = tried[self._away(placed, tried).min(axis=-1, initial=np.inf) >= self.distance]
        if not len(tried):
            return x
        others = self._information(x) - self._blocks(x[i : i + 1], i)[0]
        costs = self.criterion.cost(others + self._blocks(tried, i))
        best = int(np.argmin(costs))
        if not (
            at_any_cost
            or costs[best]
            < _cost(self.space, self.criterion, x, self.repeats)
            * (1 - GAIN_BY_SPREADING * GAIN_BY_SPREADING)
        ):
            return x
        return np.concatenate([x[:i], tried[best : best + 1], x[i + 1 :]])

    def _nearby(self, own: Array, i: int) -> Array:
        """Feasible experiments (t, v) around one, in joint variables that a controller takes.

        Half of them differ in one variable only: along some joints nothing may change at all.
        """
        space = self.space
        rng = np.random.default_rng(i)
        move = space.movable
        lower, upper = space.limits[:, move]
        direction = rng.standard_normal((POSES_TRIED, len(move)))
        alone = np.eye(len(move))[rng.integers(len(move), size=POSES_TRIED // 2)]
        direction[: POSES_TRIED // 2] = alone * np.sign(direction[: POSES_TRIED // 2])
        # Lengths of prismatic joints and forces move by the share of their range that the distance
        # is of a turn.
        turning = np.array(
            [j < len(space.fixed) and not space.workspace.robot.slides[j] for j in move]
        )
        unit = np.where(turning, 1.0, (upper - lower) / (2 * np.pi))
        steps = self.distance * np.exp(
            rng.uniform(np.log(NEAREST_TRIED), np.log(FARTHEST_TRIED), (POSES_TRIED, 1))
        )
        tried = np.tile(own, (POSES_TRIED, 1))
        moved = tried[:, move] + steps * unit * direction
        tried[:, move] = np.clip(moved, lower, upper)
        tried[:, space.free] = to_steps(space, tried)[:, space.free]
        return tried[space.at(tried).feasible]

    def _away(self, x: Array, own: Array) -> Array:
        """Distances (..., k + c) of experiments (k, v) and kept poses from others (..., v) [rad].

        Those of which only one is loaded are infinitely far.
        """
        n = len(self.space.fixed)
        others = np.concatenate([x[:, :n], self.kept])
        away = joint_distance(others, own[..., None, :n], self.space.workspace.robot.slides)
        loaded = np.append(self._is_loaded(x), self.loaded)
        return np.where(loaded == self._is_loaded(own)[..., None], away, np.inf)

    def _is_loaded(self, x: Array) -> Mask:
        """Which experiments (..., v) are under a load."""
        wrench = np.asarray(self.space.load.wrench(x[..., len(self.space.fixed) :]))
        return np.broadcast_to(wrench.any(axis=-1), x.shape[:-1])

    def _information(self, x: Array) -> Array:
        """Information (p, p) of the plan, whose poses count as far apart."""
        return self.space.at(x[None]).information(self.repeats[None])[0]

    def _blocks(self, x: Array, i: int) -> Array:
        """Information (t, p, p) of the visits of pose i, at places (t, v)."""
        times = np.full((len(x), 1), self.repeats[i])
        own = replace(self.space, prior=None).at(x[:, None])
        return own.information(times)
