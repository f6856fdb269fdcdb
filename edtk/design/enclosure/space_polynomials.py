"""Design spaces of robots as polynomials: variables, constraints, and what of the box is needed."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, zip_longest

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import (
    ROUNDOFF,
    Axis,
    NotEnclosedError,
    Polynomial,
    sum_of_squares,
)
from edtk.design.enclosure.symmetry import TURN, Halving, Link, direction_of, halved, within
from edtk.design.enclosure.tracked import Growth, TrackedObjective
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
from edtk.system.typing import Array, Indices

MOST_TURNS = 12  # of a joint for one of its drive's variable; ratios of whole numbers up to this
WHOLE_RATIO = 1e-12  # a ratio counts as whole up to this, as text with twelve digits has it
LEAST = 1e-300  # information; less is none
MOST_COEFFICIENTS = 6_000_000  # coefficients of one polynomial; 48 MB


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
    def of(cls, space: DesignSpace, unloaded: bool) -> "Chart":
        """The free joints, then the direction of a free load.

        Args:
            space: The design space.
            unloaded: Whether an experiment without any load tells something.

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
        settings, directions = _load_settings(space, unloaded)
        places = [*space.free, *(robot.n + j for j, _ in directions)]
        axes += [axis for _, axis in directions]
        matrix = np.zeros((space.size, len(axes)))
        matrix[places, range(len(axes))] = [*steps, *(1.0 for _ in directions)]
        fixed = np.where(np.isin(range(robot.n), space.free), 0.0, space.fixed)
        bases = np.array([[*fixed, *one] for one in settings])
        require_few(axes, degrees)
        return cls(tuple(axes), matrix, (*degrees, *(1 for _ in directions)), bases)

    def nodes(self, order: int = 1) -> Array:
        """Places (m, d) whose values determine products of so many of the chain's vectors."""
        nodes = [axis.nodes(order * n) for axis, n in zip(self.axes, self.degrees, strict=True)]
        grid = np.meshgrid(*nodes, indexing="ij")
        return np.stack([values.ravel() for values in grid], axis=-1)

    def polynomial(self, samples: Array, rounding: float, order: int = 1) -> Polynomial:
        """The polynomial of samples (m,) at these nodes, with no more than its own degrees."""
        sizes = [axis.size(order * n) for axis, n in zip(self.axes, self.degrees, strict=True)]
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
    slides = robot.chain_slides
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
        if np.abs(turns - np.round(turns)).max() <= WHOLE_RATIO * step:
            return float(step), int(np.abs(np.round(turns)).sum())
    raise NotEnclosedError(
        f"{name} turns a joint by the ratio {turning[turning != 1][0]:g}; expected one of whole "
        f"numbers up to {MOST_TURNS}"
    )


def require_few(axes: Sequence[Axis], degrees: Iterable[int]) -> None:
    """Check that a polynomial of these degrees fits in memory.

    Raises:
        NotEnclosedError: It has too many coefficients.
    """
    wanted = list(degrees)
    count = np.prod([float(a.size(n)) for a, n in zip(axes, wanted, strict=False)])
    if count > MOST_COEFFICIENTS:
        raise NotEnclosedError(
            f"a polynomial of the degrees {', '.join(map(str, wanted))} has {count:.2g} "
            f"coefficients; expected at most {MOST_COEFFICIENTS:.2g}"
        )


def _load_settings(
    space: DesignSpace, unloaded: bool
) -> tuple[list[list[float]], list[tuple[int, Axis]]]:
    """Variables of loads whose sensitivity is the largest of all, and the angles of a free one.

    The sensitivity is a convex function of the wrench: a sum of squares of what is linear in it,
    plus constants. So the largest is at an end of the bounded ones, and on the sphere of free ones.

    Args:
        space: The design space.
        unloaded: Whether an experiment without any load tells something.
    """
    load = space.load
    if type(load) is FixedLoad:
        return [[]], []
    if isinstance(load, ListedLoad):
        return [[float(u)] for u in range(len(load.wrenches))], []
    if isinstance(load, BoundedLoad):
        return [*([[0.0]] * unloaded), [1.0]], []
    if isinstance(load, FreeLoad):
        half = np.pi / 2
        angles = [(1, Axis("angle", -half, half)), (2, Axis("angle", 0.0, TURN))]
        return [*([[0.0, 0.0, 0.0]] * unloaded), [1.0, 0.0, 0.0]], angles
    raise NotEnclosedError(f"loads of the kind {type(load).__name__}: no polynomial is known")


@dataclass(frozen=True, eq=False)
class Beam:
    """From a tracker to the one marker that it sees.

    Attributes:
        growth: How errors grow along it.
        squared: Its squared length, in the variables of the chart [m^2].
        inline: What is read along it times its length, squared, of a multiplier and an objective;
            None where errors are alike along the beam and across it. See `tracked`.
        objectives: Number of objectives.
        nearest: No squared length is less [m^2].
    """

    growth: Growth
    squared: Polynomial
    inline: Callable[[Array, int], Polynomial] | None
    objectives: int
    nearest: float

    def forms(self, Z: Array) -> list[Polynomial]:
        """The squared length, and `inline` of each objective where errors differ."""
        own = self.inline
        every = range(self.objectives)
        return [self.squared] if own is None else [self.squared, *(own(Z, k) for k in every)]


@dataclass(frozen=True, eq=False)
class SpacePolynomials(ABC):
    """Sensitivities and slacks of a design space, from which those of each multiplier follow.

    Args:
        space: The design space.
    """

    space: DesignSpace

    @property
    @abstractmethod
    def reach(self) -> float:
        """The largest length of the chain and what hangs on it [m]."""

    @property
    @abstractmethod
    def unloaded(self) -> bool:
        """Whether an experiment without any load tells something."""

    @property
    @abstractmethod
    def is_exact(self) -> bool:
        """Whether sensitivities are those of the space; else they are no smaller."""

    @property
    @abstractmethod
    def told(self) -> Indices:
        """Degree (d,) of sensitivities by each variable of the chart, whatever the multiplier."""

    @property
    @abstractmethod
    def sizes(self) -> Array:
        """How large the information (p,) of each parameter can be, roughly."""

    @abstractmethod
    def sensitivity(self, Z: Array, objective: int = 0) -> Polynomial:
        """``tr(Z A' Sigma^-1 A)`` in all variables of the chart, Z (p, p) symmetric.

        Where a beam is, it is that of errors that are all as large as the least of `Beam.growth`.
        """

    @property
    def beam(self) -> Beam | None:
        """The beam along which errors grow; None where they are alike in all poses."""
        return None

    @cached_property
    def chart(self) -> Chart:
        """The variables."""
        return Chart.of(self.space, self.unloaded)

    @cached_property
    def places(self) -> Array:
        """Joint variables (m, n) of the chart's nodes."""
        x = self.chart.nodes() @ self.chart.matrix.T + self.chart.bases[0]
        return np.asarray(x[:, : self.space.model.robot.n])

    @cached_property
    def frames(self) -> Frames:
        """The chain there."""
        return self.space.model.frames(self.places)

    @cached_property
    def steps(self) -> float:
        """What a length of the chain rounds by, as a part of the reach.

        A turn of a frame rounds its columns by no more than 14 units: six of cosine, sine and the
        sum of two products, eight of a constant rotation; so does a step to a position. A product
        of two such vectors has the errors of both, and four units of its own. The angles of nodes
        round by half a turn's units, which moves a vector as far as its slope.
        """
        robot = self.space.model.robot
        turns = float(np.abs(self.chart.matrix).sum()) * TURN
        joints = 2 * (14 + 1) * (len(robot.chain) + 2) + 4
        return (joints + turns) * ROUNDOFF

    @cached_property
    def folds(self) -> float:
        """How many joints at most follow a drive, each as often as it turns."""
        ties = self.space.model.robot.ties
        return 1.0 if ties is None else float(max(1.0, np.abs(ties.matrix).sum(axis=0).max()))

    @cached_property
    def _slacks(self) -> list[tuple[Constraint, list[Polynomial]]]:
        """Each constraint with its slacks; none where it has no enclosure."""
        return [(one, _slacks(one, self)) for one in self.space.workspace.beside_limits]

    @cached_property
    def kept(self) -> list[int]:
        """Indices of the variables on which anything depends.

        A distance from excluded poses adds no variable: another value of it is always far enough.
        """
        degrees = [
            np.array(f.degrees)
            for one, slacks in self._slacks
            if not isinstance(one, Excluded)
            for f in slacks
        ]
        needed = np.max([self.told, *degrees], axis=0) > 0
        return [int(j) for j in np.flatnonzero(needed)]

    @cached_property
    def links(self) -> list[Link]:
        """Sums that take the place of angles that are kept; none of drives that turn several."""
        robot = self.space.model.robot
        free = self.space.free
        found: list[Link] = []
        if robot.ties is not None:
            return found
        for k, (i, j) in enumerate(pairwise(self.kept)):
            kinds = [robot.joints[free[one]].kind for one in (i, j) if one < len(free)]
            if len(kinds) == 2 and "prismatic" not in kinds:
                sign = direction_of(*self.frames.axes[[free[i], free[j]]])
                found += [Link(k, k + 1, sign)] if sign else []
        return found

    @cached_property
    def kept_axes(self) -> tuple[Axis, ...]:
        """The variables of the chart that are kept."""
        return tuple(self.chart.axes[j] for j in self.kept)

    @cached_property
    def own_axes(self) -> tuple[Axis, ...]:
        """The same with sums in the places of some."""
        axes = self.kept_axes
        for link in self.links:
            axes = link.axes(axes)
        return axes

    def own(self, f: Polynomial) -> Polynomial:
        """A polynomial of the chart's variables in these.

        Raises:
            ValueError: It depends on a variable that is dropped.
        """
        return self._linked(f.over(self.kept_axes, self.kept))

    def _linked(self, f: Polynomial) -> Polynomial:
        """A polynomial of variables that are kept with sums in the places of some."""
        for link in self.links:
            f = link.of(f)
        return f

    @cached_property
    def limits(self) -> list[Polynomial]:
        """Slacks of the joints whose angles are variables no more, where limits are no turn."""
        each = [within(self.kept_axes, link.second) for link in self.links]
        return [self._linked(f) for f in each if f is not None]

    @cached_property
    def matrix(self) -> Array:
        """What design variables x move by (v, d) for these variables."""
        matrix = self.chart.matrix[:, self.kept]
        for link in self.links:
            matrix = matrix @ link.matrix(len(self.kept))
        return matrix

    def folded(self, x: Array) -> Array:
        """Experiments (m, v) of sums, by whole turns of joints to where their limits are."""
        x = x.copy()
        for link in self.links:
            axis = self.kept_axes[link.second]
            j = self.space.free[self.kept[link.second]]
            x[:, j] -= TURN * np.round((x[:, j] - axis.middle) / TURN)
        return x

    @cached_property
    def _own_slacks(self) -> tuple[list[Polynomial], list[str]]:
        """Slacks in the variables that are kept, and the names of constraints that are left out."""
        found: list[Polynomial] = []
        left_out: list[str] = []
        for one, slacks in self._slacks:
            depend = {j for f in slacks for j, n in enumerate(f.degrees) if n}
            if slacks and depend <= set(self.kept):
                found += [self.own(f) for f in slacks]
            elif not slacks:
                left_out += one.labels(self.space.workspace.robot)
        return found + self.limits, left_out

    @cached_property
    def halving(self) -> Halving:
        """The part of the box that stands for all of it, whatever the multiplier."""
        beam = self.beam
        every = [] if beam is None else [self.own(f) for f in beam.forms(self._generic)]
        every += [*self.in_kept(self._generic), *self._own_slacks[0]]
        return halved(self.own_axes, every)

    @property
    def _generic(self) -> Array:
        """A multiplier of no symmetry of its own."""
        R = np.random.default_rng(0).normal(size=(self.space.p, self.space.p))
        scale = 1 / np.sqrt(np.maximum(self.sizes, LEAST))
        return np.asarray(scale[:, None] * (R @ R.T) * scale)

    def in_kept(self, Z: Array) -> list[Polynomial]:
        """The sensitivities of all objectives in the variables that are kept."""
        every = range(len(self.chart.bases))
        return [self.own(self.sensitivity(Z, k)) for k in every]

    def enclosed(self, Z: Array) -> Enclosed:
        """The sensitivity of a multiplier Z (p, p) over all poses and loads.

        Without the prior, which is the same in all experiments.

        Raises:
            NotEnclosedError: All poses tell the same.
        """
        if not self.kept:
            raise NotEnclosedError("all poses tell the same: no joint changes what is told")
        slacks, left_out = self._own_slacks
        bases = self.chart.bases.copy()
        dropped = [j for j in range(len(self.chart.axes)) if j not in self.kept]
        middles = np.array([self.chart.axes[j].middle for j in dropped])
        bases += self.chart.matrix[:, dropped] @ middles
        part = self.halving
        objectives = [Objective(part.of(f)) for f in self.in_kept(Z)]
        if self.beam is not None:
            squared, *inline = [part.of(self.own(f)) for f in self.beam.forms(Z)]
            growth, least = self.beam.growth, self.beam.nearest
            objectives = [
                TrackedObjective(
                    f.numerator, growth=growth, squared=squared, inline=own, nearest=least
                )
                for f, own in zip_longest(objectives, inline)
            ]
        return Enclosed(
            axes=part.axes,
            objectives=tuple(objectives),
            slacks=tuple(part.of(f) for f in slacks),
            base=bases,
            matrix=self.matrix,
            left_out=tuple(left_out),
        )


def _slacks(constraint: Constraint, robot: SpacePolynomials) -> list[Polynomial]:
    """Polynomials that are not negative where a constraint holds; none where none is known."""
    frames = robot.frames
    if isinstance(constraint, Height):
        return [_position(robot)[2] - constraint.minimum]
    if isinstance(constraint, Radius):
        x, y, _ = _position(robot)
        least = max(constraint.minimum, 0.0)
        return [(sum_of_squares([x, y]) - least**2).trimmed()]
    if isinstance(constraint, Tilt):
        if constraint.maximum >= np.pi / 2:
            return [Polynomial.constant(robot.chart.axes, 1.0)]
        up = robot.chart.polynomial(frames.rotation[2, 2], robot.steps)
        return [float(np.sin(constraint.maximum)) - up, float(np.sin(constraint.maximum)) + up]
    if isinstance(constraint, Excluded):
        return _away(constraint, robot)
    if isinstance(constraint, CoupledLimits):
        return _coupled(constraint, robot)
    return []


def _position(robot: SpacePolynomials) -> list[Polynomial]:
    """Coordinates of the tool point [m]."""
    error = robot.steps * robot.space.model.robot.reach
    return [robot.chart.polynomial(one, error) for one in robot.frames.position]


def _away(constraint: Excluded, robot: SpacePolynomials) -> list[Polynomial]:
    """``sum_j 2 (1 - cos d_j) >= 4 sin^2(D/2)`` of differences d_j, where ``sum_j d_j^2 >= D^2``.

    ``2 (1 - cos d)`` is concave in d^2 up to ``d = pi``, and zero at zero, so that for a given sum
    of the squares the sum is least where one joint has it all. Distances above pi say nothing.
    """
    if constraint.distance > np.pi:
        return []
    q = robot.places
    turning = ~robot.frames.sliding
    least = 4 * np.sin(constraint.distance / 2) ** 2
    rounding = (8 * q.shape[1] + 8 * float(np.abs(q).max(initial=0.0))) * ROUNDOFF
    chords = 2 * (1 - np.cos(q[:, None] - constraint.poses))
    sums = (chords * turning).sum(axis=2)
    return [robot.chart.polynomial(one - least, rounding * turning.sum()) for one in sums.T]


def _coupled(constraint: CoupledLimits, robot: SpacePolynomials) -> list[Polynomial]:
    """``cos(r q - middle) >= cos(half)`` of each joint that is to stay between limits.

    Whole turns beside these count as within.
    """
    bounds = constraint.bounds
    values = bounds.values(robot.places)
    found = []
    for value, (low, high) in zip(values.T, bounds.limits.T, strict=True):
        if high - low >= TURN:
            continue
        least = np.cos((high - low) / 2)
        rounding = (8 + 8 * float(np.abs(value).max())) * ROUNDOFF
        cosines = np.cos(value - (low + high) / 2) - least
        found.append(robot.chart.polynomial(cosines, rounding))
    return found or [Polynomial.constant(robot.chart.axes, 1.0)]
