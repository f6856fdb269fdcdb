"""Identified geometry and springs, with everything that a person wants to know."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.calibration.model_left import LeftInTasks, PiecesLeft
from edtk.calibration.posterior_check import PosteriorCheck, compared_with_fit, pose_error
from edtk.calibration.propagation import Propagation
from edtk.calibration.result_file import MeasuredPoses, geometry_to_dict
from edtk.design.plan import Plan
from edtk.findings.causes.family import Cause
from edtk.findings.causes.faults import OTHER_ROWS, cause_of
from edtk.findings.counting import Counting
from edtk.findings.finding import Finding, Severity
from edtk.findings.geometric_fit import scale_in_words, scale_of
from edtk.findings.prior import unstated, unstated_findings
from edtk.fit.distributions import task_accuracy
from edtk.fit.fitted_geometry import FittedGeometry, GeometricFit, root_mean_square
from edtk.fit.geometry_posterior import (
    GeometryDensity,
    geometry_posterior,
)
from edtk.fit.least_squares import Estimate
from edtk.fit.noise import Noise
from edtk.fit.pose_rows import columns_of, measured_less_seen
from edtk.fit.posterior import Posterior, SamplingOptions
from edtk.fit.prior import Flat
from edtk.measure.expected_error import (
    ErrorBudget,
    TaskAccuracy,
    compensation_accuracy,
)
from edtk.measure.measured_model import Load
from edtk.measure.parameters import COMPONENTS
from edtk.measure.pose_table import coordinate_names
from edtk.measure.task import ErringColumns, Task, Tasks
from edtk.robots.frames import MM
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, study_marks
from edtk.study.study_model import own_weights
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


OWN_WEIGHTS = (
    "errors are as large as they were fitted; the fit weights coordinates more equally than the "
    "noise says, and its standard deviations are those of that"
)


@dataclass(frozen=True, eq=False)
class GeometricCalibration(Calibration):
    """Geometry, base, tools and springs that a sheet of positions tells, and whether to trust them.

    Attributes:
        setting: The study and its markers.
        fit: The fit, and how well it predicts poses that it did not see.
        counting: How the sheet counts the joints.
        left_out: Visits that were not fitted, as their positions are of no use.
        robust: Whether poses that fit badly count less.
        pieces: What the springs lack, where readings under loads tell it; None elsewhere.
        propagation: How what is uncertain moves what is estimated; None where it is not known.
    """

    setting: StudyGeometry
    fit: GeometricFit
    counting: Counting
    left_out: tuple[int, ...] = ()
    robust: bool = False
    pieces: PiecesLeft | None = None
    propagation: Propagation | None = None

    @property
    def base(self) -> Array:
        """Where the drawing's world is in the instrument's frame, as fitted (4, 4) [m].

        The errors of the base are shifts along, and turns about, the axes of its start.
        """
        model = self.fit.fitted.model
        errors = np.zeros(6)
        for one in model.parameters:
            if one.place == "base":
                errors[COMPONENTS.index(one.component)] = self.parameters[one.name]["value"] / MM
        moved = np.eye(4)
        moved[:3, :3] = rotation(errors[3:])
        moved[:3, 3] = errors[:3]
        return np.asarray(model.start @ moved)

    def headline(self) -> str:
        """Rank, how well poses are predicted, the error to expect, and the verdict."""
        expected = ""
        if self.extension is not None and np.isfinite(self.extension.expected):
            expected = f", {MM * self.extension.expected:.2g} mm expected {self.in_tasks.place}"
        elif self.budget is not None:
            expected = f", {MM * self.budget.total:.2g} mm expected {self.in_tasks.place}"
        return (
            f"{self.rank} parameters from {self.fit.data.count} positions of "
            f"{self.fit.data.poses} poses, rms {self.loo_rms_mm:.3g} mm left out{expected}; "
            f"verdict: {self.verdict}"
        )

    @property
    def study(self) -> Study:
        """The question."""
        return self.setting.study

    @property
    def rank(self) -> int:
        """Number of parameters that the sheet tells apart."""
        return self.fit.rank

    @property
    def loo_rms_mm(self) -> float:
        """Root mean square distance of poses that were left out one by one [mm]."""
        return MM * self.fit.loo_rms

    @property
    def covariance(self) -> Array:
        """Covariance (p, p) of the parameters, in their units."""
        return self.fit.fitted.covariance

    @cached_property
    def in_tasks(self) -> Tasks:
        """The study's tasks, in which errors of the identified parameters do harm."""
        fitted = self.fit.fitted

        def columns(task: Task) -> ErringColumns:
            loads = self.setting.loads_of(task)

            def torque(q: Array) -> Load | None:
                return fitted.torque(q, np.tile(task.wrench, (len(q), 1)), loads)

            return ErringColumns(fitted.model, fitted.theta, task.tool, torque)

        turned = (replace(task, q=self.counting.turned(task.q)) for task in self.study.tasks)
        return Tasks(turned).with_columns(columns)

    @cached_property
    def rho0_mm(self) -> float | None:
        """The error to expect in the tasks, geometry and load compensated [mm].

        It is the root mean square distance that wrong parameters leave, over the tasks with their
        weights; what the model leaves out comes on top of it. None without tasks.
        """
        if not self.in_tasks:
            return None
        return MM * float(compensation_accuracy(self.in_tasks.target, self.covariance))

    @cached_property
    def budget(self) -> ErrorBudget | None:
        """The error to expect in the tasks, in parts; None without tasks."""
        if not self.in_tasks or self.propagation is None:
            return None
        return self.propagation.budget(self.in_tasks, 0.0 if self.left is None else self.left.model)

    @property
    def rests_on_known(self) -> tuple[Finding, ...]:
        """Known compliances on which the budget rests, and whose deviation nobody stated."""
        if self.budget is None:
            return ()
        target = self.in_tasks.target
        errors = {
            name: (std, float(np.linalg.norm(target @ error)))
            for name, (std, error) in self.fit.fitted.going_with(unstated(self.study)).items()
        }
        return tuple(unstated_findings(self.study, errors, self.budget.total))

    @cached_property
    def tasks(self) -> TaskAccuracy | None:
        """Errors to expect in each of several tasks; None for one or none."""
        if len(self.in_tasks) < 2:
            return None
        is_path = self.study.specification.task is not None
        return task_accuracy(self.in_tasks, self.covariance, is_path=is_path)

    @cached_property
    def assumed(self) -> tuple[str, ...]:
        """What no reading of the sheet can tell, each with what it costs where it is wrong."""
        lines = [self._assumed_scale()]
        if not self.fit.fitted.bending.is_rigid:
            lines.append("the loads are as stated: 1 % of a load is 1 % of every compliance")
            links, _ = own_weights(self.study)
            if links is not None and not self.setting.reads_changes:
                lines.append("the links weigh what the robot's file says, and bend it in each pose")
        given = self.study.kind.parameters(self.study)
        if given.tool and any(task.tool is not None for task in self.in_tasks):
            lines.append(
                "a tool of the test poses sits on the last joint as drawn: markers whose places on "
                "it are unknown tell neither the zero of that joint nor its length"
            )
        return tuple(lines)

    def _assumed_scale(self) -> str:
        """What a scale of the instrument would cost, and how much of one the lengths may show.

        Where it is s, each length is taken as s times too long, and with these the way from the
        base to the tool: that comes s times too short.
        """
        far = self.study.robot.reach
        where = f"at {far:.2g} m"
        tasks = self.in_tasks
        if tasks:
            ends = [task.placed.forward(task.q)[..., :3, 3] for task in tasks]
            squares = [float(np.square(end).sum(axis=-1).mean()) for end in ends]
            far = float(np.sqrt(tasks.shares @ np.array(squares)))
            where = tasks.place
        told = scale_of(self.fit.of_positions, self.setting)
        come_out = ""
        if told is not None:
            come_out = f"; they come out {scale_in_words(told.size, told.std, told.known)}"
        return (
            "the scale of the instrument is right: all lengths would be wrong together, by "
            f"{1e-4 * MM * far:.2g} mm {where} for each 100 um/m{come_out}; a known length tells, "
            "as markers of which [prior.parameters] knows the places"
        )

    @cached_property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Value and standard deviation of each identified parameter, by name, in its unit."""
        fitted = self.fit.fitted
        return {
            one.name: {"value": float(value), "std": float(std), "unit": one.unit}
            for one, value, std in zip(
                fitted.model.parameters, fitted.values, fitted.std, strict=True
            )
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, in the units of their names, with all that predictions need."""
        fit = self.fit
        names = self.study.specification.joints.unknown
        k = fit.fitted.compliances
        joint_names = self.study.robot.joint_names
        std: dict[str, float | None] = dict.fromkeys(names)
        for one, size in zip(fit.fitted.model.parameters, fit.fitted.std, strict=True):
            if one.place == "compliance":
                std[one.of] = float(size * one.scale)
        return {
            "rank": self.rank,
            "structural_rank": fit.structural,
            "rms_mm": MM * fit.rms,
            "loo_rms_mm": self.loo_rms_mm,
            "rho0_mm": self.rho0_mm,
            "budget_mm": None if self.budget is None else self.budget.to_dict(),
            **({} if self.expected is None else {"expected_error": self.expected.to_dict()}),
            **({} if self.tasks is None else {"tasks": self.tasks.to_dict()}),
            "placed_rms_mm": MM * fit.placed,
            **self._turns(),
            "parameters": self.parameters,
            "redundant": list(fit.redundant),
            "open": list(fit.open),
            "share_inside_left_out": fit.share_inside,
            # A spring that the sheet does not tell is not known to be rigid.
            "k": {
                name: None if std[name] is None else float(k[joint_names.index(name)])
                for name in names
            },
            "std": std,
            "causes": [cause.to_dict() for cause in self.causes],
            **self.judgement(),
            "assumed": list(self.assumed),
            "geometry": {
                **geometry_to_dict(fit.fitted, self.counting),
                **self._told_before(),
                "study": self._marks(),
            },
            **self._model_error(),
            "poses": self.measured_poses.to_list(),
        }

    @property
    def causes(self) -> tuple[Cause, ...]:
        """A fault of the robot, the tool or the load that explains what positions leave."""
        of_rows = [cause_of(one) for one in self.findings if one.kind in OTHER_ROWS]
        told = [one.data.get("cause") for one in self.findings]
        return tuple(one for one in (*of_rows, *told) if one is not None)

    @property
    def k(self) -> dict[str, float]:
        """The compliances that the sheet tells, by joint [rad/(N m)]."""
        told = {one.of for one in self.fit.fitted.model.parameters if one.place == "compliance"}
        every = zip(self.study.robot.joint_names, self.fit.fitted.compliances, strict=True)
        return {name: float(k) for name, k in every if name in told}

    @property
    def measured_poses(self) -> MeasuredPoses:
        """The poses of the sheet, with the distances of its markers from the fit."""
        data = self.fit.data
        means = data.means
        plan = Plan(means.q, means.wrench, np.bincount(data.pose))
        return MeasuredPoses.of(
            plan, np.arange(len(means)), np.square(self.fit.residual).sum(axis=-1)
        )

    @cached_property
    def left(self) -> LeftInTasks | None:
        """Errors in the tasks by parameters and pieces; None where nothing tells these."""
        if self.pieces is None:
            return None
        return self.pieces.in_tasks(self.setting, self.fit.fitted)

    def _model_error(self) -> dict[str, Any]:
        """What the springs lack, and what is possible with it."""
        if self.pieces is None:
            return {}
        return {
            "model_error_mm": None if self.left is None else MM * self.left.model,
            "model_error": dict(self.pieces.shares),
            "possible_springs": self.pieces.to_dict(),
        }

    def _told_before(self) -> dict[str, list[str]]:
        """Parameters whose densities the result rests on, which are not to count again."""
        told = self.fit.told_before
        if told is None:
            return {}
        pairs = zip(self.fit.fitted.model.parameters, told.prior.marginals, strict=True)
        return {"told_before": [one.name for one, own in pairs if not isinstance(own, Flat)]}

    def sampled(
        self,
        rng: np.random.Generator,
        options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
    ) -> "GeometricCalibration":
        """The same calibration with the posterior, of the positions and what was known before.

        Args:
            rng: Source of randomness.
            options: How accurately a chain is sampled, and where it is kept: without a file only
                where parameters are few.

        Raises:
            UnconvergedError: The chain does not converge.
            ChainFileError: The file is no chain, or of another problem.
        """
        density = GeometryDensity.of(self.fit, self.setting.loads, self.robust)
        check = _check(self.fit.fitted, density, geometry_posterior(density, rng, options))
        found = check.posterior
        if self.in_tasks:
            fitted = self.fit.fitted
            used = Estimate(fitted.values, fitted.covariance)
            check = replace(
                check, pose=pose_error(self.in_tasks, used, found.evenly(), displaced=False)
            )
        findings = self.findings
        if not found.trusted:
            findings = (*findings, Finding(Severity.WARNING, "posterior", found.quality))
        return replace(self, check=check, findings=findings)

    def _marks(self) -> dict[str, Any]:
        """What tells whether a study that reads the result is the one that it was made for."""
        return {name: mark.tolist() for name, mark in study_marks(self.setting).items()}

    def _turns(self) -> dict[str, float]:
        """How well orientations fit and are predicted [deg], where they were measured."""
        turns = self.fit.turns
        if turns is None:
            return {}
        return {
            "turn_rms_deg": float(np.rad2deg(root_mean_square(turns.residual))),
            "turn_loo_rms_deg": float(np.rad2deg(root_mean_square(turns.left_out))),
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each identified parameter: `parameter`, `value`, `std`, `unit`, `meaning`."""
        import pandas as pd

        parameters = self.fit.fitted.model.parameters
        table = pd.DataFrame.from_dict(self.parameters, orient="index")
        table = table.rename_axis("parameter").reset_index()
        return table.assign(meaning=[one.words for one in parameters])

    def residuals(self) -> "pd.DataFrame":
        """A row for each pose and marker: residuals of the fit, and with the pose left out [mm].

        Those of a distance stand in columns of their own, which have no axis in their names.
        """
        import pandas as pd

        fit = self.fit
        pose, marker = np.nonzero(np.isfinite(fit.residual).any(axis=-1))
        is_distance = fit.fitted.model.is_distance[marker]
        columns: dict[str, Any] = {
            "pose": pose + 1,
            "marker": [fit.data.markers[i] for i in marker],
        }
        # Not x_mm and so on: a sheet with such columns is one with measurements.
        for name, values in (("residual_", fit.residual), ("left_out_", fit.left_out)):
            own = MM * values[pose, marker]
            for axis in range(3):
                columns[f"{name}{'xyz'[axis]}_mm"] = np.where(is_distance, np.nan, own[:, axis])
            if is_distance.any():
                columns[f"{name}mm"] = np.where(is_distance, own[:, 0], np.nan)
        turns = fit.turns
        if turns is not None:
            for name, values in (("residual_", turns.residual), ("left_out_", turns.left_out)):
                for axis in range(3):
                    degrees = np.rad2deg(values[pose, marker, axis])
                    columns[f"{name}r{'xyz'[axis]}_deg"] = degrees
        return pd.DataFrame(columns)


def _check(
    fitted: FittedGeometry, density: GeometryDensity, posterior: Posterior
) -> PosteriorCheck:
    """A posterior beside the fit, with what was measured [m, rad]."""
    means = density.means
    seen = fitted.model.see(fitted.theta, means.q, density.torque)
    measured = means.measured
    if means.turns is not None:
        turns = np.where(means.rows_seen[..., 3:, None], means.turns, np.eye(3))
        measured = np.concatenate([measured, rotation_vectors(turns)], axis=-1)
    measured = np.where(means.rows_seen, measured, np.nan).reshape(len(means), -1)
    apart = measured_less_seen(means, seen).reshape(measured.shape)
    there = means.present.ravel()
    names = [
        f"{marker} {name}" if count > 1 else marker
        for marker, count in zip(means.markers, means.present.sum(axis=1), strict=True)
        for name in coordinate_names(int(count))
    ]
    return PosteriorCheck(
        table=compared_with_fit(posterior, fitted.values, fitted.std),
        reference="identified",
        posterior=posterior,
        A=columns_of(fitted.model, means, seen).dense[:, there] / MM,
        measured=measured[:, there],
        sigma=density.std[:, there] / MM,
        noise=Noise(nu=np.inf if density.nu is None else density.nu),
        pose=None,
        coordinates=tuple(names),
        expected=(measured - apart)[:, there],
        remark=OWN_WEIGHTS,
    )
