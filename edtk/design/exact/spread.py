"""Visits of a plan, moved so far apart that each has an error of the model of its own."""

from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.apportion import apportion
from edtk.design.exact.round_poses import plan_cost, to_steps
from edtk.design.plan import Plan
from edtk.robots.robot import joint_distance
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Mask

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
    cost = plan_cost(space, criterion, x, repeats)
    for _ in range(min(SPREADING_PASSES, max(1, VISITS // len(x)))):
        for i in range(len(x)):
            if out_of_time():
                return x
            x = search.moved(x, i)
        last = cost
        cost = plan_cost(space, criterion, x, repeats)
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
            < plan_cost(self.space, self.criterion, x, self.repeats)
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
