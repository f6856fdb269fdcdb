"""How what is uncertain in a calibration by visits moves all that it estimates."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.calibration.propagation import (
    DIRECTION,
    TOOL,
    OfVisits,
    Others,
    Propagation,
    Uncertainty,
    apart_from_known,
    root_of,
    shifts_by,
    uncertainty_of,
)
from edtk.calibration.told_part import TAKEN_UP, Inverse
from edtk.findings.causes.scene import Positions
from edtk.findings.fit_rows import scene_of
from edtk.fit.fitted_geometry import (
    RIGID,
    UNTOLD,
    Circumstances,
    FittedGeometry,
    GeometricFit,
    loading_of,
)
from edtk.fit.pose_rows import PoseRows, known_before
from edtk.fit.same_poses import SamePoses
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.few_columns import Beside
from edtk.measure.measured_model import Load, MeasuredModel, Seen
from edtk.measure.parameters import AXES, Parameter, all_parameters
from edtk.measure.task import ErringColumns, Task, Tasks
from edtk.measure.whitening import Scatter
from edtk.robots.frames import MM
from edtk.study.study_geometry import StudyGeometry, StudyLoads
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits, planned or made, each by itself.

    Attributes:
        setting: The study.
        model: The parameters (p,) that are estimated.
        under: What the visits show, where some loads bend the joints.
        inverse: How the estimates follow readings.
        taken: Values (p,) of the parameters as commands take them, in SI units; in a plan those of
            [simulation], and the drawing.
    """

    setting: StudyGeometry
    model: MeasuredModel
    under: Callable[[StudyLoads], Positions]
    inverse: Inverse
    taken: Array

    @cached_property
    def scene(self) -> Positions:
        """What they show under all that loads the joints."""
        return self.under(self.setting.every_load)

    def by_load(self, told: Others, given: Uncertainty) -> Array:
        """Errors (p + a, c) by a load of another size or direction, and by another payload."""
        scene, loads = self.scene, self.setting.every_load
        if not scene.sprung or not scene.wrench.any():
            return np.zeros((len(told.bend), 1))
        sizes = [shifts_by(told, scene, ("load_size",))]
        if loads.payload is not None:
            both = self.under(replace(loads, links=None))
            alone = self.under(replace(loads, links=None, payload=None))
            sizes.append(told.shifts(((both.springs - alone.springs) @ scene.soft)[..., None]))
        direction = given.load_direction * shifts_by(told, scene, DIRECTION)
        return np.hstack([given.load_size * np.hstack(sizes), direction])

    def by_drift(self, told: Others, given: Uncertainty) -> Array:
        """Errors (p + a, 3) by a shift of the loaded readings."""
        if not given.drift:
            return np.zeros((len(told.bend), 3))
        loaded = np.any(self.scene.wrench, axis=1).astype(float)[:, None, None]
        return given.drift * told.shifts(self.scene.shift * loaded)

    def by_tool(self, told: Others, given: Uncertainty, known: tuple[Parameter, ...]) -> Array:
        """Errors (p + a + c, 3) by markers that are elsewhere, of which c places count as known.

        Where all places are unknown, these take up that the markers are elsewhere.
        """
        if not known:
            return np.zeros((len(told.bend), 3))
        moved = np.pad(given.tool * shifts_by(told, self.scene, TOOL), ((0, len(known)), (0, 0)))
        rows = [*self.model.parameters, *told.joints, *known]
        at = [(rows.index(one), AXES.index(one.component)) for one in self.places if one in rows]
        return _beside_places(moved, at, given.tool)

    @property
    def places(self) -> list[Parameter]:
        """Where the markers are, along the axes of what carries them."""
        pairs = zip(self.model.markers, self.model.is_distance, strict=True)
        names = [name for name, far in pairs if not far]
        return [Parameter("tool", name, axis) for name in names for axis in AXES]

    def bent(self, joints: Sequence[AssumedJoint]) -> list[Array]:
        """Columns (m, rows) of the springs of joints that are not identified."""
        scene = self.under(self.setting.untold(self.setting.every_load))
        if scene.loads is None or not scene.loads(scene.q, scene.wrench).any():
            return [np.zeros(scene.A.shape[:2]) for _ in joints]
        return [scene.compliant(one.index) for one in joints]


def propagated(
    visits: Visits, given: Uncertainty, covariances: Mapping[str, Array], where: OfVisits
) -> Propagation:
    """Propagate the circumstances of visits to what they estimate, in SI units.

    Args:
        visits: The visits.
        given: How well the circumstances are known.
        covariances: Of the parameters (p, p) by noise and model, in SI units.
        where: What errors do in tasks, as yet of the parameters alone.
    """
    model = visits.model
    estimated = {one.of: i for i, one in enumerate(model.parameters) if one.place == "compliance"}
    others = tuple(one for one in given.joints if one.name not in estimated)
    counted = tuple(one for one in given.joints if one.name in estimated)
    told = Others.of(visits.inverse, visits.bent(others), others)
    V = covariances["noise"]
    own = np.array([estimated[one.name] for one in counted], dtype=int)
    noise, known, told_alone = apart_from_known(V, own, np.array([one.std for one in counted]))
    left = np.sqrt(np.diag(V)[own]).tolist()
    roots = {
        **{name: told.below(root_of(V)) for name, V in covariances.items()},
        "noise": told.below(noise),
        "load": visits.by_load(told, given),
        "drift": visits.by_drift(told, given),
        "repeatability": told.below(np.zeros((model.p, 3))),
        "rigid_joints": told.rigid,
        "known_joints": np.hstack([told.known, told.below(known)]),
    }
    asked = visits.setting.model.parameters
    markers = tuple(one for one in visits.places if one not in asked)
    roots = {name: np.pad(E, ((0, len(markers)), (0, 0))) for name, E in roots.items()}
    joints = [one.name for one in others]
    springs = all_parameters(model.robot, (), (), joints, base=False, tool=False)
    return Propagation(
        unknown=(),
        assumed=told.joints,
        k=np.array([*visits.taken, *(one.compliance for one in others), *(0.0 for _ in markers)]),
        roots={**roots, "tool": visits.by_tool(told, given, markers)},
        told=(*map(visits.inverse.told, told.columns), *told_alone),
        counted=tuple(replace(one, std=std) for one, std in zip(counted, left, strict=True)),
        visits=replace(where, beside=(*springs, *markers)),
    )


def _beside_places(root: Array, own: list[tuple[int, int]], size: float) -> Array:
    """By how much estimates (r, 3) are beside markers that are elsewhere by a size on each axis.

    These are elsewhere in the tasks, too; an unknown place is found where it is.

    Args:
        root: Shifts (r, 3) of the estimates.
        own: Row and axis of each marker's place.
        size: How far the markers are elsewhere [m].
    """
    beside = root.copy()
    rows, axes = np.array(own, dtype=int).reshape(-1, 2).T
    beside[rows, axes] -= size
    return np.where(np.abs(beside) <= TAKEN_UP * size, 0.0, beside)


@dataclass(frozen=True, eq=False)
class FitInverse(Inverse):
    """How a fit of positions follows readings, to the first order.

    Changes of readings are in millimetres and milliradians, parameters in SI units.

    Attributes:
        beside: Design and weights of the fit, perhaps with rows of what was known before.
        work: The covariances that the weights are the inverse of.
        scales: Units (p,) of the parameters.
        same: Which rows of the visits these are of.
    """

    beside: Beside
    work: Scatter
    scales: Array
    same: SamePoses

    @classmethod
    def of(cls, setting: StudyGeometry, fit: GeometricFit) -> "FitInverse":
        """That of a fit, weighted by the noise that it found."""
        fitted, means = fit.fitted, fit.data.means
        before = None
        if fit.told_before is not None:
            before = known_before(fit.told_before.prior, fitted.model, fitted.theta)
        torque = loading_of(fitted.bending, means, setting.loads)
        rows = PoseRows.of(fitted.model, fitted.theta, means, torque, before)
        work = rows.working(rows.errors(fitted.noise), means).over(rows.weights(fit.weights))
        return cls(Beside.of(rows.columns, work), work, fitted.model.scales, means.same_poses)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.scales)

    def solve(self, change: Array) -> Array:
        """``(X' W X)^-1 X' W y``."""
        each = change.reshape(-1, *change.shape[-2:])
        y = self._below(np.moveaxis(each, 0, -1))
        onto = self.beside.design.onto(self.beside.weights.times(y))
        found = self.beside.root @ (self.beside.root.T @ onto)
        return np.asarray((found.T * self.scales).reshape(*change.shape[:-2], -1))

    def left_of(self, column: Array) -> Array:
        """What the design leaves."""
        if not column.any():
            return np.zeros(self.work.variances.shape)
        y = self._below(column[..., None])
        left, whole = self.beside.left(y), np.linalg.norm(self._whitened(y))
        found = self._whitened(left)
        return found if np.linalg.norm(found) > TAKEN_UP * whole else np.zeros_like(found)

    def in_sigma(self, change: Array) -> Array:
        """By a root of the weights."""
        return self._whitened(self._below(change[..., None]))

    def _below(self, rows: Array) -> Array:
        """Rows (m, r, c), and zeros for what was known before."""
        apart = self.same.apart(rows.reshape(*self.same.worth.shape, -1))
        rows = apart.reshape(*rows.shape[:2], -1)
        more = len(self.beside.design.part) - len(rows)
        return np.concatenate([rows, np.zeros((more, *rows.shape[1:]))])

    def _whitened(self, rows: Array) -> Array:
        """Rows (m, r, 1) in units of their noise (m, r)."""
        pairs = zip(self.work.dense, rows, strict=True)
        return np.array([np.linalg.solve(np.linalg.cholesky(V), y)[:, 0] for V, y in pairs])


@dataclass(frozen=True, eq=False, kw_only=True)
class OfFit(OfVisits):
    """What errors of a fit do in tasks, about what it found.

    Attributes:
        fitted: What was found.
    """

    fitted: FittedGeometry

    def _about(self, task: Task, model: MeasuredModel, loads: StudyLoads) -> ErringColumns:
        fitted = self.fitted
        theta = np.concatenate([fitted.theta, np.zeros(model.p - len(fitted.theta))])

        def torque(q: Array) -> Load | None:
            return fitted.torque(q, np.tile(task.wrench, (len(q), 1)), loads)

        return ErringColumns(model, theta, task.tool, torque)

    def there(self, tasks: Tasks) -> dict[str, float]:
        """Errors that come anew in each pose, as large as the fit has found them [m]."""
        each = [self._anew(task) for task in tasks]
        return {"model": float(np.sqrt(tasks.shares @ np.array(each)))}

    def _anew(self, task: Task) -> float:
        """Their mean square in a task [m^2]."""
        robot = at_task(self.fitted, task)
        q = np.atleast_2d(task.q)
        wrench = np.tile(task.wrench, (len(q), 1))
        seen, motion, _, _ = robot.moves(q, wrench, self.setting.loads_of(task))
        variances = np.einsum("mrr->mr", robot.anew(motion, seen.places, wrench))[:, robot.lengths]
        return float(variances.sum(axis=1).mean()) / len(robot.model.markers) / MM**2


def at_task(fitted: FittedGeometry, task: Task) -> FittedGeometry:
    """The robot with the tool of a task, or with the markers on the tool."""
    if task.tool is not None:
        return fitted.at_tool(task.tool)
    return fitted.of_markers(np.flatnonzero(fitted.model.on_tool))


def fit_propagation(
    setting: StudyGeometry, fit: GeometricFit, fitted: FittedGeometry
) -> Propagation:
    """Propagate the circumstances of a sheet to what was fitted, see `propagated`.

    Args:
        setting: The study.
        fit: The fit, by whose weights estimates follow readings.
        fitted: What was found, with the errors that it has without what springs lack.
    """
    means = fit.data.means
    model = fitted.model
    there = means.rows_seen.reshape(len(means), -1, 1)

    def read(seen: Seen, chosen: Indices) -> Array:
        assert seen.jacobian is not None
        return (
            MM * seen.jacobian.reshape(len(means), -1, seen.jacobian.shape[-1])[..., chosen] * there
        )

    def under(loads: StudyLoads) -> Positions:
        return scene_of(fitted, means.q, means.wrench, loads, read, means.is_difference)

    covariance = fitted.covariance * np.outer(model.scales, model.scales)
    return propagated(
        Visits(setting, model, under, FitInverse.of(setting, fit), fitted.theta),
        uncertainty_of(
            setting.study,
            _told_compliances(setting, fitted),
            untold_joints(setting, (*model.parameters, *fitted.open_parameters)),
        ),
        {"noise": covariance},
        OfFit(setting, model, 0.0, fitted=fitted),
    )


def untold_joints(setting: StudyGeometry, told: Iterable[Parameter]) -> tuple[str, ...]:
    """Unknown joints whose springs no pose tells, as no load turns them."""
    names = {one.of for one in told if one.place == "compliance"}
    return tuple(one for one in setting.study.specification.joints.unknown if one not in names)


def _told_compliances(setting: StudyGeometry, fitted: FittedGeometry) -> Array:
    """Those of the unknown joints; zero, which tells nothing of others, where they may be that."""
    told = {
        one.of: value
        for one, value, std in zip(
            fitted.model.parameters, fitted.theta, fitted.std * fitted.model.scales, strict=True
        )
        if one.place == "compliance" and value > std
    }
    return np.array([told.get(name, 0.0) for name in setting.study.specification.joints.unknown])


def circumstances_of(found: Propagation, setting: StudyGeometry) -> Circumstances:
    """What no reading of a sheet tells, in the units of the parameters."""
    assert found.visits is not None
    p, beside = found.p, found.visits.beside
    # What is exactly known is off by nothing.
    free = np.array([one.rigid or one.std > 0 for one in found.assumed], dtype=bool)
    kept = np.concatenate([np.ones(p, bool), free, np.ones(len(beside) - len(free), bool)])
    others = tuple(one for one, own in zip(beside, kept[p:], strict=True) if own)
    scales = np.array([one.scale for one in (*found.visits.model.parameters, *others)])
    roots = {name: found.roots[name][kept] / scales[:, None] for name in UNTOLD}
    return Circumstances(
        tuple(one for one, own in zip(found.assumed, free, strict=True) if own),
        others,
        {name: E for name, E in roots.items() if name == RIGID or E.any()},
        setting.every_load,
        setting.untold(setting.every_load),
    )
