"""Constrained descent of many starts at once: a primal-dual interior-point method with quasi-Newton steps.

Each start is a group of k experiments that move together: ``min f(x)`` subject to slacks ``s_i(x) >= 0``, the bounds
included. Iterates stay strictly inside. With multipliers z and barrier mu a step solves

    (H + sum_i (z_i/s_i) g_i g_i') dx = -(grad f - sum_i (mu/s_i) g_i),   dz = mu/s - z - (z/s) g' dx,

where g_i is the gradient of the slack s_i and H approximates the Hessian of the Lagrangian (damped BFGS; Nocedal and
Wright, Numerical Optimization, 2nd ed., Procedure 18.2 and Chapter 19). As each slack belongs to one experiment, the
sum is block-diagonal. All starts take their steps in the same few array operations.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from edtk.design.pose_design import Experiments, PoseDesign

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
Objective = Callable[[Experiments, Indices], tuple[Array, Array]]
MARGIN = 1e-3  # of a start to its constraints [m, rad], and to its bounds in parts of their range
TO_BOUNDARY = 0.995  # share of the way to a constraint that one step may go
LONGEST = 0.3  # step of a variable, in parts of its range
ARMIJO = 1e-4
TRIALS = 20  # of one step, each shorter than the one before


def descend(
    design: PoseDesign,
    x: Array,
    objective: Objective,
    iterations: int = 200,
    accuracy: float = 1e-7,
    barrier: float = 0.01,
    stop: Callable[[], bool] = lambda: False,
) -> Array:
    """Design variables from which no way leads further down, as far as the steps can tell.

    Args:
        design: Feasible set and movable variables.
        x: Starts (b, k, v): b groups of k experiments each. One that lies outside, or on a bound, is pushed inside
            first; where that fails, it stays as it is.
        objective: Values (b',) and gradients (b', k, v) at experiments (b', k), given the indices (b',) of their
            starts; a value may be inf. Values should be of order one, as the accuracy is absolute.
        iterations: Limit on steps.
        accuracy: On the objective: what slope and constraints still hold back when a start is done.
        barrier: Weight mu of the logarithmic barrier at the beginning.
        stop: Asked before each step whether to end early.

    Returns:
        Design variables (b, k, v), never worse than a feasible start, and feasible where the start was or could be
        pushed inside.
    """
    answer = np.array(x)
    if not design.movable or not len(x):
        return answer
    path = _Path(design, objective, inward(design, answer))
    feasible = np.flatnonzero(design.at(answer).feasible.all(axis=1))
    least = np.full(len(x), np.inf)
    if len(feasible):
        least[feasible] = objective(design.at(answer[feasible]), feasible)[0]
    state = path.begin(barrier)
    floor = 0.1 * accuracy / max(1, state.s[:1].size)
    for taken in range(iterations + 1):
        better = np.flatnonzero(state.f < least[state.start])
        won = state.start[better]
        answer[won], least[won] = path.variables(state.y[better], won), state.f[better]
        state = state[np.flatnonzero(state.calm < 2)]
        if not len(state.f) or taken == iterations or stop():
            break
        state = path.step(state, floor, accuracy)
    return answer


def inward(design: PoseDesign, x: Array) -> Array:
    """Experiments (..., v) moved off bounds and constraints by Gauss-Newton steps; those already inside stay."""
    x, move = np.array(x), design.movable
    lower, upper = design.limits[:, move]
    edge = MARGIN * (upper - lower)
    for _ in range(10):
        x[..., move] = np.clip(x[..., move], lower + edge, upper - edge)
        here = design.at(x)
        short = np.maximum(MARGIN - here.slack, 0.0)
        if not short.any():
            break
        G = here.slack_gradient[..., move] * (short > 0)[..., None]
        K = G @ np.swapaxes(G, -1, -2) + 1e-9 * np.eye(G.shape[-2])
        x[..., move] += (np.swapaxes(G, -1, -2) @ np.linalg.solve(K, 1.5 * short[..., None]))[..., 0]
    return x


@dataclass(frozen=True, eq=False)
class _State:
    """Where the starts are that are still on their way, strictly inside.

    Attributes:
        start: Which start each is (b,).
        y: Movable variables in parts of their range (b, k, d).
        f: Values (b,).
        g: Gradients (b, k, d) by y.
        s: Slacks (b, k, c).
        G: Their gradients (b, k, c, d).
        z: Multipliers (b, k, c).
        mu: Barriers (b,).
        H: Approximate Hessians (b, n, n), n = k d; zero before the first step.
        calm: For how many steps (b,) next to nothing was left to gain.
    """

    start: Indices
    y: Array
    f: Array
    g: Array
    s: Array
    G: Array
    z: Array
    mu: Array
    H: Array
    calm: Indices

    def __getitem__(self, chosen: Indices) -> "_State":
        """Some of the starts; itself if all."""
        if len(chosen) == len(self.f):
            return self
        return _State(*(getattr(self, f.name)[chosen] for f in fields(self)))


class _Path:
    """The way down from a number of starts (b, k, v)."""

    def __init__(self, design: PoseDesign, objective: Objective, x: Array) -> None:
        self.design, self.objective, self.x = design, objective, x
        self.move = design.movable
        self.lower, self.upper = design.limits[:, self.move]
        self.span = self.upper - self.lower
        self.walls = np.concatenate([np.eye(len(self.move)), -np.eye(len(self.move))])

    def variables(self, y: Array, start: Indices) -> Array:
        """Design variables (b, k, v) within the bounds."""
        x = self.x[start]
        x[..., self.move] = np.clip(self.lower + self.span * y, self.lower, self.upper)
        return x

    def look(self, y: Array, start: Indices) -> tuple[Array, Array, Array, Array]:
        """Value, gradient, slacks and their gradients at y (b, k, d)."""
        here = self.design.at(self.variables(y, start))
        f, g = self.objective(here, start)
        s = np.concatenate([here.slack, y, 1.0 - y], axis=-1)
        G = here.slack_gradient[..., self.move] * self.span
        walls = np.broadcast_to(self.walls, (*G.shape[:-2], *self.walls.shape))
        return f, g[..., self.move] * self.span, s, np.concatenate([G, walls], axis=-2)

    def begin(self, barrier: float) -> _State:
        """All starts that are strictly inside and of finite value."""
        y = (self.x[..., self.move] - self.lower) / self.span
        start = np.arange(len(y))
        f, g, s, G = self.look(y, start)
        inside = np.flatnonzero(np.isfinite(f) & (s > 0).all(axis=(1, 2)))
        mu, size = np.full(len(y), barrier), y[0].size
        with np.errstate(divide="ignore"):
            z = mu[:, None, None] / s
        state = _State(start, y, f, g, s, G, z, mu, np.zeros((len(y), size, size)), np.zeros(len(y), dtype=int))
        return state[inside]

    def step(self, state: _State, floor: float, accuracy: float) -> _State:
        """One step of every start."""
        mu, z, s, G = _lowered(state, floor), state.z, state.s, state.G
        w = z / s
        slope = state.g - np.einsum("bkc,bkcd->bkd", mu[:, None, None] / s, G)
        d = _solve(state.H, w, G, slope)
        d *= np.minimum(1.0, LONGEST / np.maximum(np.abs(d).max(axis=(1, 2)), 1e-300))[:, None, None]
        fall = np.einsum("bkd,bkd->b", slope, d)
        toward = np.einsum("bkcd,bkd->bkc", G, d)
        dz = mu[:, None, None] / s - z - w * toward
        following, moved = self._search(state, mu, d, fall, _to_boundary(toward, s))
        moved &= -fall > 1e-15 * np.abs(state.f)  # what is lost in rounding is no way down
        z = z + _to_boundary(dz, z)[:, None, None] * dz
        ideal = mu[:, None, None] / following.s
        z = np.clip(z, 1e-10 * ideal, 1e10 * ideal)
        H = _updated(state, following, z)
        H[~moved] = 0.0
        still = (mu <= floor) & ((-fall <= accuracy) | ~moved)
        calm = np.where(still, state.calm + 1, 0)
        return replace(following, z=z, H=H, calm=calm, mu=np.where(moved, mu, np.maximum(floor, 0.1 * mu)))

    def _search(
        self, state: _State, mu: Array, d: Array, fall: Array, length: Array
    ) -> tuple[_State, NDArray[np.bool_]]:
        """The longest of some steps that lowers the barrier function enough, and whether there was one."""
        y, f, g, s, G = (np.array(a) for a in (state.y, state.f, state.g, state.s, state.G))
        merit = state.f - mu * np.log(state.s).sum(axis=(1, 2))
        left = np.arange(len(f))
        for trial in range(TRIALS):
            there = state.y[left] + length[left, None, None] * d[left]
            found = self.look(there, state.start[left])
            with np.errstate(invalid="ignore", divide="ignore"):
                reached = found[0] - mu[left] * np.log(found[2]).sum(axis=(1, 2))
                enough = merit[left] + ARMIJO * length[left] * fall[left] + 1e-14 * np.abs(merit[left])
                good = (found[2] > (1 - TO_BOUNDARY) * state.s[left]).all(axis=(1, 2)) & (reached <= enough)
            for whole, part in zip((y, f, g, s, G), (there, *found), strict=True):
                whole[left[good]] = part[good]
            left = left[~good]
            if not len(left):
                break
            length[left] *= 0.5 if trial < 3 else 0.2
        moved = np.ones(len(f), dtype=bool)
        moved[left] = False
        return replace(state, y=y, f=f, g=g, s=s, G=G), moved


def _lowered(state: _State, floor: float) -> Array:
    """Barriers (b,), lowered where slope and complementarity are down to their size."""
    mu = state.mu
    slope = np.abs(state.g - np.einsum("bkc,bkcd->bkd", state.z, state.G)).max(axis=(1, 2))
    for _ in range(3):
        error = np.maximum(slope, np.abs(state.s * state.z - mu[:, None, None]).max(axis=(1, 2)))
        mu = np.where(error <= 10 * mu, np.maximum(floor, np.minimum(0.2 * mu, mu**1.5)), mu)
    return mu


def _to_boundary(change: Array, x: Array) -> Array:
    """Lengths (b,), at most one, at which positive x (b, k, c) stays positive."""
    return np.minimum(1.0, TO_BOUNDARY / np.maximum((-change / x).max(axis=(1, 2)), 1e-300))


def _solve(H: Array, w: Array, G: Array, slope: Array) -> Array:
    """Steps (b, k, d) of ``(H + sum w g g') dy = -slope``; a start without H takes the identity for it."""
    b, k, d = slope.shape
    K = H.copy()
    K[np.flatnonzero(~H.any(axis=(1, 2)))] = np.eye(k * d)
    each = np.arange(k)
    K.reshape(b, k, d, k, d)[:, each, :, each] += np.swapaxes(np.swapaxes(G * w[..., None], -1, -2) @ G, 0, 1)
    K += 1e-12 * np.diagonal(K, axis1=1, axis2=2).max(axis=1)[:, None, None] * np.eye(k * d)
    return np.asarray(np.linalg.solve(K, -slope.reshape(b, -1, 1)).reshape(b, k, d))


def _updated(state: _State, following: _State, z: Array) -> Array:
    """Damped BFGS: Hessians (b, n, n) of the Lagrangian with multipliers z, after the step between the two."""
    b = len(state.f)
    d = (following.y - state.y).reshape(b, -1)
    bent = np.einsum("bkc,bkcd->bkd", z, following.G - state.G)
    q = (following.g - state.g - bent).reshape(b, -1)
    curvature = (d * q).sum(axis=1)
    length = np.maximum((d * d).sum(axis=1), 1e-300)
    bend = (q * q).sum(axis=1)
    size = np.where(curvature > 0, bend / np.maximum(curvature, np.maximum(1e-6 * bend, 1e-300)), 1.0).clip(1e-3, 1e6)
    fresh = ~state.H.any(axis=(1, 2), keepdims=True)
    H = np.where(fresh, size[:, None, None] * np.eye(d.shape[1]), state.H)
    Hd = (H @ d[..., None])[..., 0]
    dHd = np.maximum((d * Hd).sum(axis=1), 1e-300)
    share = np.where(curvature < 0.2 * dHd, 0.8 * dHd / np.maximum(dHd - curvature, 1e-300), 1.0)
    r = share[:, None] * q + (1 - share)[:, None] * Hd
    dr = np.maximum((d * r).sum(axis=1), 1e-300)
    some = (length > 1e-24) & (np.minimum(dHd, dr) > 1e-12 * length)
    down = np.where(some, 1 / dHd, 0.0)[:, None, None] * Hd[:, :, None] * Hd[:, None]
    up = np.where(some, 1 / dr, 0.0)[:, None, None] * r[:, :, None] * r[:, None]
    return H - down + up
