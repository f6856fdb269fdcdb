"""Which springs a sheet of a study with `[parameters]` needs beside those that it asks for."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.calibration.calibrate_geometry import calibrate_geometry
from edtk.calibration.extend import InTasks, Piece, Search, extension_of, law_sizes, with_pieces
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.model_left import ROWS
from edtk.findings.causes.evidence import ErringRows, Evidence
from edtk.findings.causes.faults import USUAL_ACROSS, is_one_of, lateral_axes
from edtk.findings.causes.scene import AXES
from edtk.findings.fitted_data import HowFitted
from edtk.fit.correlated_noise import CorrelatedNoise, whiten, whiten_columns
from edtk.fit.fitted_geometry import loading_of
from edtk.fit.measurements import Measurements
from edtk.fit.pose_rows import PoseRows
from edtk.measure.equilibrium import resting_load
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import springs_asked
from edtk.measure.pose_table import Table
from edtk.measure.task import Task
from edtk.robots.frames import MM
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices


def extend_geometry(study: Study, sheet: Table, how: HowFitted) -> GeometricCalibration:
    """Find the richest model that positions support, and calibrate with it.

    Its pieces are springs that the study might ask for: about the axes across its joints, and laws
    of its springs. Their columns stand beside those of all that is fitted, base, tools and geometry
    too; else they are weighed as in `extend`.

    Args:
        study: A study with `[parameters]` that asks for springs.
        sheet: The positions, absolute or of loaded readings less unloaded ones.
        how: How they are fitted.

    Raises:
        UserError: The study asks for no spring, or more than positions was fitted.
    """
    found = calibrate_geometry(study, sheet, how)
    beside = Beside(found)
    beside.check()
    extension = extension_of(beside.search, beside.in_tasks, (), beside.study_of)
    if extension.study is not study:
        found = calibrate_geometry(extension.study, sheet, how)
    return replace(found, extension=extension)


@dataclass(frozen=True, eq=False)
class Beside:
    """A fit of positions, and springs beside those of its study."""

    found: GeometricCalibration

    def check(self) -> None:
        """Check that the fit is one beside which springs can be weighed.

        Raises:
            UserError: It is not.
        """
        fit = self.found.fit
        model = fit.fitted.model
        if not (self._own and (fit.fitted.compliances > 0).any()):
            message = "no spring is told; expected joints in parameters.compliance"
        elif model.row_count != ROWS or model.is_distance.any():
            message = "pieces are weighed beside positions; leave orientations and distances out"
        elif fit.told_before is not None:
            message = "pieces are weighed by a sheet alone; leave known values and [prior] out"
        else:
            return
        raise UserError(f"--extend: {message}", where=self.found.path)

    @cached_property
    def _own(self) -> list[int]:
        """Indices of the joints' own springs among the fitted parameters."""
        parameters = self.found.fit.fitted.model.parameters
        return [i for i, one in enumerate(parameters) if one.place == "compliance"]

    @cached_property
    def _names(self) -> list[str]:
        """Springs that the study asks for."""
        study = self.found.study
        asked = study.kind.parameters(study).springs
        unknown = study.specification.joints.unknown
        every = springs_asked(study.robot, asked)
        own = {one.of for one in every if one.place == "compliance"}
        return [*asked, *(name for name in unknown if name not in own)]

    @cached_property
    def _tried(self) -> dict[str, tuple[float, bool]]:
        """Names of further springs, with their usual sizes and whether these are positive."""
        return dict(self._springs())

    def _springs(self) -> Iterator[tuple[str, tuple[float, bool]]]:
        """The same, one after another."""
        fitted, joints = self.found.fit.fitted, self.found.study.robot.joints
        there = {one.name for one in fitted.model.parameters}
        torque = np.abs(self._torque).max(axis=0)
        soft = np.maximum(fitted.compliances, 0.0)
        for joint, k, most in zip(joints, soft.tolist(), torque.tolist(), strict=True):
            across = USUAL_ACROSS * (k or float(soft[soft > 0].mean()))
            every = {f"r{AXES[axis]}": (across, True) for axis in lateral_axes(joint)}
            if k > 0 and most > 0:
                laws = law_sizes(joint.kind, k, most)
                every |= {law: (size, law == "gap") for law, size in laws.items()}
            named = {f"{joint.name}.{end}": usual for end, usual in every.items()}
            yield from ((name, one) for name, one in named.items() if f"k_{name}" not in there)

    @cached_property
    def _torque(self) -> Array:
        """Loads (m, n) of the joints in the visits, or their changes."""
        fit, loads = self.found.fit, self.found.setting.loads
        means = fit.data.means
        assert loads is not None
        changed = loads(means.q, means.wrench)
        before = loads(means.q, np.zeros_like(means.wrench))
        differs = means.is_difference[:, None]
        return np.asarray(np.where(differs, changed - before, changed))[:, : means.q.shape[1]]

    def study_of(self, chosen: frozenset[int]) -> Study:
        """The study with the pieces of a model; the same without any."""
        names = [self.search.pieces[i].name for i in sorted(chosen)]
        return self._with(names) if names else self.found.study

    def _with(self, names: list[str]) -> Study:
        """The study with further springs."""
        study = self.found.study
        given = dict(study.to_dict()["parameters"])
        given.pop("compliance", None)
        given["springs"] = list(dict.fromkeys([*self._names, *names]))
        return with_pieces(study, names, parameters=given)

    @cached_property
    def _setting(self) -> StudyGeometry:
        """The study with all springs that are tried."""
        return StudyGeometry.of(self._with(list(self._tried)), self.found.setting.markers)

    @cached_property
    def _model(self) -> MeasuredModel:
        """The fitted model with these springs last."""
        fitted = self.found.fit.fitted.model
        every = self._setting.model
        others = [one for one in every.parameters if one.name[2:] in self._tried]
        placed = replace(every, start=fitted.start, offsets=fitted.offsets)
        return placed.with_parameters((*fitted.parameters, *others))

    @cached_property
    def _theta(self) -> Array:
        """What is fitted, and zeros."""
        theta = self.found.fit.fitted.theta
        return np.concatenate([theta, np.zeros(self._model.p - len(theta))])

    @cached_property
    def _rows(self) -> PoseRows:
        """Residuals of the poses, and columns of all."""
        means = self.found.fit.data.means
        bending = self._model.bending(self._theta)
        torque = loading_of(bending, means, self._setting.loads)
        return PoseRows.of(self._model, self._theta, means, torque)

    def _split(self, columns: Array) -> tuple[Array, list[Array]]:
        """Columns (..., p) of what is fitted, and those (..., 1) of each piece, a unit in SI."""
        p = len(self.found.fit.fitted.theta)
        scaled = columns[..., p:] / self._model.scales[p:]
        return columns[..., :p], [scaled[..., [i]] for i in range(scaled.shape[-1])]

    def _bends(self, A: Array) -> Array:
        """What each spring of a joint does (..., s)."""
        values = np.maximum(self.found.fit.fitted.values[self._own], 0.0)
        return np.asarray(A[..., self._own] * values)

    @cached_property
    def search(self) -> Search:
        """The models of the sheet."""
        fit = self.found.fit
        means, rows = fit.data.means, self._rows
        A, pieces = self._split(rows.design)
        m, r = rows.residual.shape
        V = rows.errors(fit.fitted.noise.without_changes)
        white = CorrelatedNoise.by_row(V.dense)
        data = Measurements(
            means.q, means.wrench, rows.residual, np.ones((m, r)), np.zeros((m, ROWS))
        )

        def flat(columns: Array) -> Array:
            return whiten_columns(columns, white).reshape(m * r, -1)

        erring = ErringRows.of(data, self._bends(A), white)
        evidence = Evidence.of(erring, whiten(rows.residual, white).ravel(), flat(A))
        tried = tuple(
            Piece(name, pieces[i] / MM, np.array([self._tried[name][0]]), self._tried[name][1])
            for i, name in self._told.items()
        )
        whitened = tuple(flat(pieces[i]) for i in self._told)
        return Search(tried, evidence, whitened, A / MM, rows.residual / MM, data.pose)

    @cached_property
    def _told(self) -> dict[int, str]:
        """Numbers and names of the pieces that nothing which is fitted can make."""
        A, pieces = self._split(self._rows.design)
        names = [one.name[2:] for one in self._model.parameters[A.shape[-1] :]]
        every = enumerate(zip(names, pieces, strict=True))
        return {i: name for i, (name, one) in every if one.any() and not is_one_of(A, one)}

    @cached_property
    def in_tasks(self) -> InTasks | None:
        """What models say of the study's tasks; None without one that has a tool."""
        tasks = self.found.study.tasks
        if not tasks or any(task.tool is None for task in tasks):
            return None
        every = np.stack([self._in_task(task) for task in tasks]) / MM
        A, pieces = self._split(every)
        return InTasks(A, [pieces[i] for i in self._told], self._bends(A), tasks.shares)

    def _in_task(self, task: Task) -> Array:
        """Columns (3, p) of all in a task, for a unit of each [mm]; of places of markers zero."""
        assert task.tool is not None
        model = self._model.at_tool(task.tool)
        names = [one.name for one in self._model.parameters]
        kept: Indices = np.array([names.index(one.name) for one in model.parameters], dtype=int)
        q, theta = np.atleast_2d(task.q), self._theta[kept]
        bent = bool(model.robot.compensators)
        loads = self._setting.every_load_of(task)
        torque = resting_load(model.bending(theta), q, task.wrench[None], loads, bent)
        jacobian = model.see(theta, q, torque).jacobian
        assert jacobian is not None
        found = np.zeros((ROWS, len(names)))
        found[:, kept] = MM * jacobian[0, 0, :ROWS] * model.scales
        return found
