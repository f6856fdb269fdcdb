"""How what is uncertain in a calibration moves its compliances, and the budget of errors."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.calibration.model_left import ModelLeft
from edtk.calibration.told_part import Inverse, LeastSquaresInverse
from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.scene import Displacements, Scene
from edtk.findings.fitted_data import FittedData
from edtk.findings.match_plan import some_rows
from edtk.findings.moving_joints import ReadingNoise
from edtk.findings.prior import unstated
from edtk.fit.measurements import Measurements
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import (
    AssumedError,
    AssumedJoint,
    ErrorBudget,
    JointPart,
    with_rigid,
)
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import Parameter
from edtk.measure.task import Columns, ErringColumns, Task, Tasks
from edtk.robots.weights import DeadWeights
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, StudyLoads
from edtk.study.study_model import assumed_joints, payload_beside_load
from edtk.system.typing import Array, Indices, Mask

TOOL = ("tool_x", "tool_y", "tool_z")
DIRECTION = ("load_direction",)
ESTIMATED = ("noise", "model", "known_joints")  # parts whose covariance is that of a posterior
# Parts that no sheet tells, as little as the size of a load.
NO_SHEET_TELLS = ("repeatability", "rigid_joints", "known_joints")
MOST_ROWS = 5000  # measurements over which the circumstances are propagated


@dataclass(frozen=True)
class Uncertainty:
    """How well the circumstances of a calibration are known: standard deviations.

    Attributes:
        load_size: Relative, of the size of the calibration load; 0.01 is one per cent.
        load_direction: Of its direction, about each axis across it [rad].
        tool: Of the calibration tool point, and the marker on it, along each axis [m].
        drift: Of a shift between unloaded and loaded readings that all rows share, along each axis
            [m].
        repeatability: Of the robot between an unloaded and a loaded reading, along each axis [m].
        joints: The joints that are not identified, and how far each may be off.
    """

    load_size: float = 0.01
    load_direction: float = float(np.deg2rad(1.0))
    tool: float = 1e-3
    drift: float = 0.0
    repeatability: float = 0.0
    joints: tuple[AssumedJoint, ...] = ()


@dataclass(frozen=True, eq=False)
class Propagation:
    """Errors of all compliances that commands rest on, by what causes them.

    Of each cause there is a root E (p + a, c): its columns are the errors, estimated or taken less
    true, that independent circumstances of one standard deviation make. The first p rows are those
    of the estimates, the others of the joints that are not identified. A part of the error in a
    task is ``|A0 E|``, and the covariance of all errors is the sum of ``E E'``.

    Attributes:
        unknown: Indices (p,) of the joints that are identified.
        assumed: The joints (a,) that are not.
        k: Compliances (p + a,) of both, as the commands take them [rad/(N m)].
        roots: The errors by cause [rad/(N m)]; causes are the parts of an `ErrorBudget`.
        told: With which standard deviations (a + c,) the measurements would tell the joints that
            are not identified, and those of `counted`, by their noise, if these were unknown, one
            at a time [rad/(N m)].
        counted: Known joints (c,) that are among the estimates, with the deviations that are left;
            the last columns of `known_joints` are theirs.
        absolute: Whether displacements are counted from the rigid robot.
        visits: What else there is of visits of geometry; None for displacements.
        beside: Root (p + a, c) of the errors by what a sheet cannot tell: the size of the load,
            repeatability, and the joints that are not identified.
        model: What noise, errors of the model, and what else a sheet can tell leave; None where
            the model counts as exact.
    """

    unknown: tuple[int, ...]
    assumed: tuple[AssumedJoint, ...]
    k: Array
    roots: dict[str, Array]
    told: tuple[float, ...] = ()
    counted: tuple[AssumedJoint, ...] = ()
    absolute: bool = False
    visits: "OfVisits | None" = None
    beside: Array | None = None
    model: ModelLeft | None = None

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        data: Measurements,
        k: Array,
        covariance: Array,
        uncertainty: Uncertainty,
        repeats: Indices | Array | None = None,
        prior: PriorRows | None = None,
        payload: DeadWeights | None = None,
    ) -> "Propagation":
        """Propagate what is uncertain in a calibration to its estimates, to the first order.

        A circumstance u changes the measurements by ``D u`` with ``D = d(A k)/du``, the estimate by
        ``A+ D u`` with the weighted least-squares inverse A+, and the tool point after compensation
        by ``A0 A+ D u``. A joint that is not identified and has c more than is taken adds ``A_j c``
        to the measurements and ``A0_j c`` to the task: its error is ``(A0 A+ A_j - A0_j) c``.

        Args:
            model: The robot with its calibration tool, and the measured rows.
            data: Poses, loads, markers and noise of the calibration; measured values are not used.
            k: Compliances (p,), identified or assumed [rad/(N m)].
            covariance: Their covariance (p, p) by the noise.
            uncertainty: How well the circumstances are known, and the joints that are not
                identified.
            repeats: Repetitions (m,) that each row stands for; one by default.
            prior: What else is known of the compliances, where the estimate rests on that, too.
            payload: A payload beside the load, whose mass is as uncertain as the load's size.

        Raises:
            SingularPlanError: The poses do not identify all parameters.
        """
        A = data.regressor(model)
        inverse = LeastSquaresInverse.of(model, data, A, prior)
        others = uncertainty.joints
        known = {one.index: one.compliance for one in uncertainty.joints if not one.rigid}
        scene = Displacements(model, data, A, k, known, prior is not None)
        told = Others.of(inverse, [scene.compliant(one.index) for one in others], others)
        load = told.below(k[:, None])  # compliances take up a load of another size in full
        for columns_of_load in shown_by(scene, "load_size"):
            load = told.shifts(columns_of_load)
        carried = told.shifts(_by_weights(model, data, k, known, payload))
        given = uncertainty
        of_load = [given.load_size * load, given.load_size * carried]
        roots = {
            "noise": told.below(root_of(covariance)),
            "load": np.hstack([*of_load, given.load_direction * shifts_by(told, scene, DIRECTION)]),
            "tool": given.tool * shifts_by(told, scene, TOOL),
            "drift": given.drift * told.shifts(scene.shift),
            "repeatability": given.repeatability
            * told.below(_readings(inverse, data.lengths, repeats)),
            "rigid_joints": told.rigid,
            "known_joints": told.known,
        }
        return cls(
            unknown=tuple(int(j) for j in model.joints),
            assumed=told.joints,
            k=np.append(k, [one.compliance for one in others]),
            roots=roots,
            told=tuple(map(inverse.told, told.columns)),
            absolute=data.absolute,
            beside=np.hstack([*of_load, *(roots[name] for name in NO_SHEET_TELLS)]),
        )

    @property
    def p(self) -> int:
        """Number of parameters that are estimated."""
        return len(self.unknown) if self.visits is None else self.visits.model.p

    @property
    def joints(self) -> tuple[int, ...]:
        """Indices (p + a,) of all joints whose compliances are taken."""
        return (*self.unknown, *(one.index for one in self.assumed))

    @property
    def measured(self) -> Array:
        """Covariance (p, p) of the estimates by all causes but the joints of `assumed`."""
        of_joints = ("rigid_joints", "known_joints")
        every = [E[: len(self.unknown)] for name, E in self.roots.items() if name not in of_joints]
        return np.asarray(np.hstack(every) @ np.hstack(every).T)

    @property
    def covariance(self) -> Array:
        """Covariance (p + a, p + a) of all compliances by all that is uncertain."""
        E = np.hstack(list(self.roots.values()))
        return np.asarray(E @ E.T)

    @property
    def errors(self) -> tuple[AssumedError, ...]:
        """The joints that are not identified, and what they do to the estimates."""
        E = self.roots["known_joints"]
        shifts = self.of_joints.T.copy()
        for i, one in enumerate(self.assumed):
            if not one.rigid and one.std > 0:
                own = len(self.unknown) + i
                shifts[i] = -E @ E[own] / one.std  # what goes with an error of this joint
        return tuple(map(AssumedError, self.assumed, shifts[:, : len(self.unknown)]))

    def budget(self, tasks: Tasks, model_error: float = 0.0) -> ErrorBudget:
        """The error in some tasks, in parts.

        Args:
            tasks: Where the robot shall be accurate.
            model_error: Error that the linear model leaves [m].
        """
        A0 = self._target(tasks)
        parts = {name: float(np.linalg.norm(A0 @ E)) for name, E in self.roots.items()}
        for name, size in ({} if self.visits is None else self.visits.there(tasks)).items():
            parts[name] = float(np.hypot(parts.get(name, 0.0), size))
        if self.model is not None and self.beside is not None:
            whole = self.model.size(tasks) ** 2
            parts |= _as_told(parts, whole, float(np.square(A0 @ self.beside).sum()))
        parts["model"] = float(np.hypot(parts.get("model", 0.0), model_error))
        of_joints = np.linalg.norm(A0 @ self.of_joints, axis=0)
        own = slice(self.p, self.p + len(self.assumed))
        every = map(JointPart, (*self.assumed, *self.counted), of_joints.tolist(), self.told)
        before = with_rigid(np.linalg.norm(A0 @ self.k), A0[:, own], self.assumed)
        return ErrorBudget(
            **parts,
            uncompensated=float(before),
            absolute=self.absolute,
            joints=tuple(sorted(every, key=lambda part: part.joint.index)),
        )

    @property
    def of_joints(self) -> Array:
        """Errors (p + a, a + c) by each joint that is not identified, and by the counted ones."""
        joints = (*self.assumed, *self.counted)
        found = np.zeros((len(self.k), len(joints)))
        rigid = np.array([one.rigid for one in joints], dtype=bool)
        found[:, rigid] = self.roots["rigid_joints"]
        found[:, ~rigid] = self.roots["known_joints"]
        return found

    def known_errors(self, asked: Study, tasks: Tasks) -> dict[str, tuple[float, float]]:
        """What known compliances without a standard deviation do, see `unstated_findings`.

        Args:
            asked: The study, with the values before.
            tasks: Where the robot shall be accurate.

        Returns:
            By joint, what is left of its standard deviation [rad/(N m)], and the error that goes
            with it [m].
        """
        E = np.hstack([self.roots[name] for name in ESTIMATED if name in self.roots])
        A0 = self._target(tasks)
        own = {name: E[self._row_of(name)] for name in unstated(asked)}
        std = {name: float(np.linalg.norm(row)) for name, row in own.items()}
        return {
            name: (std[name], float(np.linalg.norm(A0 @ (E @ row))) / std[name])
            for name, row in own.items()
            if std[name]
        }

    def _row_of(self, name: str) -> int:
        """The row of a joint's own compliance."""
        every = () if self.visits is None else self.visits.model.parameters
        springs = [one.of if one.place == "compliance" else None for one in every]
        if name in springs:
            return springs.index(name)
        return self.p + [one.name for one in self.assumed].index(name)

    def _target(self, tasks: Tasks) -> Array:
        """How all that may be in error moves the tool in tasks, see `Tasks.target`."""
        # One target of all: that of a neighbourhood is a triangle, without rows of poses.
        whose = tasks.with_unknown(self.joints) if self.visits is None else self.visits.of(tasks)
        return whose.target

    def totals(self, tasks: Tasks, model_errors: Array) -> Array:
        """The total error (t,) in each task by itself [m].

        Args:
            tasks: Where the robot shall be accurate.
            model_errors: Errors (t,) that the linear model leaves [m].
        """
        each = zip(tasks, model_errors, strict=True)
        return np.array([self.budget(Tasks([task]), float(error)).total for task, error in each])


@dataclass(frozen=True, eq=False)
class OfVisits:
    """What errors of a calibration by visits do in tasks, about the drawing.

    Attributes:
        setting: Markers, noise and loads of the study.
        model: The parameters (p,) that are estimated.
        discrepancy: What the model leaves out of a coordinate, at one standard deviation [m].
        beside: Parameters that are taken as they are: joints (a,) that are not identified, and
            where markers are that count as known.
    """

    setting: StudyGeometry
    model: MeasuredModel
    discrepancy: float
    beside: tuple[Parameter, ...] = ()

    @property
    def _every(self) -> MeasuredModel:
        """All parameters of which something may be in error."""
        return self.model.with_parameters((*self.model.parameters, *self.beside))

    def of(self, tasks: Tasks) -> Tasks:
        """Tasks in which errors of these do harm, in SI units."""
        return tasks.with_columns(self._columns)

    def _columns(self, task: Task) -> Columns:
        every, loads = self._every, self.setting.every_load_of(task)
        own = self._about(task, self.model, loads)
        beside = self._about(task, every, self.setting.untold(loads))
        p = self.model.p

        def columns(q: Array, turned: bool) -> Array:
            both = [own(q, turned), beside(q, turned)[..., p:]]
            return np.asarray(np.concatenate(both, axis=-1) / every.scales)

        return columns

    def _about(self, task: Task, model: MeasuredModel, loads: StudyLoads) -> ErringColumns:
        """How what counts in a task moves with a model's parameters, about the drawing."""
        return self.setting.columns(task, model, loads)

    def there(self, tasks: Tasks) -> dict[str, float]:
        """Errors in the tasks themselves, by no parameter: of the model, and of the joints [m]."""

        def motion(task: Task) -> Columns:
            return self.setting.columns(task, self.model).by_joints

        s = np.asarray(self.setting.noise.joints) / 1e3
        moved = float(np.linalg.norm(tasks.with_columns(motion).target * s)) if s.any() else 0.0
        return {"model": float(np.sqrt(3) * self.discrepancy), "repeatability": moved}


def _as_told(parts: Mapping[str, float], whole: float, untold: float) -> dict[str, float]:
    """Parts of the error by circumstances, as a sheet tells them, and by the model.

    The sheet may tell a tool point, the direction of a load or a drift better than the study does:
    what it leaves of all that it tells is then less than they would make by themselves. Where it
    leaves more, they count in full, and the model has the rest.

    Args:
        parts: Errors by the circumstances as the study states them [m].
        whole: Square of what the sheet leaves of all that it tells: these, noise and model [m^2].
        untold: Square of what it cannot tell [m^2].
    """
    size = max(untold - sum(parts[name] ** 2 for name in NO_SHEET_TELLS), 0.0)  # by the load's size
    doubts = {"load": max(parts["load"] ** 2 - size, 0.0)}
    doubts |= {name: parts[name] ** 2 for name in ("tool", "drift")}
    noise = min(parts["noise"] ** 2, whole)
    left, stated = whole - noise, sum(doubts.values())
    share = min(left / stated, 1.0) if stated else 1.0
    found = {name: float(np.sqrt(share * one)) for name, one in doubts.items()}
    found["load"] = float(np.hypot(found["load"], np.sqrt(size)))
    found["model"] = float(np.sqrt(max(left - stated, 0.0)))
    return found | {"noise": float(np.sqrt(noise))}


def root_of(covariance: Array) -> Array:
    """A root E (p, p) with ``E E'`` the covariance, scaled first: units differ by powers of ten."""
    return root_of_difference(covariance, np.zeros_like(covariance))


def root_of_known(std: Array, precision: Array) -> Array:
    """A root R (c, c) with ``R R' = S W^-1 S``: what is left open of values that were known.

    Args:
        std: Their standard deviations S (c,) before.
        precision: W (c, c), the inverse of the covariance that is left, in units of these: one
            before any measurement, to which ``S N N' S`` is added by their columns N.
    """
    values, vectors = eigenpairs(precision)
    return np.asarray(std[:, None] * ((vectors / np.sqrt(values)) @ vectors.T))


def apart_from_known(
    covariance: Array, known: Indices, std: Array
) -> tuple[Array, Array, tuple[float, ...]]:
    """Split the covariance V (p, p) of estimates by noise and by what was known before.

    With the known parameters b exact, the others have the covariance ``V - V_b V_bb^-1 V_b'``; the
    rest is by what is not told of b, of which V_bb is the covariance. With the roots
    ``R R' = V_bb`` of `Others` it is that of ``E = V_b R'^-1``. Measurements alone have the
    information ``V_bb^-1 - S^-2`` of them.

    Args:
        covariance: Of the estimates.
        known: Which of them (c,) were known before.
        std: Their standard deviations (c,) then.

    Returns:
        Roots (p, p) by noise, and E (p, c); the deviations (c,) with which measurements tell each
        of them.
    """
    left = covariance[np.ix_(known, known)] / np.outer(std, std)
    W = np.asarray(np.linalg.inv(left), dtype=float)
    E = np.asarray(np.linalg.solve(root_of_known(std, W), covariance[known]).T, dtype=float)
    more = np.maximum(np.diag(W) - 1, 0.0)
    told = np.divide(std, np.sqrt(more), out=np.full(len(std), np.inf), where=more > 0)
    return root_of_difference(covariance, E @ E.T), E, tuple(told.tolist())


def root_of_difference(whole: Array, part: Array) -> Array:
    """A root E (p, p) of what a covariance has beside a part of it."""
    std = np.sqrt(np.diag(whole))
    scale = np.where(std > 0, std, 1.0)
    values, vectors = eigenpairs((whole - part) / scale / scale[:, None])
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


@dataclass(frozen=True, eq=False)
class Others:
    """The joints that are not identified, and what measurements tell of the known ones.

    With the columns B of the known joints, whitened and freed of those that are identified (rows
    ``N`` here), and their standard deviations S before, the covariance of what is known of them is
    ``P = (S^-2 + N N')^-1 = S (1 + S N N' S)^-1 S``. An error e of theirs goes with the error
    ``-A+ B e`` of the estimates, so that ``(A+ B; -1) root(P)`` is a root of both. A change y of
    the measurements moves them by ``P N y``.

    Attributes:
        inverse: The inverse of the joints that are identified.
        joints: The joints (a,), with the standard deviations that are left.
        columns: Their columns (m, rows) of the measurements.
        bend: Errors (p + a, a) by a unit of each: ``(A+ B; -1)``.
        N: Their whitened columns (a, coordinates) without what the estimates take up.
        R: Root (a, a) of P, with rows of zeros for joints that count as rigid.
    """

    inverse: Inverse
    joints: tuple[AssumedJoint, ...]
    columns: list[Array]
    bend: Array
    N: Array
    R: Array

    @classmethod
    def of(
        cls, inverse: Inverse, columns: list[Array], joints: tuple[AssumedJoint, ...]
    ) -> "Others":
        """The joints with their columns (m, rows) of the measurements."""
        p = inverse.p
        bend = np.zeros((p + len(joints), len(joints)))
        bend[p:] = -np.eye(len(joints))
        for i, column in enumerate(columns):
            bend[:p, i] = inverse.solve(column)
        N = np.array([inverse.left_of(column).ravel() for column in columns])
        S = np.array([0.0 if one.rigid else one.std for one in joints])
        R = root_of_known(S, np.eye(len(joints)) + S * (N @ N.T) * S[:, None])
        left = [
            one if one.rigid else replace(one, std=float(np.linalg.norm(row)))
            for one, row in zip(joints, R, strict=True)
        ]
        return cls(inverse, tuple(left), columns, bend, N, R)

    def below(self, E: Array) -> Array:
        """Errors (p + a, c) of the estimates (p, c) alone."""
        return np.pad(E, ((0, len(self.joints)), (0, 0)))

    def shifts(self, changes: Array) -> Array:
        """Shifts (p + a, c) of all compliances by c changes (m, rows, c) of measurements."""
        own = self.below(self.inverse.shifts(changes))
        if not self.R.any():
            return own
        each = np.moveaxis(changes, -1, 0)
        y = np.array([self.inverse.in_sigma(one).ravel() for one in each])
        return np.asarray(own - self.bend @ (self.R @ self.R.T @ (self.N @ y.T)))

    @property
    def rigid(self) -> Array:
        """Errors (p + a, r) by joints that count as rigid, and bend by a standard deviation."""
        p = len(self.bend) - len(self.joints)
        found = np.zeros((len(self.bend), sum(one.rigid for one in self.joints)))
        rigid = (i for i, one in enumerate(self.joints) if one.rigid)
        for place, i in enumerate(rigid):
            found[:, place] = self.joints[i].std * self.shifts(self.columns[i][..., None])[:, 0]
            found[p + i, place] -= self.joints[i].std
        return found

    @property
    def known(self) -> Array:
        """Errors (p + a, b) by what is not told of the known joints."""
        known = [not one.rigid for one in self.joints]
        return np.asarray(self.bend @ self.R[:, known])


def shown_by(scene: Scene, name: str) -> list[Array]:
    """What readings (m, rows, c) show of a unit of the sizes of a fault, by its models."""
    return [one.derivative_at_zero(scene.k) for one in scene.families(FAULTS[name].models)]


def shifts_by(told: Others, scene: Scene, names: tuple[str, ...]) -> Array:
    """Shifts (p + a, c) of all that is estimated by some faults of size one."""
    every = [told.shifts(one) for name in names for one in shown_by(scene, name)]
    return np.hstack([told.below(np.zeros((told.inverse.p, 0))), *every])


def _by_weights(
    model: ElastostaticModel,
    data: Measurements,
    k: Array,
    known: Mapping[int, float],
    weights: DeadWeights | None,
) -> Array:
    """What weights alone make of the readings (m, rows, 1) [m, rad]; nothing without any."""
    if weights is None:
        return np.zeros((*data.deflection.shape, 1))
    alone = replace(model, unknown=(*model.joints, *known), weights=weights)
    unloaded = replace(data, wrench=np.zeros_like(data.wrench))
    return unloaded.regressor(alone) @ np.append(k, list(known.values()))[:, None]


def _readings(
    inverse: LeastSquaresInverse, lengths: Mask, repeats: Indices | Array | None
) -> Array:
    """A root (p, p) of what independent shifts of every reading add to the covariance."""
    # A row's shift u enters the whitened measurements as W u, and the estimate by Q.
    Q = inverse.by_reading() * lengths[..., None]
    whitened = inverse.whitened
    if repeats is not None:
        Q = Q / np.sqrt(repeats[:, None, None])
    R: Array = np.array(np.linalg.qr(Q.reshape(-1, Q.shape[-1]), mode="r"))
    return np.asarray(np.linalg.solve(whitened.R, R.T) / whitened.scale[:, None])


def calibration_budget(fitted: FittedData, rho0_bias: float | None) -> ErrorBudget | None:
    """Propagate what is uncertain to the study's task; None without a test pose.

    Args:
        fitted: The measurements and their fit.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    study = fitted.study
    if not study.tasks:
        return None
    return propagation_of(fitted).budget(study.tasks, rho0_bias or 0.0)


def propagation_of(fitted: FittedData) -> Propagation:
    """How what is uncertain moves the estimates of a calibration.

    Of very many measurements some are taken, by chance, each of which stands for several: what the
    circumstances do is a mean over the measurements, known to about a per cent from so many.

    Args:
        fitted: The measurements and their fit.
    """
    data = fitted.data
    repeats = None
    if len(data) > MOST_ROWS:
        repeats = np.full(MOST_ROWS, len(data) / MOST_ROWS)
        data = data[some_rows(len(data), MOST_ROWS)]
    k = fitted.fit.k
    # An estimate that may as well be zero says nothing of its neighbours.
    told = np.where(k > fitted.fit.std, k, 0.0)
    uncertainty = uncertainty_of(fitted.study, told)
    found = Propagation.of(
        fitted.study.model,
        data,
        k,
        fitted.noise_covariance,
        uncertainty,
        repeats,
        fitted.told_before if fitted.untold else None,
        payload_beside_load(fitted.study),
    )
    left = ModelLeft.of(fitted, found.beside)
    if left is None:
        return found
    own = root_of_difference(fitted.fit.covariance, fitted.noise_covariance)
    roots = {**found.roots, "model": np.pad(own, ((0, len(found.assumed)), (0, 0)))}
    return replace(found, roots=roots, model=left)


@dataclass(frozen=True, eq=False)
class FittedSprings:
    """What a prediction of displacements needs: compliances, and how well they are known.

    Attributes:
        joints: Indices (a,) of the joints that are not taken as rigid for certain.
        k: Their compliances (a,), without the bound at zero [rad/(N m)].
        root: Root E (a, c) of their covariance ``E E'`` by the noise of the calibration and by
            joints that were not identified [rad/(N m)].
        dof: Degrees of freedom of the covariance.
        open: Errors (a, o) by what the calibration left open, which are a part of the root.
        noise: By how much a further reading scatters.
        beside: Root (a, c) by what is neither noise nor model [rad/(N m)].
        model: What errors of the model leave; None where the model counts as exact.
    """

    joints: tuple[int, ...]
    k: Array
    root: Array
    dof: float
    open: Array
    noise: ReadingNoise
    beside: Array
    model: ModelLeft | None = None

    @classmethod
    def of(cls, fitted: FittedData, propagation: Propagation, rigid: Sequence[str]) -> Self:
        """Those of a calibration.

        Args:
            fitted: The measurements and their fit.
            propagation: How what is uncertain moves the estimates.
            rigid: Names of joints that count as rigid as the measurements leave them open.
        """
        beside = [propagation.roots[name] for name in ("rigid_joints", "known_joints")]
        own = [propagation.roots[name] for name in ("noise", "model") if name in propagation.roots]
        left = [one.name in rigid for one in propagation.assumed]
        k = propagation.k.copy()
        k[: len(fitted.fit.k)] = fitted.fit.unbounded
        return cls(
            propagation.joints,
            k,
            np.hstack([*own, *beside]),
            fitted.fit.covariance_dof,
            propagation.of_joints[:, left],
            fitted.reading_noise,
            np.hstack(beside),
            propagation.model,
        )


def uncertainty_of(
    study: Study, k: Array | None = None, untold: Collection[str] = ()
) -> Uncertainty:
    """The study's [uncertainty] in SI units.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints, see `assumed_joints` [rad/(N m)].
        untold: Unknown joints that no reading tells.
    """
    given = study.specification.uncertainty
    return Uncertainty(
        load_size=given.load_percent / 100,
        load_direction=float(np.deg2rad(given.load_direction_deg)),
        tool=given.tool_mm / 1e3,
        drift=given.drift_mm / 1e3,
        repeatability=given.repeatability_mm / 1e3,
        joints=assumed_joints(study, k, untold),
    )
