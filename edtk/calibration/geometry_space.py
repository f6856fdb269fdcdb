"""Where experiments of a study of geometry may lie, and what markers tell there."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.cell.sight import Sight
from edtk.design.design_space import DesignSpace, Experiments
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.robot_polynomials import RowPolynomials
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.weighted_candidates import rows_of_blocks
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.noise import VisitNoise, shared_visits
from edtk.measure.nominal_columns import NominalColumns, PlacedColumns
from edtk.measure.parameters import LINEAR
from edtk.measure.whitening import Whitener, WhiteRows, component_first, read_alone
from edtk.robots.frames import MM
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.loads.load import Load
from edtk.study.study_geometry import StudyLoads
from edtk.system.typing import Array, Indices, Mask

BLOCK = 1024  # poses at once: their arrays fit into a core's cache


@dataclass(frozen=True, eq=False)
class PositionRows:
    """How what is read of all markers moves with the parameters, at the geometry of the drawing.

    A marker has r = 3 rows, its position [mm], or r = 6 with its orientation as a turn in the axes
    of the instrument [mrad]. With the noise of a pose they are whitened: ``L^-1 J`` of its
    covariance ``L L'``. Where a study reads visits under a load loaded less unloaded, their rows
    are those of the springs alone, and they have the noise of two readings.

    Args:
        model: Markers and parameters.
        loads: What loads the joints; None without springs.
        noise: The errors of a pose; None for rows in millimetres and milliradians.
        sight: Which markers are read in which poses; the rows of others are zero. None for all.
    """

    model: MeasuredModel
    loads: StudyLoads | None
    noise: VisitNoise | None = None
    sight: Sight | None = None

    @cached_property
    def columns(self) -> NominalColumns:
        """Where columns and slopes come from."""
        return NominalColumns(self.model)

    @cached_property
    def scales(self) -> Array:
        """Millimetres that a metre by one unit of each parameter is, or mrad that a rad is (p,)."""
        return MM * self.model.scales

    @property
    def _width(self) -> int:
        """Rows of a pose."""
        return self.model.row_count * len(self.model.markers)

    def __call__(
        self,
        q: Array,
        wrench: Array,
        visits: Array | None = None,
        read: Mask | None = None,
    ) -> Array:
        """Rows (m, k r, p) for a unit of each parameter, in mm and mrad or in units of the noise.

        Args:
            q: Poses (m, n) [rad or m].
            wrench: Their forces and torques (m, 6) [N, N m].
            visits: Visits (m,) that share the model's errors in each pose, of which a row counts as
                one; one each by default.
            read: Which rows (m, k r) there are; by default those that are seen.
        """
        found = np.empty((len(q), self._width, self.model.p))
        for first in range(0, len(q), BLOCK):
            part = slice(first, first + BLOCK)
            given = (q[part], wrench[part], _some(visits, part))
            found[part] = self._block(
                *given, self._read(q[part], None if read is None else read[part])
            )
        return found

    def _read(self, q: Array, read: Mask | None = None) -> Mask | None:
        """Which rows (m, k r) there are: those that are said, or else those that are seen."""
        return read if read is not None or self.sight is None else self.sight.rows(q)

    def enclosable(self, wrenches: Array) -> tuple[int, Array, float]:
        """What a bound over all poses needs to know of rows, whose errors are white.

        Args:
            wrenches: Loads (s, 6 or 9), no other is larger [N, N m].

        Returns:
            How many vectors of the chain an entry multiplies; how large entries (p,) can be at
            most, with all vectors of their full lengths; and the largest length [m].

        Raises:
            NotEnclosedError: An entry is no polynomial.
        """
        model = self.model
        if model.is_distance.any():
            raise NotEnclosedError("the direction of a wire is no polynomial of the joints")
        answers = model.answers
        if answers.gives is not None or len(answers.numbers.of):
            raise NotEnclosedError("a joint gives way to its compensator by no polynomial")
        curved = sorted(set(answers.springs.laws) - {LINEAR})
        if curved:
            raise NotEnclosedError(f"springs of the law {curved[0]!r} are no polynomials")
        if self.loads is not None and len(answers.of) and self.loads.pulls:
            raise NotEnclosedError("a compensator's load is no polynomial of its joint's angle")
        lever = model.robot.reach + float(np.linalg.norm(model.offsets, axis=1).max())
        torque = 0.0 if self.loads is None else self.loads.largest(wrenches)
        largest = np.zeros(model.p)
        for one in self.columns.elements:
            loaded = 1.0 if one.term is None else torque * abs(one.factor)
            largest[one.parameter] += max(lever, 1.0) * loaded
        order = 1 if self.loads is None or not len(answers.of) else 2
        sigma = 1.0 if self.noise is None else self.noise.sizes().min()
        return order, largest * self.scales / sigma, lever

    def covariance(self, q: Array, wrench: Array, visits: Array | None = None) -> Array:
        """Covariances (m, k r, k r) [mm^2, mrad^2] of what rows are in, see `__call__`."""
        counted = 1.0 if visits is None else visits
        V = self._covariance(self.columns.at(q), wrench, counted, self._read(q))
        return np.asarray(np.moveaxis(V, -1, 0))

    def slopes(
        self,
        q: Array,
        wrench: Array,
        B: Array,
        changes: Array,
        visits: Array | None = None,
        read: Mask | None = None,
    ) -> Array:
        """Derivatives (m, n + d) of ``<B, rows>``, weights B (m, k r, p) held fixed.

        They are by the joints, and by d variables of the load, which change the wrench by
        ``changes`` (m, 6, d) and the loads of the joints in proportion.

        Where errors are correlated, ``rows = L^-1 A`` with ``V = L L'``, and B must be such that
        ``B rows'`` is symmetric, as it is for ``B = rows G`` with symmetric G, from differentials
        of information: then it does not matter how L turns, see `Experiments.slope`.
        """
        found = np.empty((len(q), q.shape[1] + changes.shape[-1]))
        for first in range(0, len(q), BLOCK):
            part = slice(first, first + BLOCK)
            own = (_some(visits, part), self._read(q[part], None if read is None else read[part]))
            found[part] = self._slope(q[part], wrench[part], B[part], changes[part], *own)
        return found

    def _block(self, q: Array, wrench: Array, visits: ArrayLike, read: Mask | None) -> Array:
        """The rows of a block of poses."""
        placed = self.columns.at(q)
        amplitudes = self._amplitudes(q, self._loadings(q, wrench))
        rows = self._rows(placed, amplitudes, self._differs(wrench), read)
        whitener = self._whitener(placed, wrench, visits, read)
        return np.moveaxis(rows if whitener is None else whitener.rows(rows), -1, 0).swapaxes(1, 2)

    def _differs(self, wrench: Array) -> Mask | None:
        """Which visits (m,) are differences of two readings; None for none."""
        if self.loads is None or not self.loads.reads_changes:
            return None
        return np.asarray(wrench.any(axis=1))

    def _rows(
        self,
        placed: PlacedColumns,
        amplitudes: Array | None,
        differs: Mask | None,
        read: Mask | None,
    ) -> Array:
        """Rows (p, k r, m), component first, of which those that are not read are zero."""
        J = placed.jacobian(amplitudes, differs)
        rows = J.reshape(self.model.p, -1, J.shape[-1]) * self.scales[:, None, None]
        return np.asarray(rows if read is None else rows * read.T)

    def _whitener(
        self, placed: PlacedColumns, wrench: Array, visits: ArrayLike, read: Mask | None
    ) -> Whitener | WhiteRows | None:
        """What makes errors of unit covariance; None without noise."""
        if self.noise is None:
            return None
        if self.noise.is_white:
            return WhiteRows(self.noise.of_differences(self._differs(wrench)).sizes(visits))
        return Whitener.of(self._covariance(placed, wrench, visits, read))

    def _covariance(
        self, placed: PlacedColumns, wrench: Array, visits: ArrayLike, read: Mask | None
    ) -> Array:
        """Covariances (k r, k r, m) with which one of some visits of a pose counts."""
        assert self.noise is not None
        noise = self.noise.of_differences(self._differs(wrench))
        V = noise.covariance_of(self, placed, wrench, visits)
        return V if read is None else read_alone(V, read.T)

    def points_of(self, placed: PlacedColumns) -> Array:
        """Markers (k, 3, m) [m]; with the next four, what `VisitNoise` needs to know."""
        return placed.points

    def motion_of(self, placed: PlacedColumns) -> Array:
        """Motions (n, k r, m) of all coordinates by the joints [m/rad, rad/rad]."""
        n, *_, m = placed.by_joints.shape
        return placed.by_joints.reshape(n, -1, m)

    def motion_slope_of(self, placed: PlacedColumns, B: Array) -> Array:
        """Derivatives (n, m) of ``<B, motion>`` by the joints, weights B (n, k r, m) held fixed."""
        return placed.motion_slope(B.reshape(placed.by_joints.shape))

    def torque_of(self, placed: PlacedColumns, wrench: ArrayLike) -> Array:
        """Loads (n, m) of the joints; their changes where readings are differences."""
        q = placed.frames.q
        parts = [one.share * one.torque for one in self._loadings(q.T, np.asarray(wrench))]
        return np.asarray(sum(parts, np.zeros(1)))[: len(q)]

    def torque_slope_of(self, placed: PlacedColumns, wrench: ArrayLike, s: Array) -> Array:
        """Derivatives (n, m) of ``sum_j s_j tau_j`` of these, weights s (n, m) held fixed."""
        q = placed.frames.q.T
        found = np.zeros(s.shape)
        for one in self._loadings(q, np.asarray(wrench)):
            own = np.zeros(one.torque.shape)
            own[: len(s)] = one.share * s
            found += self._by_joints(q, one.wrench, own)
        return found

    def _by_joints(self, q: Array, wrench: Array, own: Array) -> Array:
        """Derivatives (n, m) by the joints of what loads them, with weights (s, m)."""
        assert self.loads is not None
        return self.loads.slope(q, wrench, np.ascontiguousarray(own.T))[:, : q.shape[1]].T

    def _loadings(self, q: Array, wrench: Array) -> list["Loaded"]:
        """What loads the joints, whose springs have not given way; none without springs.

        In differences it is followed by what does so before, with a share of minus one.
        """
        if self.loads is None:
            return []
        found = [Loaded(wrench, self.loads(q, wrench).T, np.ones(len(q)))]
        differs = self._differs(wrench)
        if differs is not None:
            none = np.zeros_like(wrench)
            found.append(Loaded(none, self.loads(q, none).T, np.where(differs, -1.0, 0.0)))
        return found

    def _amplitudes(self, q: Array, loadings: list["Loaded"]) -> Array | None:
        """Amplitudes (T, m) of the springs' terms, or their change; None without springs."""
        if not loadings:
            return None
        answers = self.model.answers
        parts = [one.share * answers.amplitudes(q.T, one.torque) for one in loadings]
        return np.asarray(sum(parts[1:], parts[0]))

    def _slope(
        self,
        q: Array,
        wrench: Array,
        B: Array,
        changes: Array,
        visits: ArrayLike,
        read: Mask | None,
    ) -> Array:
        """The derivatives of a block of poses.

        ``d<B, L^-1 A> = <W, dA> - <W A' V^-1, dV>/2`` with ``W = L^-T B``.
        """
        placed = self.columns.at(q)
        loadings = self._loadings(q, wrench)
        amplitudes = self._amplitudes(q, loadings)
        differs = self._differs(wrench)
        whitener = self._whitener(placed, wrench, visits, read)
        weights = component_first(B if read is None else B * read[..., None])
        if whitener is not None:
            weights = whitener.transposed(weights)
        scaled = weights * self.scales[:, None, None]
        by_marker = scaled.reshape(self.model.p, len(self.model.markers), -1, len(q))
        by_joint, by_amplitudes = placed.slope(by_marker, amplitudes, differs)
        moved = self._moved(q, changes)
        by_load = [np.zeros(len(q)) for _ in moved]
        for one in loadings:
            pulled = one.share * by_amplitudes
            by_torque, by_own = self.model.answers.pulled_back(q.T, one.torque, pulled)
            by_joint = by_joint + by_own + self._by_joints(q, one.wrench, by_torque)
            if one.wrench is wrench:
                by_load = [(by_torque * change).sum(axis=0) for change in moved]
        if self.noise is not None and isinstance(whitener, Whitener):
            rows = whitener.rows(self._rows(placed, amplitudes, differs, read))
            given = (self, placed, whitener.slope_weights(weights, rows), wrench)
            noise = self.noise.of_differences(differs)
            by_joint = by_joint + noise.slope_of(*given, visits)
            own = [change[: q.shape[1]] for change in moved]
            more = noise.load_slope_of(*given, own, visits)
            by_load = [one + other for one, other in zip(by_load, more, strict=True)]
        return np.concatenate([by_joint, np.array(by_load).reshape(-1, len(q))]).T

    def _moved(self, q: Array, changes: Array) -> list[Array]:
        """By how much changes of the wrench (m, 6, d) change the joints' loads (s, m)."""
        each = np.moveaxis(changes, -1, 0)
        if self.loads is None:
            return [np.zeros(q.shape).T for _ in each]
        return [self.loads.of_wrench(q, change).T for change in each]


def _some(visits: Array | None, part: slice) -> Array | float:
    """Visits of a block of poses."""
    return 1.0 if visits is None else visits[part]


@dataclass(frozen=True, eq=False)
class Loaded:
    """What loads the joints in some readings.

    Attributes:
        wrench: Forces and torques (m, 6).
        torque: Loads (s, m) of the joints.
        share: What counts of them (m,): minus one of those before, in a difference.
    """

    wrench: Array
    torque: Array
    share: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometrySpace(DesignSpace):
    """A design space whose experiments are visits of a pose, each under one of the study's loads.

    Design variables are the joints, then the index of the load where there are several, of which
    the first is none, or the force of the visit where any is allowed. What a visit tells are the
    positions of all markers, and their orientations where the study measures full poses: the rows,
    r for each marker, of `PositionRows`. Candidates are kept as rows: parameters of geometry are
    nearly dependent, and squares would lose their digits.

    Args:
        geometry: Markers and parameters, in the parameters' own units.
        noise: The errors of a visit.
        loads: What loads the joints; None without springs.
    """

    geometry: MeasuredModel
    noise: VisitNoise
    loads: StudyLoads | None

    @property
    def p(self) -> int:
        """Number of parameters."""
        return self.geometry.p

    @property
    def parameters(self) -> tuple[str, ...]:
        """Their names (p,)."""
        return tuple(one.name for one in self.geometry.parameters)

    @property
    def units(self) -> tuple[str, ...]:
        """Their units (p,)."""
        return tuple(one.unit for one in self.geometry.parameters)

    @property
    def doubles(self) -> int:
        """Numbers that say what a candidate tells: those of its rows."""
        return self.geometry.row_count * len(self.geometry.markers) * self.p

    def at(self, x: Array, held: Mask | None = None) -> "GeometryExperiments":
        """The experiments of design variables x (..., v), see `Space`."""
        frames = self.model.frames(x[..., : len(self.fixed)])
        return GeometryExperiments(self, x, frames, held=held)

    def told(self, experiments: Experiments) -> Array:
        """What experiments (k) tell: rows (r markers, p, k)."""
        return np.moveaxis(experiments.regressor, 0, -1)

    def problem_of(self, told: Array) -> Problem:
        """Make a problem of experiments whose rows (r markers, p, k) are at hand."""
        rows = np.ascontiguousarray(np.moveaxis(told, -1, 0))
        return Problem.of_kept(rows_of_blocks(rows, 1.0), self.parameters, self.prior)

    def rows_of(self, plan: Plan) -> Array:
        """Whitened rows (k, r markers, p) of a plan's visits."""
        return self._rows(plan.q, plan.wrench, self.visits_of(plan))

    def visits_of(self, plan: Plan) -> Array | None:
        """Visits (k,) that share the model's errors of each pose; None where nothing is shared."""
        if not self.noise.shares:
            return None
        sliding = self.geometry.robot.slides
        return shared_visits(plan.q, plan.repeats, sliding, self.noise.within, plan.wrench)

    @cached_property
    def _rows(self) -> PositionRows:
        return PositionRows(self.geometry, self.loads, self.noise, self.sight)

    def rows(self, x: Array, visits: Array | None = None, read: Mask | None = None) -> Array:
        """Whitened rows (m, r markers, p) of experiments x (m, v), for one unit of costs each."""
        q, wrench = self._visits(x)
        A = self._rows(q, wrench, visits, read)
        return A if self.prices is None else A * self.shares(x)[:, None, None]

    def slopes(
        self, x: Array, B: Array, visits: Array | None = None, read: Mask | None = None
    ) -> Array:
        """Derivatives (m, v) of ``<B, rows>`` by all design variables, weights B held fixed."""
        q, wrench = self._visits(x)
        changes = self.load.derivative(x[:, q.shape[1] :])
        weights = B * self.shares(x)[:, None, None]
        return self._rows.slopes(q, wrench, weights, changes, visits, read)

    def polynomials(self) -> RowPolynomials:
        """Rows as polynomials, with errors that are no larger than those in any pose.

        All rows are read: a bound with rows that may be hidden holds without them, too.

        Raises:
            NotEnclosedError: A row is no polynomial.
        """
        model = self.geometry
        lever = model.robot.reach + float(np.linalg.norm(model.offsets, axis=1).max())
        noise = self.noise.least([lever] * len(model.markers))
        rows = PositionRows(model, self.loads, noise)
        order, largest, lever = rows.enclosable(self.load.wrench(_largest_load(self.load)))
        own = replace(self, noise=noise, sight=None)
        is_white = self.noise.is_white and self.sight is None
        return RowPolynomials(self, own.rows, order, largest, lever, is_white)

    def _visits(self, x: Array) -> tuple[Array, Array]:
        """Poses (m, n) and wrenches (m, 6) of experiments."""
        n = len(self.fixed)
        return x[:, :n], np.array(self.load.wrench(x[:, n:]))


def _largest_load(load: Load) -> Array:
    """Variables (s, d) of loads, than which no other is larger."""
    if isinstance(load, ListedLoad):
        return np.arange(len(load.wrenches), dtype=float)[:, None]
    return np.eye(1, load.limits.shape[1])


@dataclass(frozen=True, eq=False)
class GeometryExperiments(Experiments):
    """Visits x (..., v) of a space of geometry.

    Args:
        space: The design space.
        x: Design variables (..., v).
        frames: Frames of the robot's chain in these poses.
    """

    space: GeometrySpace

    def __getitem__(self, chosen: Indices) -> "GeometryExperiments":
        """The chosen experiments (n, v)."""
        visits = None if self.visits is None else self.visits[chosen]
        held = None if self.held is None else self.held[:, chosen]
        return GeometryExperiments(self.space, self.x[chosen], self.frames[chosen], visits, held)

    @property
    def _flat(self) -> tuple[Array | None, Mask | None]:
        """Visits (m,) of all experiments, one after another, and which rows (m, k r) they read."""
        visits = None if self.visits is None else self.visits.reshape(-1)
        return visits, None if self._read is None else self._read.reshape(len(self._read), -1).T

    @cached_property
    def regressor(self) -> Array:
        """Whitened rows (..., r markers, p)."""
        A = self.space.rows(self.x.reshape(-1, self.x.shape[-1]), *self._flat)
        return A.reshape(*self.x.shape[:-1], *A.shape[1:])

    @cached_property
    def _regressor(self) -> Array:
        """The same, component first (p, r markers, ...)."""
        return np.moveaxis(self.regressor, (-1, -2), (0, 1))

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v) of ``<B, A>`` of the whitened rows A, weights B held fixed."""
        flat = self.x.reshape(-1, self.x.shape[-1])
        weights = np.broadcast_to(B, self.regressor.shape).reshape(len(flat), *B.shape[-2:])
        return self.space.slopes(flat, weights, *self._flat).reshape(self.x.shape)
