"""What poses of a robot tell, and its constraints, as polynomials in the joints.

Every vector of a chain is affine in ``(1, cos x_j, sin x_j)`` of each joint that turns and in
``(1, x_j)`` of each that slides. So are the motion ``v_j = dy/dx_j`` of a point and the load
``tau_j`` of a joint, which is such a motion times a force that stays. With ``A = [v_j tau_j]`` and
white errors the information is ``M_jk = G_jk T_jk`` with ``G_jk = v_j' Sigma^-1 v_k`` and
``T_jk = tau_j tau_k``: of degree two each. Where the chain makes less of it - turning all that
moves changes no product ``v_j . v_k`` - coefficients vanish, and `Polynomial.trimmed` proves it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.polynomial import (
    ROUNDOFF,
    Axis,
    Enclosed,
    NotEnclosedError,
    Objective,
    Polynomial,
    sum_of_products,
)
from edtk.design.enclosure.symmetry import Halving, halved
from edtk.measure.instruments.distance import Distance
from edtk.robots.constraints.constraint import Constraint
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.joint_limits import CoupledLimits
from edtk.robots.constraints.radius import Radius
from edtk.robots.constraints.tilt import Tilt
from edtk.robots.frames import Frames
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.rotations import ROUNDING
from edtk.system.typing import Array

TURN = 2 * np.pi
MOST_TURNS = 12  # of a joint for one of its drive's variable; ratios of whole numbers up to this
WHOLE = 1e-12  # a ratio counts as whole up to this, as text with twelve digits has it
MOST = 6_000_000  # coefficients of one polynomial; 48 MB


@dataclass(frozen=True, eq=False)
class Chart:
    """The variables of polynomials: ``x = base + matrix t``, a turn of which is a period.

    Attributes:
        axes: The variables t (d,).
        matrix: What design variables x move by (v, d).
        degrees: Degree (d,) of every vector of the chain, and of its forces, by each.
        bases: Design variables (k, v) where all t are zero, one of each objective.
    """

    axes: tuple[Axis, ...]
    matrix: Array
    degrees: tuple[int, ...]
    bases: Array

    @classmethod
    def of(cls, space: DesignSpace) -> "Chart":
        """The free joints, then the direction of a free load.

        Raises:
            NotEnclosedError: A joint follows others by a ratio that is none of whole numbers, or
                the load is none of the kinds that are known.
        """
        robot = space.model.robot
        axes, steps, degrees = [], [], []
        for j in space.free:
            step, degree = _gear(space, j)
            low, high = (float(end) for end in space.workspace.robot.limits[:, j] / step)
            slides = robot.joints[j].kind == "prismatic"
            axes.append(Axis("length", low, high) if slides else _turning(low, high))
            steps.append(step)
            degrees.append(degree)
        settings, directions = _load_settings(space)
        places = [*space.free, *(robot.n + j for j, _ in directions)]
        axes += [axis for _, axis in directions]
        matrix = np.zeros((space.size, len(axes)))
        matrix[places, range(len(axes))] = [*steps, *(1.0 for _ in directions)]
        fixed = np.where(np.isin(range(robot.n), space.free), 0.0, space.fixed)
        bases = np.array([[*fixed, *one] for one in settings])
        _require_few(axes, degrees)
        return cls(tuple(axes), matrix, (*degrees, *(1 for _ in directions)), bases)

    def nodes(self) -> Array:
        """Places (m, d) whose values determine what is of the chain's degrees."""
        nodes = [axis.nodes(n) for axis, n in zip(self.axes, self.degrees, strict=True)]
        grid = np.meshgrid(*nodes, indexing="ij")
        return np.stack([values.ravel() for values in grid], axis=-1)

    def polynomial(self, samples: Array, rounding: float) -> Polynomial:
        """The polynomial of samples (m,) at the nodes, with no more than its own degrees."""
        sizes = [axis.size(n) for axis, n in zip(self.axes, self.degrees, strict=True)]
        return Polynomial.of_samples(self.axes, samples.reshape(sizes), rounding).trimmed()


def _turning(low: float, high: float) -> Axis:
    """The interval of an angle, no longer than a turn."""
    return Axis("angle", low, min(high, low + TURN))


def _gear(space: DesignSpace, j: int) -> tuple[float, int]:
    """How far a drive moves for one unit of t, and the degree of positions by t.

    A joint that turns by a whole number r of turns for one of t has cosines of ``r t``, and every
    joint of the chain adds its own r to the degree.
    """
    robot = space.model.robot
    matrix = np.eye(robot.n) if robot.ties is None else robot.ties.matrix
    slides = np.array([joint.kind == "prismatic" for joint in robot.chain])
    turning, sliding = matrix[~slides, j], matrix[slides, j]
    name = robot.joint_names[j]
    if robot.joints[j].kind == "prismatic":
        if turning.any():
            raise NotEnclosedError(f"{name} slides, and a joint turns with it: no polynomial")
        return 1.0, 1
    if sliding.any():
        raise NotEnclosedError(f"{name} turns, and a joint slides with it: no polynomial")
    for step in range(1, MOST_TURNS + 1):
        turns = step * turning
        if np.abs(turns - np.round(turns)).max() <= WHOLE * step:
            return float(step), int(np.abs(np.round(turns)).sum())
    raise NotEnclosedError(
        f"{name} turns a joint by the ratio {turning[turning != 1][0]:g}; expected one of whole "
        f"numbers up to {MOST_TURNS}"
    )


def _require_few(axes: Sequence[Axis], degrees: Iterable[int]) -> None:
    """Check that a polynomial of these degrees fits in memory.

    Raises:
        NotEnclosedError: It has too many coefficients.
    """
    wanted = list(degrees)
    count = np.prod([float(a.size(n)) for a, n in zip(axes, wanted, strict=False)])
    if count > MOST:
        raise NotEnclosedError(
            f"a polynomial of the degrees {', '.join(map(str, wanted))} has {count:.2g} "
            f"coefficients; expected at most {MOST:.2g}"
        )


def _load_settings(space: DesignSpace) -> tuple[list[list[float]], list[tuple[int, Axis]]]:
    """Variables of loads whose sensitivity is the largest of all, and the angles of a free one.

    The sensitivity is a convex function of the wrench: a sum of squares of what is linear in it,
    plus constants. So the largest is at an end of the bounded ones, and on the sphere of free ones.
    """
    load = space.load
    if type(load) is FixedLoad:
        return [[]], []
    if isinstance(load, ListedLoad):
        return [[float(u)] for u in range(len(load.wrenches))], []
    if isinstance(load, BoundedLoad):
        # Without weights there is nothing to measure where there is no load.
        return ([[1.0]] if space.model.weights is None else [[0.0], [1.0]]), []
    if isinstance(load, FreeLoad):
        half = np.pi / 2
        return [[1.0, 0.0, 0.0]], [(1, Axis("angle", -half, half)), (2, Axis("angle", 0.0, TURN))]
    raise NotEnclosedError(f"loads of the kind {type(load).__name__}: no polynomial is known")


@dataclass(frozen=True, eq=False)
class RobotPolynomials:
    """Information and slacks of a design space as polynomials, from which each multiplier's follow.

    Args:
        space: The design space.

    Raises:
        NotEnclosedError: Something of the space is no polynomial; see `Chart.of` and below.
    """

    space: DesignSpace

    def __post_init__(self) -> None:
        model = self.space.model
        pulls = () if model.weights is None else model.weights.pulls
        if pulls or model.gives is not None:
            raise NotEnclosedError(
                "a compensator's load is a root of a polynomial of its joint's angle, and no "
                "polynomial"
            )
        if self.space.noise is not None and not self._variances.all():
            raise NotEnclosedError(
                "errors of some rows vanish in some poses; expected a part that is white"
            )

    @cached_property
    def chart(self) -> Chart:
        """The variables."""
        return Chart.of(self.space)

    @cached_property
    def _places(self) -> Array:
        """Joint variables (m, n) of the chart's nodes."""
        x = self.chart.nodes() @ self.chart.matrix.T + self.chart.bases[0]
        return np.asarray(x[:, : self.space.model.robot.n])

    @cached_property
    def _frames(self) -> Frames:
        """The chain there."""
        return self.space.model.frames(self._places)

    @cached_property
    def _steps(self) -> float:
        """What a length of the chain rounds by, as a part of the reach.

        A turn of a frame rounds its columns by no more than 14 units: six of cosine, sine and the
        sum of two products, eight of a constant rotation; so does a step to a position. A product
        of two such vectors has the errors of both, and four units of its own. The angles of nodes
        round by half a turn's units, which moves a vector as far as its slope. Last,
        `without_rounding` sets to zero what is below its bound.
        """
        robot = self.space.model.robot
        turns = float(np.abs(self.chart.matrix).sum()) * TURN
        joints = 2 * (14 + 1) * (len(robot.chain) + 2) + 4
        return (joints + turns) * ROUNDOFF + ROUNDING

    @property
    def reach(self) -> float:
        """The largest length of the chain and what hangs on it [m]."""
        model = self.space.model
        points = [model.load_point, *(sensor.point for sensor in model.whole_instruments)]
        if model.weights is not None:
            points += model.weights.centers
        levers = self.space.load.wrench(self.chart.bases[:, model.robot.n :])[:, 6:]
        farthest = float(np.abs(levers).sum(axis=1).max(initial=0.0))
        return max(map(model.reach_of, points)) + farthest

    @cached_property
    def _variances(self) -> Array:
        """Variances (rows,) such that errors are no smaller, in any pose [m^2, rad^2].

        Information falls as the covariance rises, so that a bound with these holds. Of a tracker
        they are those of the shorter axis of its ellipsoid where it stands nearest.
        """
        noise = self.space.noise
        if noise is None:
            return np.square(self.space.sigma)
        found = np.square(noise.white) + np.square(noise.discrepancy)
        if noise.tracker is None:
            return found
        far = float(np.linalg.norm(noise.tracker.position))
        for point, row in noise.tracked:
            sensor = self.space.model.whole_instruments[point]
            nearest = max(0.0, far - self.space.model.reach_of(sensor.point))
            least = min(a + b * nearest for a, b in (noise.tracker.along, noise.tracker.across))
            found[row : row + 3] += noise.readings * least**2
        return found

    @cached_property
    def _motion(self) -> list[list[Polynomial]]:
        """Whitened motions (p, rows) of the unknown joints; of a distance, those of its point.

        A distance moves by ``u . v_j``, and ``(u . v)^2 <= |v|^2``: its point tells no less.
        """
        model = self.space.model
        rows = []
        first = 0
        for sensor in model.whole_instruments:
            last = first + sensor.rows
            if isinstance(sensor, Distance):
                motion = self._frames.folded(sensor.point.linear(self._frames))
                variances = np.repeat(self._variances[first:last], 3)
            else:
                motion = self._frames.folded(sensor.motion(self._frames))
                variances = self._variances[first:last]
            rows.append(motion / np.sqrt(variances)[:, None])
            first = last
        every = np.concatenate(rows, axis=1)[model.joints]
        least = np.sqrt(self._variances.min())
        error = self._steps * self._folds * max(self.reach, 1.0) / least
        return [[self.chart.polynomial(row, error) for row in joint] for joint in every]

    @cached_property
    def _folds(self) -> float:
        """How many joints at most follow a drive, each as often as it turns."""
        ties = self.space.model.robot.ties
        return 1.0 if ties is None else float(max(1.0, np.abs(ties.matrix).sum(axis=0).max()))

    @cached_property
    def gram(self) -> dict[tuple[int, int], Polynomial]:
        """``G_jk = v_j' Sigma^-1 v_k`` of parameters j <= k."""
        rows = self._motion
        pairs = [(j, k) for j in range(len(rows)) for k in range(j, len(rows))]
        return {
            (j, k): sum_of_products(
                [(1.0, f, g) for f, g in zip(rows[j], rows[k], strict=True)]
            ).trimmed()
            for j, k in pairs
        }

    @cached_property
    def loads(self) -> list[dict[tuple[int, int], Polynomial]]:
        """``T_jk = tau_j tau_k`` of parameters j <= k, for each objective."""
        return [self._loads_of(base) for base in self.chart.bases]

    def _loads_of(self, base: Array) -> dict[tuple[int, int], Polynomial]:
        """The same of one setting of the load."""
        model = self.space.model
        u = (self.chart.nodes() @ self.chart.matrix.T + base)[:, model.robot.n :]
        wrench = self.space.load.wrench(u)
        torque = model.torque_of(self._frames, wrench)[model.joints]
        size = self.reach * np.abs(wrench[:, :3]).sum(axis=1) + np.abs(wrench[:, 3:6]).sum(axis=1)
        if model.weights is not None:
            force = np.abs(model.weights.force(self._frames)).sum(axis=1).max()
            size = size + self.reach * float(force)
        error = self._steps * self._folds * float(size.max())
        tau = [self.chart.polynomial(one, error) for one in torque]
        return {(j, k): (tau[j] * tau[k]).trimmed() for j, k in self.gram}

    @cached_property
    def _slacks(self) -> list[tuple[Constraint, list[Polynomial]]]:
        """Each constraint with its slacks; none where it has no enclosure."""
        return [(one, _slacks(one, self)) for one in self.space.workspace.beside_limits]

    def _degrees(self, f: Polynomial, g: Polynomial) -> Array:
        """Degrees of a product; zero where a factor is zero."""
        vanishes = not f.coefficients.any() or not g.coefficients.any()
        return np.zeros(len(f.axes), dtype=int) if vanishes else np.add(f.degrees, g.degrees)

    @cached_property
    def kept(self) -> list[int]:
        """Indices of the variables on which anything depends.

        A distance from excluded poses adds no variable: another value of it is always far enough.
        """
        degrees = [self._degrees(f, T[pair]) for T in self.loads for pair, f in self.gram.items()]
        degrees += [
            np.array(f.degrees)
            for one, slacks in self._slacks
            if not isinstance(one, Excluded)
            for f in slacks
        ]
        needed = np.max(degrees, axis=0) > 0
        return [int(j) for j in np.flatnonzero(needed)]

    @cached_property
    def _own_slacks(self) -> tuple[list[Polynomial], list[str]]:
        """Slacks in the variables that are kept, and the names of constraints that are left out."""
        axes = [self.chart.axes[j] for j in self.kept]
        found: list[Polynomial] = []
        left_out: list[str] = []
        for one, slacks in self._slacks:
            depend = {j for f in slacks for j, n in enumerate(f.degrees) if n}
            if slacks and depend <= set(self.kept):
                found += [f.over(axes, self.kept) for f in slacks]
            elif not slacks:
                left_out += one.labels(self.space.workspace.robot)
        return found, left_out

    def sensitivity(self, Z: Array, objective: int = 0) -> Polynomial:
        """``tr(Z A' Sigma^-1 A)`` in all variables of the chart, Z (p, p) symmetric."""
        T = self.loads[objective]
        share = self.space.shares(self.chart.bases[objective]) ** 2
        terms = [
            (float(share) * float(Z[j, k]) * (1.0 if j == k else 2.0), G, T[j, k])
            for (j, k), G in self.gram.items()
            if Z[j, k] and G.coefficients.any() and T[j, k].coefficients.any()
        ]
        if not terms:
            return Polynomial.constant(self.chart.axes, 0.0)
        degrees = np.max([self._degrees(f, g) for _, f, g in terms], axis=0)
        _require_few(self.chart.axes, degrees)
        return sum_of_products(terms)

    @cached_property
    def halving(self) -> Halving:
        """The part of the box that stands for all of it, whatever the multiplier."""
        every = self.in_kept(self._generic)
        return halved([self.chart.axes[j] for j in self.kept], [*every, *self._own_slacks[0]])

    @property
    def _generic(self) -> Array:
        """A multiplier of no symmetry of its own."""
        R = np.random.default_rng(0).normal(size=(self.space.p, self.space.p))
        scale = np.array([1 / np.sqrt(max(self._largest(j), 1e-300)) for j in range(self.space.p)])
        return np.asarray(scale[:, None] * (R @ R.T) * scale)

    def _largest(self, j: int) -> float:
        """How large the information of a parameter can be, roughly."""
        return self.gram[j, j].size * max(T[j, j].size for T in self.loads)

    def in_kept(self, Z: Array) -> list[Polynomial]:
        """The sensitivities of all objectives in the variables that are kept."""
        axes = [self.chart.axes[j] for j in self.kept]
        every = range(len(self.chart.bases))
        return [self.sensitivity(Z, k).over(axes, self.kept) for k in every]

    def enclosed(self, Z: Array) -> Enclosed:
        """The sensitivity of a multiplier Z (p, p) over all poses and loads.

        Without the prior, which is the same in all experiments.
        """
        slacks, left_out = self._own_slacks
        bases = self.chart.bases.copy()
        dropped = [j for j in range(len(self.chart.axes)) if j not in self.kept]
        middles = np.array([self.chart.axes[j].middle for j in dropped])
        bases += self.chart.matrix[:, dropped] @ middles
        part = self.halving
        return Enclosed(
            axes=part.axes,
            objectives=tuple(Objective(part.of(f)) for f in self.in_kept(Z)),
            slacks=tuple(part.of(f) for f in slacks),
            base=bases,
            matrix=self.chart.matrix[:, self.kept],
            left_out=tuple(left_out),
        )


def _slacks(constraint: Constraint, robot: RobotPolynomials) -> list[Polynomial]:
    """Polynomials that are not negative where a constraint holds; none where none is known."""
    frames = robot._frames
    if isinstance(constraint, Height):
        return [_position(robot)[2] - constraint.minimum]
    if isinstance(constraint, Radius):
        x, y, _ = _position(robot)
        least = max(constraint.minimum, 0.0)
        return [(sum_of_products([(1.0, x, x), (1.0, y, y)]) - least**2).trimmed()]
    if isinstance(constraint, Tilt):
        if constraint.maximum >= np.pi / 2:
            return [Polynomial.constant(robot.chart.axes, 1.0)]
        up = robot.chart.polynomial(frames.rotation[2, 2], robot._steps)
        return [float(np.sin(constraint.maximum)) - up, float(np.sin(constraint.maximum)) + up]
    if isinstance(constraint, Excluded):
        return _away(constraint, robot)
    if isinstance(constraint, CoupledLimits):
        return _coupled(constraint, robot)
    return []


def _position(robot: RobotPolynomials) -> list[Polynomial]:
    """Coordinates of the tool point [m]."""
    error = robot._steps * robot.space.model.robot.reach
    return [robot.chart.polynomial(one, error) for one in robot._frames.position]


def _away(constraint: Excluded, robot: RobotPolynomials) -> list[Polynomial]:
    """``sum_j 2 (1 - cos d_j) >= 4 sin^2(D/2)`` of differences d_j, where ``sum_j d_j^2 >= D^2``.

    ``2 (1 - cos d)`` is concave in d^2 up to ``d = pi``, and zero at zero, so that for a given sum
    of the squares the sum is least where one joint has it all. Distances above pi say nothing.
    """
    if constraint.distance > np.pi:
        return []
    q = robot._places
    turning = ~robot._frames.sliding
    least = 4 * np.sin(constraint.distance / 2) ** 2
    rounding = (8 * q.shape[1] + 8 * float(np.abs(q).max(initial=0.0))) * ROUNDOFF
    chords = 2 * (1 - np.cos(q[:, None] - constraint.poses))
    sums = (chords * turning).sum(axis=2)
    return [robot.chart.polynomial(one - least, rounding * turning.sum()) for one in sums.T]


def _coupled(constraint: CoupledLimits, robot: RobotPolynomials) -> list[Polynomial]:
    """``cos(r q - middle) >= cos(half)`` of each joint that is to stay between limits.

    Whole turns beside these count as within.
    """
    bounds = constraint.bounds
    values = bounds.values(robot._places)
    found = []
    for value, (low, high) in zip(values.T, bounds.limits.T, strict=True):
        if high - low >= TURN:
            continue
        least = np.cos((high - low) / 2)
        rounding = (8 + 8 * float(np.abs(value).max())) * ROUNDOFF
        cosines = np.cos(value - (low + high) / 2) - least
        found.append(robot.chart.polynomial(cosines, rounding))
    return found or [Polynomial.constant(robot.chart.axes, 1.0)]
