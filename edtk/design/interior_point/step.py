"""One step of every start: tried at a length, and taken where it lowers the barrier function."""

from collections.abc import Callable

import numpy as np

from edtk.design.interior_point.barrier import TO_BOUNDARY, merit, next_bounds, to_boundary
from edtk.design.interior_point.point import Point
from edtk.design.interior_point.search_direction import SearchDirection, search_direction
from edtk.design.interior_point.state import State
from edtk.system.typing import Array, Indices, Mask

# Share of the decrease along the slope that a step must bring (Nocedal and Wright, Eq. 3.4).
ARMIJO = 1e-4
ROUNDING = 1e-14  # of the barrier function, relative: an increase by less is no increase
# Parts of a step that are tried in turn. Halving alone would take twenty tries where the model is
# wrong by orders of magnitude; such starts are few, and all others wait for none of them.
SHORTER = np.array([1.0, 0.5, 0.25, 0.125, 0.025, 5e-3, 1e-3, 1e-4, 1e-6])
# Factor by which s z may differ from mu: multipliers that have lost touch with their slacks would
# spoil the next Hessian (Waechter and Biegler, Math. Program. 106, 2006, Eq. 16).
APART = 1e10


def step(
    state: State,
    look: Callable[[Array, Indices], Point],
    barrier: float,
    floor: float,
    accuracy: float,
) -> State:
    """Try one step of every start; a start whose step fails tries a shorter one the next time.

    Starts do not wait for each other's line searches: each call evaluates every start once.

    Args:
        state: Where the starts are.
        look: Evaluates movable variables (b, k, d) of starts (b,).
        barrier: Weight of the barrier at the beginning, of all experiments together.
        floor: Least weight of the barrier.
        accuracy: On the objective, see `descend`.
    """
    here = state.point
    direction = search_direction(state)
    length = to_boundary(direction.ds, here.slack) * SHORTER[state.tried]
    there = look(here.y + length[:, None, None] * direction.dy, here.start)
    drop, taken = _compare(here, there, direction, length)
    there = there.with_starts_of(here, np.flatnonzero(~taken))
    over = taken | (state.tried == len(SHORTER) - 1)
    mu = direction.mu
    promise = -direction.slope
    # A step of which shorter parts are still to be tried may gain all that it promises.
    gain = np.minimum(np.where(taken, drop, np.where(over, 0.0, np.inf)), promise)
    bounds = next_bounds(mu, gain, promise, floor, barrier, here.y.shape[1])
    z = _multipliers(state.z, direction.dz, mu, there.slack)
    return State(
        point=there,
        z=np.where(over[:, None, None], z, state.z),
        mu=np.where(over, mu, state.mu),
        bounds=np.where(over, bounds, state.bounds),
        tried=np.where(over, 0, state.tried + 1),
        # mu times the number of slacks is how far the barrier holds the objective from its minimum.
        done=(mu * here.slack[0].size <= accuracy) & (gain <= accuracy),
    )


def _compare(
    here: Point, there: Point, direction: SearchDirection, length: Array
) -> tuple[Array, Mask]:
    """By how much steps lower the barrier function, and whether they are taken (b,) each.

    Args:
        here: Where the steps begin.
        there: Where they lead.
        direction: The whole steps.
        length: The parts (b,) of them that were tried.
    """
    mu = direction.mu
    before = merit(here.value, here.slack, mu)
    with np.errstate(invalid="ignore", divide="ignore"):  # outside, where the step is not taken
        drop = before - merit(there.value, there.slack, mu)
    # To first order the slacks keep this share of themselves; curved ones have to be compared.
    inside = (there.slack > (1 - TO_BOUNDARY) * here.slack).all(axis=(1, 2))
    enough = drop >= -ARMIJO * length * direction.slope - ROUNDING * np.abs(before)
    return drop, inside & enough


def _multipliers(z: Array, dz: Array, mu: Array, s: Array) -> Array:
    """Multipliers (b, k, c) after a step, positive and in touch with ``mu/s``."""
    central = mu[:, None, None] / s
    moved = z + to_boundary(dz, z)[:, None, None] * dz
    return np.clip(moved, 1 / APART * central, APART * central)
