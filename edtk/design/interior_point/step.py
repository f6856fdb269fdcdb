"""One step of every start: its direction, its length, and where it leads.

Shapes: b starts, k experiments each, c slacks of an experiment. Each of the c slacks s > 0 has a
multiplier z > 0, and ``s z = mu`` on the central path.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import TINY, eigenpairs
from criteria.linalg.spectrum import conjugate
from edtk.design.design_space import Space
from edtk.design.interior_point.objective import Neighbourhood, Objective
from edtk.system.typing import Array, Indices, Mask

# Share of the way to a constraint that one step may go: tau of Nocedal and Wright, Eq. (19.9),
# with the value that they propose.
TO_BOUNDARY = 0.995
# Share of a slack that has to be left after a step: half of what its length leaves to second order.
LEFT = 0.5 * (1 - TO_BOUNDARY)
# Longest step of a variable, in parts of its range: beyond, a quadratic model of robot poses says
# nothing, as an angle has turned by a radian.
LONGEST = 0.3
# Least factor on mu from one step to the next: faster, iterates end at a wall far from the optimum.
LOWER = 0.1
# Part of a step's promise, an experiment, below which the next mu does not fall: while a step
# promises much, the start is far from its end, and an almost absent barrier lets it run into walls.
LEAST_FRACTION = 0.01
# Share of a step's promise below which the start creeps along a wall. Its steps are cut short by
# slacks that are almost zero; a higher barrier pushes it off the wall.
CREEPING = 0.03
# Gain of a step in vain: none of its lengths lowered the barrier function.
NO_GAIN = 1e-12
# Order of a matrix beyond which its eigenvalues would take longer than many steps.
LARGE_MATRIX = 200
# Size to which a small or negative eigenvalue is raised. The variables are parts of their range and
# objectives have order one, so that less curvature than this says nothing about a whole range.
LEAST_CURVATURE = 1e-3
# Added to the diagonal, relative to its largest entry: a singular matrix can then be factorised.
FACTOR_RIDGE = 1e-12
# Weight of the barrier below which a start is near its end: the eigenvalues of its whole Hessian
# are then worth their price, as a saddle would hold it up for good. Of many variables that price is
# most of a step's, and is paid later: plans of twelve experiments became no worse.
LATE = 1e-4
LATE_OF_MANY = 1e-5
MANY_VARIABLES = 36
# Share of the decrease along the slope that a step must bring (Nocedal and Wright, Eq. 3.4).
ARMIJO = 1e-4
ROUNDING_OF_BARRIER = 1e-14  # of the barrier function, relative: an increase by less is no increase
# Factor by which s z may differ from mu: multipliers that have lost touch with their slacks would
# spoil the next Hessian (Waechter and Biegler, Math. Program. 106, 2006, Eq. 16).
OUT_OF_TOUCH = 1e10


@dataclass(frozen=True, eq=False)
class ScaledVariables:
    """The map between design variables x and movable variables y in [0, 1], for some starts.

    In parts of their range, angles, lengths and forces count alike.

    Args:
        space: Says which variables may move, and how far.
        x: Starts (n, k, v); the variables that do not move keep these values.
    """

    space: Space
    x: Array

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper bounds (2, d) of the movable variables."""
        return self.space.limits[:, self.space.movable]

    @cached_property
    def bound_slopes(self) -> Array:
        """Gradients (2d, d) of the slacks ``y`` and ``1 - y`` of the bounds."""
        eye = np.eye(len(self.space.movable))
        return np.concatenate([eye, -eye])

    def begin(self) -> Array:
        """The starts as movable variables (n, k, d)."""
        lower, upper = self.bounds
        return np.asarray((self.x[..., self.space.movable] - lower) / (upper - lower))

    def design(self, y: Array, start: Indices) -> Array:
        """Design variables (b, k, v) within the bounds.

        Args:
            y: Movable variables (b, k, d).
            start: Indices (b,) of the starts that they belong to.
        """
        lower, upper = self.bounds
        x = self.x[start]
        # Rounding may carry a variable over its bound by a last digit.
        x[..., self.space.movable] = np.clip(lower + (upper - lower) * y, lower, upper)
        return x


def merit(f: Array, s: Array, mu: Array) -> Array:
    """Barrier function ``f - mu sum log s`` (b,), which steps lower.

    Args:
        f: Values (b,).
        s: Slacks (b, k, c).
        mu: Weights (b,).
    """
    return np.asarray(f - mu * np.log(s).sum(axis=(1, 2)))


def to_boundary(change: Array, x: Array, bend: Array | float = 0.0) -> Array:
    """Lengths (b,), at most one, at which positive ``x + a change + a^2 bend/2`` stay positive.

    The largest a at which each is ``(1 - tau) x`` or more, Eq. (19.9) of Nocedal and Wright. One
    comes to that at ``a = 2 tau x / (root - change)`` with ``root^2 = change^2 - 2 tau x bend``, in
    which nothing cancels where it falls at first; never without a root, or where that is behind.

    Args:
        change: First derivatives (b, k, c) along the step.
        x: Positive numbers (b, k, c).
        bend: Second derivatives (b, k, c).
    """
    room = 2 * TO_BOUNDARY * x
    square = change**2 - room * bend
    below = np.where(square >= 0, np.sqrt(np.maximum(square, 0.0)) - change, 0.0)
    return np.asarray((room / np.maximum(below, TINY)).min(axis=(1, 2), initial=1.0))


def shortened(d: Array) -> Array:
    """Factors (b, 1, 1) that make no step of the variables d (b, k, d) longer than the longest."""
    longest = np.abs(d).max(axis=(1, 2), keepdims=True)
    return np.minimum(1.0, LONGEST / np.maximum(longest, TINY))


def reachable(s: Array, z: Array, ds: Array, short: Array) -> Array:
    """Means (b,) of ``s z`` where a step without a barrier would lead, up to the constraints.

    Where the step is free to go the mean is small, and so may mu be: the predictor of Mehrotra's
    rule.

    Args:
        s: Slacks (b, k, c).
        z: Multipliers (b, k, c).
        ds: Changes of the slacks (b, k, c) by the step.
        short: Largest part of the step that is taken (b, 1, 1).
    """
    dz = -z - z / s * ds
    s = s + np.minimum(short, to_boundary(ds, s)[:, None, None]) * ds
    z = z + np.minimum(short, to_boundary(dz, z)[:, None, None]) * dz
    return np.asarray((s * z).mean(axis=(1, 2)))


def next_bounds(
    mu: Array, gain: Array, promise: Array, floor: float, first: float, k: int
) -> Array:
    """Bounds (2, b) between which the next mu is chosen.

    After a good step mu may take any value from a tenth of itself up to the first one. After a
    step that crept it is raised tenfold at least. After a step in vain it is lowered: the barrier
    function has no lower value nearby, so that the start is at its minimum for this mu.

    Args:
        mu: The last ones (b,).
        gain: By how much the last steps lowered the barrier function (b,).
        promise: By how much they would have lowered it along their initial slope (b,).
        floor: The least mu of all.
        first: The mu at the beginning, of all experiments together.
        k: Number of experiments.
    """
    failed = gain <= NO_GAIN
    creeping = gain < CREEPING * promise
    most = first / k
    lower = np.maximum(np.maximum(floor, LOWER * mu), LEAST_FRACTION * promise / k)
    higher = np.minimum(most, mu / LOWER)
    return np.stack([np.where(creeping & ~failed, higher, lower), np.where(failed, lower, most)])


def newton_direction(own: Array, joint: Array, slope: Array, late: Mask) -> Array:
    """Solve ``K d = -slope``, with K changed where it is not positive definite.

    A step leads down only if K is positive definite. Negative eigenvalues have their signs changed,
    so that a direction of negative curvature is followed down its slope (Nocedal and Wright,
    Numerical Optimization, 2nd ed., Section 3.4). At first this is done to the small blocks of each
    experiment, which is cheap and enough while the joint part is positive semidefinite. Near the
    end it is done to all of K, so that no start is held up at a saddle of the whole, unless K is
    large.

    Args:
        own: Blocks (b, k, d, d) of the Hessian K, one for each experiment.
        joint: The rest of the Hessian (b, kd, kd), to which the blocks are added.
        slope: Slopes (..., b, k, d).
        late: Mask (b,) of the starts that are near their end.

    Returns:
        Steps (..., b, k, d).
    """
    K = _sum(own, joint)
    indefinite = ~_positive_definite(K)
    whole = late & (K.shape[-1] <= LARGE_MATRIX)
    early = np.flatnonzero(indefinite & ~whole)
    if len(early):
        K[early] = _sum(_positive_blocks(own[early]), joint[early])
    saddle = np.flatnonzero(indefinite & whole)
    if len(saddle):
        K[saddle] = _positive(K[saddle])
    b, order = K.shape[:2]
    right = -slope.reshape(-1, b, order).transpose(1, 2, 0)
    return np.asarray(np.linalg.solve(K, right).transpose(2, 0, 1).reshape(slope.shape))


def _sum(own: Array, joint: Array) -> Array:
    """Matrices (b, kd, kd): joint ones with own blocks (b, k, d, d) added on their diagonal."""
    b, k, d, _ = own.shape
    K = joint.copy()
    each = np.arange(k)
    K.reshape(b, k, d, k, d)[:, each, :, each] += np.swapaxes(own, 0, 1)
    K += FACTOR_RIDGE * np.diagonal(K, axis1=1, axis2=2).max(axis=1)[:, None, None] * np.eye(k * d)
    return K


def _positive_definite(K: Array) -> Mask:
    """Whether each matrix (b, n, n) is positive definite.

    NumPy's Cholesky factorisation of a stack fails as a whole and does not say where. LAPACK's own
    says it of each matrix, in a tenth of the time of halving the stack until the matrix is found.
    """
    from scipy.linalg.lapack import dpotrf

    # The transpose has the order of Fortran, and is the same matrix.
    return np.array([dpotrf(matrix.T)[1] == 0 for matrix in K], dtype=bool)


def _positive(K: Array) -> Array:
    """Matrices (..., n, n) with negative eigenvalues made positive and small ones raised.

    Beside much larger ones, as a start has them where it is all but singular, small ones would be
    lost in rounding.
    """
    e, V = eigenpairs(K)
    size = np.abs(e)
    least = np.maximum(LEAST_CURVATURE, FACTOR_RIDGE * size.max(axis=-1, keepdims=True))
    return conjugate(V, np.where(e < least, np.maximum(size, least), e))


def _positive_blocks(K: Array) -> Array:
    """The same of many small matrices (b, k, n, n), most of which are positive already."""
    changed = np.array(K)
    low = ~_above(K, LEAST_CURVATURE)
    changed[low] = _positive(K[low])
    return changed


def _above(K: Array, least: float) -> Mask:
    """Whether all eigenvalues of small matrices (..., n, n) are larger: ``K - least I`` has pivots.

    The elimination of all matrices at once takes a twentieth of the time of their eigenvalues.
    """
    n = K.shape[-1]
    # Always a copy: of a single matrix the moved axes are contiguous already.
    S = np.array(np.moveaxis(K, (-2, -1), (0, 1)), order="C")
    S[np.arange(n), np.arange(n)] -= least
    above = np.ones(K.shape[:-2], dtype=bool)
    for i in range(n):
        above &= S[i, i] > 0
        # What is not positive definite goes no further: it would overflow.
        row = np.where(above, S[i, i + 1 :] / np.where(above, S[i, i], 1.0), 0.0)
        S[i + 1 :, i + 1 :] -= S[i, i + 1 :, None] * row
    return above


@dataclass(frozen=True, eq=False)
class Point:
    """Value, slacks and derivatives at the b starts that are still on their way.

    Derivatives are by the movable variables y in parts of their range.

    Attributes:
        start: Indices (b,) of the starts.
        y: Movable variables (b, k, d).
        value: Values (b,) of the objective f.
        slope: Slopes (b, k, d) of the objective.
        own: Second derivatives (b, k, d, d) of the objective by the variables of one experiment.
        joint: Second derivatives (b, kd, kd) by those of all, to which `own` is added.
        slack: Slacks s (b, k, c); those of the bounds ``0 <= y <= 1`` are the last 2d.
        slack_slope: Gradients G (b, k, c, d) of the slacks.
        slack_curvature: Second derivatives (b, k, c - 2d, d, d) of the slacks that are not linear.
    """

    start: Indices
    y: Array
    value: Array
    slope: Array
    own: Array
    joint: Array
    slack: Array
    slack_slope: Array
    slack_curvature: Array

    def __getitem__(self, chosen: Indices) -> "Point":
        """The chosen starts."""
        return Point(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @property
    def inside(self) -> Indices:
        """Positions of the starts whose value is finite and whose slacks are all positive."""
        return np.flatnonzero(np.isfinite(self.value) & (self.slack > 0).all(axis=(1, 2)))

    def slack_change(self, d: Array) -> Array:
        """Changes ``G d`` (b, k, c) of the slacks by steps d (b, k, d), to first order."""
        return np.asarray((self.slack_slope @ d[..., None])[..., 0])

    def with_starts_of(self, other: "Point", chosen: Indices) -> "Point":
        """The same with other starts (c,) in the place of those that are chosen."""
        if len(chosen) == len(self.start):
            return other
        arrays = []
        for field in fields(self):
            array = np.array(getattr(self, field.name))
            array[chosen] = getattr(other, field.name)
            arrays.append(array)
        return Point(*arrays)


@dataclass(frozen=True, eq=False)
class Landscape:
    """What is seen of an objective and its constraints from a place of the variables.

    Attributes:
        variables: The variables, and where they may lie.
        objective: What is minimised.
    """

    variables: ScaledVariables
    objective: Objective

    def point(self, y: Array, start: Indices) -> Point:
        """Objective and constraints at y (b, k, d) of some starts (b,), with derivatives."""
        near = Neighbourhood(self.variables.space, self.variables.design(y, start))
        slack_slopes = near.first(near.experiments.slack_gradient)
        walls = self.variables.bound_slopes
        of_bounds = np.broadcast_to(walls, (*y.shape[:2], *walls.shape))
        local = self.objective.local(near, start)
        return Point(
            start=start,
            y=y,
            value=local.value,
            slope=local.slope,
            own=local.own,
            joint=local.joint,
            slack=np.concatenate([near.experiments.slack[0], y, 1.0 - y], axis=-1),
            slack_slope=np.concatenate([slack_slopes[0], of_bounds], axis=-2),
            slack_curvature=near.second(slack_slopes),
        )


@dataclass(frozen=True, eq=False)
class State:
    """Primal and dual variables of the b starts that are on their way, and their barriers.

    Attributes:
        point: The place, with value, slacks and derivatives.
        z: Multipliers (b, k, c) of the slacks.
        mu: Weights (b,) of the barrier in the last step.
        bounds: Bounds (2, b) of the next weights.
        tried: How many lengths of the step from here were tried in vain (b,).
        done: Mask (b,) of the starts that have next to nothing left to gain.
    """

    point: Point
    z: Array
    mu: Array
    bounds: Array
    tried: Indices
    done: Mask

    @classmethod
    def first(cls, point: Point, barrier: float) -> "State":
        """Begin at those starts of a point that are strictly inside and of finite value.

        The multipliers are those of the central path, ``z = mu/s``.

        Args:
            point: All starts.
            barrier: Weight of all experiments together; each start gets its k-th part.
        """
        n, k = point.y.shape[:2]
        mu = np.full(n, barrier / k)
        with np.errstate(divide="ignore"):  # at starts on a constraint, which are left out below
            z = mu[:, None, None] / point.slack
        state = cls(
            point=point,
            z=z,
            mu=mu,
            bounds=np.stack([LOWER * mu, mu]),
            tried=np.zeros(n, dtype=int),
            done=np.zeros(n, dtype=bool),
        )
        return state._take(point.inside)

    def __len__(self) -> int:
        return len(self.mu)

    def going_on(self) -> "State":
        """The starts that are not done."""
        return self._take(np.flatnonzero(~self.done))

    def _take(self, chosen: Indices) -> "State":
        """The chosen starts; the state itself if all are chosen, which saves copies."""
        if len(chosen) == len(self):
            return self
        return State(
            point=self.point[chosen],
            z=self.z[chosen],
            mu=self.mu[chosen],
            bounds=self.bounds[:, chosen],
            tried=self.tried[chosen],
            done=self.done[chosen],
        )


@dataclass(frozen=True, eq=False)
class SearchDirection:
    """Steps of b starts.

    Attributes:
        mu: Weights (b,) of the barrier.
        dy: Steps (b, k, d) of the movable variables.
        ds: Changes (b, k, c) of the slacks, to first order.
        dz: Steps (b, k, c) of the multipliers.
        slope: Slopes (b,) of the barrier function along dy; negative, as the steps lead down.
    """

    mu: Array
    dy: Array
    ds: Array
    dz: Array
    slope: Array


def search_direction(state: State) -> SearchDirection:
    """Solve the primal-dual equations, with the barrier that Mehrotra's rule chooses.

    With the gradients G of the slacks s, the Hessian H of the Lagrangian ``f - z's`` and
    ``W = diag(z/s)``,

        (H + G' W G) dy = -(grad f - mu G' (1/s)),    dz = mu/s - z - W G dy,

    which is Eq. (19.12) of Nocedal and Wright with the slacks eliminated. Its right-hand side is
    linear in mu, and so is ``dy = affine + mu centring``. Both are solved at once; then mu is the
    mean of ``s z`` to which the affine step alone would lead, within the bounds of the state.
    """
    here = state.point
    s = here.slack
    z = state.z
    G = here.slack_slope
    C = here.slack_curvature
    W = z / s
    # Slacks of bounds are linear, so that only the first ones bend the Lagrangian.
    bent = np.einsum("bkc,bkcij->bkij", z[..., : C.shape[2]], C)
    own = here.own - bent + np.swapaxes(G * W[..., None], -1, -2) @ G
    inwards = ((1.0 / s)[..., None, :] @ G)[..., 0, :]
    right = np.stack([here.slope, -inwards])
    late = LATE_OF_MANY if here.joint.shape[-1] > MANY_VARIABLES else LATE
    affine, centring = newton_direction(own, here.joint, right, state.mu < late)
    predicted = reachable(s, z, here.slack_change(affine), shortened(affine))
    mu = np.clip(predicted, *state.bounds)
    each = mu[:, None, None]
    slope = here.slope - each * inwards
    dy = affine + each * centring
    dy *= shortened(dy)
    ds = here.slack_change(dy)
    dz = each / s - z - W * ds
    return SearchDirection(mu, dy, ds, dz, (slope * dy).sum(axis=(1, 2)))


# Parts of a step that are tried in turn. Halving alone would take twenty tries where the model is
# wrong by orders of magnitude; such starts are few, and all others wait for none of them.
SHORTER = np.array([1.0, 0.5, 0.25, 0.125, 0.025, 5e-3, 1e-3, 1e-4, 1e-6])


def step(
    state: State,
    landscape: Landscape,
    barrier: float,
    floor: float,
    accuracy: float,
) -> State:
    """Try one step of every start; a start whose step fails tries a shorter one the next time.

    Starts do not wait for each other's line searches: each call evaluates every start once.

    Args:
        state: Where the starts are.
        landscape: Tells what is there.
        barrier: Weight of the barrier at the beginning, of all experiments together.
        floor: Least weight of the barrier.
        accuracy: On the objective, see `descend`.
    """
    here = state.point
    direction = search_direction(state)
    C = here.slack_curvature
    bend = np.zeros_like(here.slack)  # of bounds, which are the last ones
    own = (C @ direction.dy[:, :, None, :, None])[..., 0] @ direction.dy[..., None]
    bend[..., : C.shape[2]] = own[..., 0]
    length = to_boundary(direction.ds, here.slack, bend) * SHORTER[state.tried]
    there, drop, taken = _tried(landscape, here, direction, length)
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


def _tried(
    landscape: Landscape, here: Point, direction: SearchDirection, length: Array
) -> tuple[Point, Array, Mask]:
    """Where steps lead: to where they began, unless they are taken.

    Args:
        landscape: Tells what is there.
        here: Where the steps begin.
        direction: The whole steps.
        length: The parts (b,) of them that are tried.

    Returns:
        The point, by how much steps lower the barrier function (b,), and which are taken (b,).
    """
    y = here.y + length[:, None, None] * direction.dy
    there = landscape.point(y, here.start)
    # To second order slacks keep this share of themselves; what else bends has to be compared.
    inside = np.flatnonzero((there.slack > LEFT * here.slack).all(axis=(1, 2)))
    drop = np.full(len(y), -np.inf)
    before = merit(here.value, here.slack, direction.mu)
    after = merit(there.value[inside], there.slack[inside], direction.mu[inside])
    drop[inside] = before[inside] - after
    taken = drop >= -ARMIJO * length * direction.slope - ROUNDING_OF_BARRIER * np.abs(before)
    own = np.flatnonzero(taken)
    return here.with_starts_of(there[own], own), drop, taken


def _multipliers(z: Array, dz: Array, mu: Array, s: Array) -> Array:
    """Multipliers (b, k, c) after a step, positive and in touch with ``mu/s``."""
    central = mu[:, None, None] / s
    moved = z + to_boundary(dz, z)[:, None, None] * dz
    return np.clip(moved, 1 / OUT_OF_TOUCH * central, OUT_OF_TOUCH * central)
