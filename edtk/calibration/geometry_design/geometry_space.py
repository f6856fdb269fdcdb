"""Where experiments of a study of geometry may lie, and what markers tell there."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.cell.sight import Sight
from edtk.design.design_space import DesignSpace, Experiments
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.robot_polynomials import RowPolynomials
from edtk.design.plan import Plan
from edtk.design.problem import Problem, rows_of_blocks
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.noise import MM2, PositionNoise, only_seen, shared_visits
from edtk.measure.nominal_columns import NominalColumns, PlacedColumns
from edtk.measure.parameters import LINEAR
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.loads.load import Load
from edtk.study.study_geometry import StudyLoads
from edtk.system.typing import Array, Indices, Mask

MM = 1e3
NOWHERE = np.zeros((1, 1, 3))  # of markers whose errors are the same everywhere
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
    noise: PositionNoise | None = None
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
    def is_white(self) -> bool:
        """Whether the errors of all coordinates are independent, and of positions alike."""
        return self.noise is None or self.noise.is_white

    @cached_property
    def _sigma(self) -> Array:
        """Their standard deviations (k r,) [mm, mrad]; one without noise."""
        noise = self.noise
        if noise is None:
            return np.ones(self._width)
        still = np.zeros((1, self._width, len(noise.joints)))
        V = replace(noise, tracker=None).of_reading(still, NOWHERE) + noise.of_model(still)
        return np.sqrt(np.diagonal(V[0]))

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
        return order, largest * self.scales / self._sigma.min(), lever

    def covariance(self, q: Array, wrench: Array, visits: Array | None = None) -> Array:
        """Covariances (m, k r, k r) [mm^2] by which rows are whitened, see `__call__`."""
        bent = self._bent(q, wrench)
        placed = self.columns.at(q)
        return self._covariance(placed, self._differs(wrench), visits, bent, self._read(q))

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

    def _block(self, q: Array, wrench: Array, visits: Array | None, read: Mask | None) -> Array:
        """The rows of a block of poses."""
        placed = self.columns.at(q)
        differs = self._differs(wrench)
        amplitudes = self._amplitudes(q, self._loadings(q, wrench))
        rows = self._rows(placed, amplitudes, differs)
        if read is not None:
            rows = rows * read[..., None]
        if self.is_white:
            return np.asarray(rows / self._sigmas(differs, visits)[..., None])
        return self._whitened(rows, placed, differs, visits, self._bent(q, wrench), read)

    def _differs(self, wrench: Array) -> Mask | None:
        """Which visits (m,) are differences of two readings; None for none."""
        if self.loads is None or not self.loads.reads_changes:
            return None
        return np.asarray(wrench.any(axis=1))

    def _sigmas(self, differs: Mask | None, visits: Array | None) -> Array:
        """Standard deviations (1 or m, k r) of what is read, where errors are independent."""
        if self.noise is None or (differs is None and visits is None):
            return self._sigma[None]
        m = next(len(one) for one in (differs, visits) if one is not None)
        still = np.zeros((m, self._width, len(self.noise.joints)))
        V = replace(self.noise, tracker=None).of_reading(still[:1], NOWHERE) * _counts(differs, m)
        V = V + _lifted(visits) * self.noise.of_model(still, differs)
        return np.asarray(np.sqrt(np.diagonal(V, axis1=1, axis2=2)))

    def _rows(self, placed: PlacedColumns, amplitudes: Array | None, differs: Mask | None) -> Array:
        """Rows (m, k r, p) in millimetres and milliradians."""
        J = placed.jacobian(amplitudes, differs)
        flat = J.reshape(self.model.p, -1, J.shape[-1])
        return np.asarray(np.moveaxis(flat, (0, 1), (2, 1)) * self.scales)

    def _whitened(
        self,
        rows: Array,
        placed: PlacedColumns,
        differs: Mask | None,
        visits: Array | None,
        bent: Array | None,
        read: Mask | None,
    ) -> Array:
        """Rows (m, r, p) in units of correlated noise."""
        L = np.linalg.cholesky(self._covariance(placed, differs, visits, bent, read))
        return np.asarray(np.linalg.solve(L, rows))

    def _covariance(
        self,
        placed: PlacedColumns,
        differs: Mask | None,
        visits: Array | None,
        bent: Array | None,
        read: Mask | None,
    ) -> Array:
        """Covariances (m, k r, k r) with which one of some visits of a pose counts."""
        noise = self.noise
        assert noise is not None
        motion = _motion(placed)
        places = np.moveaxis(placed.points, -1, 0)
        R = _counts(differs, len(motion)) * noise.of_reading(motion, places)
        D = noise.of_model(motion, differs)
        if noise.error is not None and bent is not None:
            bends = noise.error.bends(_by_component(motion), bent)
            D = D + np.moveaxis(noise.error.covariance(bends, noise.groups), -1, 0)
        V = np.asarray(R + _lifted(visits) * D)
        return V if read is None else only_seen(V, read)

    def _bent(self, q: Array, wrench: Array) -> Array | None:
        """Loads (n, m) of the joints of which the model's error is a share; None without one.

        They are changes where readings are differences.
        """
        if self.noise is None or self.noise.error is None:
            return None
        parts = [one.share * one.torque for one in self._loadings(q, wrench)]
        return np.asarray(sum(parts))[: q.shape[1]]

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
        visits: Array | None,
        read: Mask | None,
    ) -> Array:
        """The derivatives of a block of poses."""
        if read is not None:
            B = B * read[..., None]
        placed = self.columns.at(q)
        loadings = self._loadings(q, wrench)
        amplitudes = self._amplitudes(q, loadings)
        differs = self._differs(wrench)
        if self.is_white:
            weights, of_noise = B / self._sigmas(differs, visits)[..., None], np.zeros(q.shape)
            of_loads = np.zeros((q.shape[1], len(q)))
        else:
            rows = self._rows(placed, amplitudes, differs)
            if read is not None:
                rows = rows * read[..., None]
            given = (differs, visits, self._bent(q, wrench), read)
            weights, of_noise, of_loads = self._correlated(placed, rows, B, *given)
        by_motion, by_amplitudes = placed.slope(
            _component_first(weights * self.scales, len(self.model.markers)),
            amplitudes,
            differs,
        )
        found = by_motion.T + of_noise
        if self.loads is None:
            return np.concatenate([found, np.zeros((len(q), changes.shape[-1]))], axis=1)
        by_load = np.zeros((len(q), changes.shape[-1]))
        for one in loadings:
            weights = one.share * by_amplitudes
            by_torque, by_joints = self.model.answers.pulled_back(q.T, one.torque, weights)
            own = np.ascontiguousarray(by_torque.T)
            own[:, : q.shape[1]] += (one.share * of_loads).T
            found = found + by_joints.T + self.loads.slope(q, one.wrench, own)[:, : q.shape[1]]
            if one.wrench is wrench:
                each = np.moveaxis(changes, -1, 0)
                moved = [(own * self.loads.of_wrench(q, change)).sum(axis=1) for change in each]
                by_load = np.array(moved).reshape(-1, len(q)).T
        return np.concatenate([found, by_load], axis=1)

    def _correlated(
        self,
        placed: PlacedColumns,
        rows: Array,
        B: Array,
        differs: Mask | None,
        visits: Array | None,
        bent: Array | None,
        read: Mask | None,
    ) -> tuple[Array, Array, Array]:
        """Weights (m, r, p) of the rows in millimetres, and what the noise adds (m, n).

        ``d<B, L^-1 A> = <W, dA> - <W A' V^-1, dV>/2`` with ``W = L^-T B``; the covariance changes
        by ``dV = dT + dJ S J' + J S dJ'``, with the errors T of the tracker, which follow the
        markers, and the variances S of the joints. What springs leave out follows the loads of the
        joints, too: the weights (n, m) with which it does so are the third.
        """
        noise = self.noise
        assert noise is not None
        motion = _motion(placed)
        V = self._covariance(placed, differs, visits, bent, read)
        L = np.linalg.cholesky(V)
        W: Array = np.linalg.solve(np.swapaxes(L, 1, 2), B).astype(float, copy=False)
        Q = W @ np.swapaxes(np.linalg.solve(V, rows), 1, 2)
        variances = np.square(noise.joints)
        of_model = np.square(noise.model_joints) if len(noise.model_joints) else 0.0
        each = variances + _lifted(visits) * of_model
        if differs is not None:
            each = np.where(differs[:, None, None], 2 * variances, each)
        S = -0.5 * (Q + np.swapaxes(Q, 1, 2))
        C = _component_first(S @ (motion * each), len(self.model.markers))
        of_loads = np.zeros(C.shape[:1] + C.shape[-1:])
        if noise.error is not None and bent is not None:
            weights = np.moveaxis(_lifted(visits) * S / 2, 0, -1)
            by_component = _by_component(motion)
            given = noise.error.slope_weights(by_component, bent, weights, noise.groups)
            C = C + given[0].reshape(C.shape)
            of_loads = given[1]
        slope = placed.motion_slope(C).T
        if noise.tracker is not None:
            readings = np.ones(len(S)) if differs is None else 1.0 + differs
            slope = slope + self._tracked(placed, readings[:, None, None] * S / 2)
        return W, slope, of_loads

    def _tracked(self, placed: PlacedColumns, S: Array) -> Array:
        """Derivatives (m, n) of ``<S, T>`` by the joints, weights S (m, k r, k r) held fixed."""
        assert self.noise is not None
        assert self.noise.tracker is not None
        r = self.model.row_count
        seen = self.noise.sees(len(self.model.markers))
        own = np.stack([S[:, r * i : r * i + 3, r * i : r * i + 3] for i in seen])
        by_points = MM2 * self.noise.tracker.slope(placed.points[seen], np.moveaxis(own, 1, -1))
        return np.asarray(np.einsum("nkcm,kcm->mn", placed.by_joints[:, seen, :3], by_points))


def _some(visits: Array | None, part: slice) -> Array | None:
    """Visits of a block of poses."""
    return None if visits is None else visits[part]


def _lifted(visits: Array | None) -> Array:
    """Visits (m or 1, 1, 1) that multiply covariances."""
    return np.ones((1, 1, 1)) if visits is None else visits[:, None, None]


def _counts(differs: Mask | None, m: int) -> Array:
    """How many readings (m, 1, 1) the rows of poses are made of."""
    return np.ones((m, 1, 1)) if differs is None else 1.0 + differs[:, None, None].astype(float)


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


def _motion(placed: PlacedColumns) -> Array:
    """Motions (m, k r, n) of all coordinates by the joints [mm/mrad]."""
    n, _, _, m = placed.by_joints.shape
    return np.moveaxis(placed.by_joints.reshape(n, -1, m), (0, 1), (2, 1))


def _by_component(motion: Array) -> Array:
    """Motions (n, k r, m), component first, of those (m, k r, n)."""
    return np.ascontiguousarray(np.moveaxis(motion, (2, 1), (0, 1)))


def _component_first(A: Array, markers: int) -> Array:
    """Arrays (m, k r, c) as (c, k, r, m)."""
    m, _, c = A.shape
    return np.moveaxis(A, (2, 1), (0, 1)).reshape(c, markers, -1, m)


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
        errors: The errors of a visit.
        loads: What loads the joints; None without springs.
    """

    geometry: MeasuredModel
    errors: PositionNoise
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

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan under the plan's own wrenches; prices do not count.

        Visits of poses near each other share what the model leaves out, see `shared_visits`.
        """
        A = self._rows(plan.q, plan.wrench, self.visits_of(plan))
        return Problem(A, parameters=self.parameters, prior=self.prior).information(plan.repeats)

    def visits_of(self, plan: Plan) -> Array | None:
        """Visits (k,) that share the model's errors of each pose; None where nothing is shared."""
        if self.noise is None or not self.noise.shares:
            return None
        sliding = np.array([joint.kind == "prismatic" for joint in self.geometry.robot.joints])
        return shared_visits(plan.q, plan.repeats, sliding, self.noise.within, plan.wrench)

    @cached_property
    def _rows(self) -> PositionRows:
        return PositionRows(self.geometry, self.loads, self.errors, self.sight)

    def rows(self, x: Array, visits: Array | None = None, read: Mask | None = None) -> Array:
        """Whitened rows (m, r markers, p) of experiments x (m, v), for one unit of costs each."""
        q, wrench = self._visits(x)
        return self._rows(q, wrench, visits, read) * self.shares(x)[:, None, None]

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
        errors = _least_errors(self.errors, self.geometry)
        rows = PositionRows(self.geometry, self.loads, errors)
        order, largest, lever = rows.enclosable(self.load.wrench(_largest_load(self.load)))
        own = replace(self, errors=errors, sight=None)
        is_white = self.errors.is_white and self.sight is None
        return RowPolynomials(self, own.rows, order, largest, lever, is_white)

    def _visits(self, x: Array) -> tuple[Array, Array]:
        """Poses (m, n) and wrenches (m, 6) of experiments."""
        n = len(self.fixed)
        return x[:, :n], np.array(self.load.wrench(x[:, n:]))


def _least_errors(errors: PositionNoise, model: MeasuredModel) -> PositionNoise:
    """White errors that are no larger than those of any pose.

    Of a tracker that sees all markers they are those along the shorter axis of its ellipsoid, where
    it stands nearest.
    """
    white = replace(
        errors, joints=0.0 * errors.joints, model_joints=np.zeros(0), tracker=None, error=None
    )
    tracker = errors.tracker
    if tracker is None or len(errors.sees(len(model.markers))) < len(model.markers):
        return white
    lever = model.robot.reach + float(np.linalg.norm(model.offsets, axis=1).max())
    nearest = max(0.0, float(np.linalg.norm(tracker.position)) - lever)
    least = MM * min(a + b * nearest for a, b in (tracker.along, tracker.across))
    return replace(white, reading=float(np.hypot(errors.reading, least)))


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
