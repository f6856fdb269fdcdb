"""Constrained descent of many starts at once: a primal-dual interior-point method with Newton steps.

Each start is a group of k experiments that move together: ``min f(x)`` subject to slacks ``s_i(x) >= 0``, the bounds
included. Iterates stay strictly inside. With multipliers z and barrier mu a step solves

    (H + sum_i (z_i/s_i) g_i g_i') dx = -(grad f - sum_i (mu/s_i) g_i),   dz = mu/s - z - (z/s) g' dx,

where g_i is the gradient of the slack s_i and H the Hessian of the Lagrangian ``f - sum z_i s_i`` (Nocedal and Wright,
Numerical Optimization, 2nd ed., Chapter 19). As each slack belongs to one experiment, the sum is block-diagonal. The
barrier follows from what could be: the step is linear in mu, and mu is the mean of ``s_i z_i`` where its part without
mu would lead, as far as the constraints let it (a rule of Mehrotra's; Nocedal, Waechter and Waltz, Adaptive barrier
update strategies, SIAM J. Optim. 19, 2009). All starts take their steps in the same few array operations.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from edtk.design.design_space import DesignSpace
from edtk.design.experiments import Experiments
from edtk.design.interior_point.barrier import (
    LOWER,
    TO_BOUNDARY,
    merit,
    next_bounds,
    reachable,
    shortened,
    to_boundary,
)
from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.newton import direction

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
Local = tuple[Array, Array, Array, Array]
MARGIN = 1e-3  # of a start to its constraints [m, rad], and to its bounds in parts of their range
ARMIJO = 1e-4
SHORTER = np.array(
    [1.0, 0.5, 0.25, 0.125, 0.025, 5e-3, 1e-3, 1e-4, 1e-6]
)  # of a step: what is tried in turn
LATE = 1e-4  # barrier below which a start is near its end


class Objective(ABC):
    """What is minimised. Its values should be of order one, as the accuracy of a descent is absolute."""

    @abstractmethod
    def value(self, here: Experiments, start: Indices) -> Array:
        """Values (b,) of experiments (b, k), some of which may be inf, given the indices (b,) of their starts."""

    @abstractmethod
    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values (b,), slopes and curvature of experiments (b, k).

        Derivatives are by the d movable variables in parts of their range, see `Neighbourhood`: slopes (b, k, d),
        second derivatives (b, k, d, d) of each experiment by itself, and (b, kd, kd) of all together, which are added.
        """


def descend(
    space: DesignSpace,
    x: Array,
    objective: Objective,
    iterations: int = 200,
    accuracy: float = 1e-7,
    barrier: float = 0.03,
    stop: Callable[[], bool] = lambda: False,
) -> Array:
    """Design variables from which no way leads further down, as far as the steps can tell.

    Args:
        space: Feasible set and movable variables.
        x: Starts (b, k, v): b groups of k experiments each. One that lies outside, or on a bound, is pushed inside
            first; where that fails, it stays as it is.
        objective: What is minimised.
        iterations: Limit on steps that are tried.
        accuracy: On the objective: what slope and constraints still hold back when a start is done.
        barrier: Weight mu of the logarithmic barrier at the beginning, times k: what an experiment is worth.
        stop: Asked before each step whether to end early.

    Returns:
        Design variables (b, k, v), never worse than a feasible start, and feasible where the start was or could be
        pushed inside.
    """
    answer = np.array(x)
    if not space.movable or not len(x):
        return answer
    inside = inward(space, answer)
    path = _Path(space, objective, barrier, inside)
    least = np.full(len(x), np.inf)
    pushed = np.flatnonzero((inside != answer).any(axis=(1, 2)))  # the others begin where they are
    if len(pushed):
        before = space.at(answer[pushed])
        least[pushed] = np.where(
            before.feasible.all(axis=1), objective.value(before, pushed), np.inf
        )
    state = path.begin()
    floor = 0.1 * accuracy / max(1, state.point.s[:1].size)
    for taken in range(iterations + 1):
        here = state.point
        better = np.flatnonzero(here.f < least[here.start])
        won = here.start[better]
        answer[won], least[won] = path.variables(here.y[better], won), here.f[better]
        state = state[np.flatnonzero(~state.done)]
        if not len(state.mu) or taken == iterations or stop():
            break
        state = path.step(state, floor, accuracy)
    return answer


def inward(space: DesignSpace, x: Array) -> Array:
    """Experiments (..., v) moved off bounds and constraints by Gauss-Newton steps; those already inside stay."""
    x, move = np.array(x), space.movable
    lower, upper = space.limits[:, move]
    edge = MARGIN * (upper - lower)
    for _ in range(10):
        x[..., move] = np.clip(x[..., move], lower + edge, upper - edge)
        here = space.at(x)
        short = np.maximum(MARGIN - here.slack, 0.0)
        if not short.any():
            break
        G = here.slack_gradient[..., move] * (short > 0)[..., None]
        K = G @ np.swapaxes(G, -1, -2) + 1e-9 * np.eye(G.shape[-2])
        x[..., move] += (np.swapaxes(G, -1, -2) @ np.linalg.solve(K, 1.5 * short[..., None]))[
            ..., 0
        ]
    return x


@dataclass(frozen=True, eq=False)
class _Point:
    """What is seen where the starts are that are still on their way, strictly inside.

    Attributes:
        start: Which start each is (b,).
        y: Movable variables in parts of their range (b, k, d).
        f: Values (b,).
        g: Slopes (b, k, d) by y.
        own: Second derivatives (b, k, d, d) of each experiment by itself.
        joint: Second derivatives (b, kd, kd) of all together, to be added.
        s: Slacks (b, k, c), those of the bounds at the end.
        G: Their gradients (b, k, c, d).
        C: Second derivatives (b, k, c', d, d) of those that are not bounds.
    """

    start: Indices
    y: Array
    f: Array
    g: Array
    own: Array
    joint: Array
    s: Array
    G: Array
    C: Array

    def __getitem__(self, chosen: Indices) -> "_Point":
        """Some of the starts."""
        return _Point(*(getattr(self, f.name)[chosen] for f in fields(self)))

    def along(self, d: Array) -> Array:
        """Changes (b, k, c) of the slacks along d (b, k, d), to first order."""
        return np.asarray((self.G @ d[..., None])[..., 0])

    def but(self, chosen: Indices, other: "_Point") -> "_Point":
        """The same, with some of the starts from another; itself if none."""
        if not len(chosen):
            return self
        arrays = []
        for f in fields(self):
            arrays.append(np.array(getattr(self, f.name)))
            arrays[-1][chosen] = getattr(other, f.name)[chosen]
        return _Point(*arrays)


@dataclass(frozen=True, eq=False)
class _State:
    """How far the starts are.

    Attributes:
        point: What is seen where they are.
        z: Multipliers (b, k, c).
        mu: Barriers (b,).
        bounds: Those of the next ones (2, b).
        tried: How often a step from here was tried in vain (b,).
        done: Whether next to nothing is left to gain (b,).
    """

    point: _Point
    z: Array
    mu: Array
    bounds: Array
    tried: Indices
    done: NDArray[np.bool_]

    def __getitem__(self, chosen: Indices) -> "_State":
        """Some of the starts; itself if all."""
        if len(chosen) == len(self.mu):
            return self
        bounds, tried, done = self.bounds[:, chosen], self.tried[chosen], self.done[chosen]
        return _State(self.point[chosen], self.z[chosen], self.mu[chosen], bounds, tried, done)


class _Path:
    """The way down from a number of starts (b, k, v)."""

    def __init__(self, space: DesignSpace, objective: Objective, barrier: float, x: Array) -> None:
        self.space, self.objective, self.barrier, self.x = space, objective, barrier, x
        self.move = space.movable
        self.lower, self.upper = space.limits[:, self.move]
        self.walls = np.concatenate([np.eye(len(self.move)), -np.eye(len(self.move))])

    def variables(self, y: Array, start: Indices) -> Array:
        """Design variables (b, k, v) within the bounds."""
        x = self.x[start]
        x[..., self.move] = np.clip(
            self.lower + (self.upper - self.lower) * y, self.lower, self.upper
        )
        return x

    def look(self, y: Array, start: Indices) -> _Point:
        """All that is seen at y (b, k, d)."""
        near = Neighbourhood(self.space, self.variables(y, start))
        G = near.first(near.experiments.slack_gradient)
        walls = np.broadcast_to(self.walls, (*y.shape[:2], *self.walls.shape))
        local = self.objective.local(near, start)
        s = _with_walls(near.experiments.slack[0], y)
        return _Point(start, y, *local, s, np.concatenate([G[0], walls], axis=-2), near.second(G))

    def begin(self) -> _State:
        """All starts that are strictly inside and of finite value."""
        y = (self.x[..., self.move] - self.lower) / (self.upper - self.lower)
        point, mu = self.look(y, np.arange(len(y))), np.full(len(y), self.barrier / y.shape[1])
        inside = np.flatnonzero(np.isfinite(point.f) & (point.s > 0).all(axis=(1, 2)))
        with np.errstate(divide="ignore"):
            z = mu[:, None, None] / point.s
        never = np.zeros(len(y), dtype=int)
        return _State(point, z, mu, np.stack([LOWER * mu, mu]), never, never > 0)[inside]

    def step(self, state: _State, floor: float, accuracy: float) -> _State:
        """Try one step of every start: where it does not lower the barrier function enough, the next try is shorter."""
        here = state.point
        mu, d, ds, dz, fall = self._direction(state)
        length = to_boundary(ds, here.s) * SHORTER[state.tried]
        there = self.look(here.y + length[:, None, None] * d, here.start)
        before = merit(here.f, here.s, mu)
        with np.errstate(invalid="ignore", divide="ignore"):
            drop = before - merit(there.f, there.s, mu)
        inside = (there.s > (1 - TO_BOUNDARY) * here.s).all(axis=(1, 2))
        taken = inside & (drop >= -ARMIJO * length * fall - 1e-14 * np.abs(before))
        there = there.but(np.flatnonzero(~taken), here)
        over = taken | (state.tried == len(SHORTER) - 1)
        gain = np.minimum(np.where(taken, drop, np.where(over, 0.0, np.inf)), -fall)
        ideal = mu[:, None, None] / there.s
        z = np.clip(
            state.z + to_boundary(dz, state.z)[:, None, None] * dz, 1e-10 * ideal, 1e10 * ideal
        )
        return _State(
            there,
            np.where(over[:, None, None], z, state.z),
            np.where(over, mu, state.mu),
            np.where(
                over,
                next_bounds(mu, gain, -fall, floor, self.barrier, self.x.shape[1]),
                state.bounds,
            ),
            np.where(over, 0, state.tried + 1),
            (mu * here.s[0].size <= accuracy) & (gain <= accuracy),
        )

    def _direction(self, state: _State) -> tuple[Array, Array, Array, Array, Array]:
        """Barriers (b,), steps of variables (b, k, d), slacks and multipliers (b, k, c), and slopes (b,) along them."""
        here, z, w = state.point, state.z, state.z / state.point.s
        curved = np.einsum("bkc,bkcij->bkij", z[..., : here.C.shape[2]], here.C)
        own = here.own - curved + np.swapaxes(here.G * w[..., None], -1, -2) @ here.G
        inward = ((1.0 / here.s)[..., None, :] @ here.G)[..., 0, :]
        outright, centring = direction(
            own, here.joint, np.stack([here.g, -inward]), state.mu < LATE
        )
        mu = np.clip(reachable(here.s, z, here.along(outright), shortened(outright)), *state.bounds)
        each = mu[:, None, None]
        slope, d = here.g - each * inward, outright + each * centring
        d *= shortened(d)
        ds = here.along(d)
        return mu, d, ds, each / here.s - z - w * ds, (slope * d).sum(axis=(1, 2))


def _with_walls(slack: Array, y: Array) -> Array:
    """Slacks (b, k, c) of the constraints, then those of the bounds of y (b, k, d)."""
    return np.concatenate([slack, y, 1.0 - y], axis=-1)
