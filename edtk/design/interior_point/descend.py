"""Constrained descent of many starts at once: a primal-dual interior-point method.

Each start is a group of k experiments that move together: ``min f(x)`` subject to slacks
``s_i(x) >= 0``, the bounds included. Iterates stay strictly inside. A step solves the primal-dual
equations (Nocedal and Wright, Numerical Optimization, 2nd ed., Chapter 19), whose matrix is
block-diagonal but for the objective, as each slack belongs to one experiment. The weight mu of the
barrier follows from what the step without it could reach (a rule of Mehrotra's; Nocedal, Waechter
and Waltz, Adaptive barrier update strategies, SIAM J. Optim. 19, 2009). All starts take their steps
in the same few array operations.
"""

from collections.abc import Iterator

import numpy as np

from edtk.design.design_space import Space
from edtk.design.interior_point.held import holding
from edtk.design.interior_point.objective import Objective
from edtk.design.interior_point.step import Landscape, Point, ScaledVariables, State, step
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

# An interior-point method cannot start on a constraint, where the barrier is infinite. Starts keep
# this distance from constraints [m, rad], and from bounds in parts of their range.
MARGIN_OF_START = 1e-3
# Gauss-Newton steps; two or three are the rule, and a pose that needs more is lost.
FEASIBLE_ROUNDS = 10
OVERSHOOT = 1.5  # of the step to a constraint, so that a curved one is passed in few rounds
STEP_RIDGE = 1e-9  # keeps the steps finite where gradients of violated constraints are dependent
# The least barrier holds the objective back by at most this part of the accuracy.
SPARE = 0.1


def inward(space: Space, x: Array) -> Array:
    """Move experiments off bounds and constraints; those already inside stay as they are.

    Each round solves ``G dx = 1.5 (margin - s)`` for the slacks s that are below the margin, with
    the gradients G of these slacks, by the shortest dx: a Gauss-Newton step on the violation.

    Args:
        space: Feasible set and movable variables.
        x: Design variables (..., v).

    Returns:
        Design variables (..., v) of which some may still be outside.
    """
    moved = np.array(x).reshape(-1, x.shape[-1])
    move = space.movable
    lower, upper = space.limits[:, move]
    edge = MARGIN_OF_START * (upper - lower)
    left = np.arange(len(moved))
    for _ in range(FEASIBLE_ROUNDS):
        own = moved[left]
        own[:, move] = np.clip(own[:, move], lower + edge, upper - edge)
        moved[left] = own
        short = np.maximum(MARGIN_OF_START - space.at(own).slack, 0.0)
        outside = np.flatnonzero(short.any(axis=-1))
        if not len(outside):
            break
        left, own, short = left[outside], own[outside], short[outside]
        G = space.at(own).slack_gradient[..., move] * (short > 0)[..., None]
        transposed = np.swapaxes(G, -1, -2)
        K = G @ transposed + STEP_RIDGE * np.eye(G.shape[-2])
        pushes = np.linalg.solve(K, OVERSHOOT * short[..., None])
        own[:, move] += (transposed @ pushes)[..., 0]
        moved[left] = own
    return moved.reshape(x.shape)


def descend(
    space: Space,
    x: Array,
    objective: Objective,
    iterations: int = 200,
    accuracy: float = 1e-7,
    barrier: float = 0.03,
) -> Array:
    """Find design variables from which no way leads further down, as far as the steps can tell.

    When the time is over (`time_limit`), the best so far are the answer.

    Args:
        space: Feasible set and movable variables.
        x: Starts (b, k, v): b groups of k experiments each. One that lies outside, or on a bound,
            is pushed inside first; where that fails, it stays as it is.
        objective: The function to minimise.
        iterations: Limit on steps that are tried.
        accuracy: A start is done when a step promises less, and the barrier holds back less.
        barrier: Weight mu of the barrier at the beginning, of all k experiments together.

    Returns:
        Design variables (b, k, v), never worse than a feasible start, and feasible where the start
        was or could be pushed inside.
    """
    if not space.movable or not len(x):
        return np.array(x)
    held, starts = holding(space, np.array(x))
    found = _descended(held, starts, objective, iterations, accuracy, barrier)
    return found[..., : x.shape[-1]]


def _descended(
    space: Space,
    answer: Array,
    objective: Objective,
    iterations: int,
    accuracy: float,
    barrier: float,
) -> Array:
    """The same of starts (b, k, v) that are overwritten, where nothing switches."""
    inside = inward(space, answer)
    least = _values_of_moved(space, objective, answer, inside)
    variables = ScaledVariables(space, inside)
    landscape = Landscape(variables, objective)
    first = State.first(landscape.point(variables.begin(), np.arange(len(answer))), barrier)
    for here in _points(first, landscape, iterations, accuracy, barrier):
        better = np.flatnonzero(here.value < least[here.start])
        won = here.start[better]
        answer[won] = variables.design(here.y[better], won)
        least[won] = here.value[better]
    return answer


def _points(
    state: State,
    landscape: Landscape,
    iterations: int,
    accuracy: float,
    barrier: float,
) -> Iterator[Point]:
    """The points that the starts come to, one after each step, until all are done."""
    slacks = state.point.slack[:1].size
    floor = SPARE * accuracy / max(1, slacks)
    for _ in range(iterations):
        yield state.point
        state = state.going_on()
        if not len(state) or out_of_time():
            return
        state = step(state, landscape, barrier, floor, accuracy)
    yield state.point


def _values_of_moved(space: Space, objective: Objective, x: Array, inside: Array) -> Array:
    """Values (b,) that an answer must beat: those of feasible starts that had to be moved inside.

    All others are inf: a start that was not moved is the first iterate, and an infeasible one is
    worse than any point inside.
    """
    least = np.full(len(x), np.inf)
    moved = np.flatnonzero((inside != x).any(axis=(1, 2)))
    if len(moved):
        before = space.at(x[moved])
        feasible = before.feasible.all(axis=1)
        least[moved] = np.where(feasible, objective.value(before, moved), np.inf)
    return least
