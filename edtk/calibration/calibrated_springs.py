"""Compliances that a calibration has found: the commands, and the displacements they predict."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.compensate import Calibrated, Commanded, Compensation, band_of
from edtk.calibration.model_left import ModelLeft
from edtk.calibration.prediction import Columns, Prediction, beyond_limits, in_columns
from edtk.calibration.propagation import FittedSprings, root_of
from edtk.calibration.result_file import (
    OTHER_ROBOT,
    POSSIBLE,
    possible_springs,
    springs_of_dict,
)
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.calibration.tasks_in_use import ToolInUse, reading_findings
from edtk.design.plan import REPEATS
from edtk.findings.moving_joints import ReadingNoise
from edtk.findings.units import like_radians
from edtk.fit.distributions import NormalMixture, student_quantile
from edtk.fit.equilibrium import linearise
from edtk.fit.measurements import Measurements
from edtk.measure.compliances import Compliances
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import (
    NoEquilibriumError,
    Rest,
    compensated_joints,
    unloaded,
    why_no_rest,
)
from edtk.measure.expected_error import compensation_accuracy, remaining_error, with_rigid
from edtk.measure.pose_table import TURN_COLUMN, PoseTable, Table, coordinate_columns, path_of
from edtk.measure.task import all_compliances, rigid_joints
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints, study_sigma
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

BUCKLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


@dataclass(frozen=True, eq=False)
class CalibratedSprings(Calibrated):
    """A robot of which compliances were identified, and nothing else.

    Attributes:
        study: The study of the calibration.
        given: The calibration, or what its file holds; or compliances with what is known of them.
        where: The result, for messages.
    """

    study: Study
    given: "SpringCalibration | Compliances | Mapping[str, Any]"
    where: Path | str = "compliances"

    @cached_property
    def identified(self) -> Compliances:
        """Those that were identified, with their covariance by noise and model.

        Raises:
            UserError: The result is not valid, lacks a joint, or is of a robot with other
                compensators.
        """
        if isinstance(self.given, Compliances):
            return self.given
        content = self.given.to_dict() if isinstance(self.given, SpringCalibration) else self.given
        robot = self.study.robot
        needed = self.study.specification.joints.unknown
        found = Compliances.from_dict(content, robot.joint_names, needed, self.where)
        if found.compensators not in (None, robot.compensators_digest):
            message = "the result is of a robot with other compensators than the study's"
            raise UserError(message, where=self.where, key="prediction.compensators")
        return found

    @cached_property
    def every(self) -> Compliances:
        """The same with those of all other joints, and with all that is uncertain.

        Joints that have a compliance neither here nor among the known ones of the study count as
        rigid.
        """
        given = self.compliances
        k = np.array([given.get(name, 0.0) for name in self.study.specification.joints.unknown])
        return self.identified.including(assumed_joints(self.study, k))

    @cached_property
    def left(self) -> ModelLeft | None:
        """What errors of the model leave; None where nothing is known of them.

        Raises:
            UserError: What the result says of them is not valid.
        """
        return self._model(self.identified.possible)

    def _model(self, given: object, key: str = POSSIBLE) -> ModelLeft | None:
        """The same, as a file says it."""
        joints, n = self.study.model.unknown or (), self.study.robot.n
        return possible_springs(
            given, lambda table: ModelLeft.from_dict(table, joints, n), self.where, key
        )

    @property
    def compliances(self) -> Mapping[str, float]:
        """Those that were identified, by joint [rad/(N m)]."""
        return dict(zip(self.identified.joints, self.identified.k.tolist(), strict=True))

    def with_tool(self, tool: ToolInUse) -> "SpringsWithTool":
        """The same with the tool, and the weights, of some poses."""
        return SpringsWithTool(self, tool)

    def predict(self, poses: Table, tool_rows: int = 0) -> Prediction:
        """Predict displacements, see `predict_displacements`; no rows place anything."""
        springs, certain = self.fitted
        found = predict_displacements(self.study, springs, certain, poses)
        names = [self.study.robot.joint_names[j] for j in springs.joints]
        k = dict(zip(names, springs.k.tolist(), strict=True))
        return replace(found, other_units=reading_findings(self.study, k, found.data))

    @cached_property
    def fitted(self) -> tuple[FittedSprings, bool]:
        """Compliances with all that predictions need, and whether nothing is known of their errors.

        Raises:
            UserError: The result is not valid, or of another robot.
        """
        content = self.given
        if isinstance(content, SpringCalibration):
            return content.springs, False
        if isinstance(content, Compliances):
            return self._by_joint()
        given = content.get("prediction")
        if given is None and "geometry" in content:
            message = "a result of a study with [parameters]; this one has none"
            raise UserError(message, where=self.where)
        if given is None:
            return self._by_joint()
        if not isinstance(given, Mapping):
            raise UserError("expected a table", where=self.where, key="prediction")
        if given.get("robot") != self.study.robot.digest:
            raise UserError(OTHER_ROBOT, where=self.where, key="prediction.robot")
        try:
            springs = springs_of_dict(self.study.robot, given)
        except ValueError as error:
            raise UserError(str(error), where=self.where, key="prediction") from error
        return replace(springs, model=self._model(content.get(POSSIBLE), "prediction")), False

    def _by_joint(self) -> tuple[FittedSprings, bool]:
        """Compliances of a file that says no more, such as one written by hand.

        Raises:
            UserError: It is not valid, or lacks a joint.
        """
        found = self.identified
        known = found.covariance is not None
        own = found.covariance if known else np.zeros((len(found.k), len(found.k)))
        needed = self.study.specification.joints.unknown
        others = assumed_joints(self.study, np.array([self.compliances[name] for name in needed]))
        # The task's own uncertainties, of load and tool, are those of the day that is predicted.
        every = replace(found, covariance=own, measured=None, every=None).including(others)
        assert every.covariance is not None
        joints = tuple(map(self.study.robot.joint_names.index, every.joints))
        root = root_of(every.covariance)
        none = np.zeros((len(every.k), 0))
        springs = FittedSprings(
            joints, every.unbounded, root, found.covariance_dof, none, ReadingNoise(), none
        )
        return springs, not known


@dataclass(frozen=True, eq=False)
class SpringsWithTool(Commanded):
    """The robot with the tool of some task poses.

    The error before is that of the loaded equilibrium. The error after is the total of the error
    budget: what errors of the compliances leave, Eq. (17), by the noise and by all else that is
    uncertain in the calibration, and what joints that are not identified add, to first order.

    Attributes:
        springs: The compliances.
        tool: The tool.
    """

    springs: CalibratedSprings
    tool: ToolInUse

    @property
    def robot(self) -> Robot:
        """The chain with the tool."""
        return self.tool.robot

    @cached_property
    def model(self) -> ElastostaticModel:
        """What its joints do under loads."""
        robot, found = self.robot, self.springs.every
        joints = tuple(map(robot.joint_names.index, found.joints))
        return self.tool.model(joints, all_compliances(ElastostaticModel(robot, joints), found.k))

    @cached_property
    def k(self) -> Array:
        """Compliances (n,) of all joints [rad/(N m)]."""
        return all_compliances(self.model, self.springs.every.k)

    def commands(self, q: Array, wrench: Array) -> Array:
        """Joint variables (t, n), see `compensated_joints`."""
        return compensated_joints(self.model, q, wrench, self.springs.every.k)

    def why_no_rest(self, q: Array) -> str:
        """Why a pose (n,) does not come to rest, in words."""
        return why_no_rest(self.robot, q, self.k)

    def compensation(self, rows: Indices, q: Array, wrench: Array, command: Array) -> Compensation:
        """The commands (t, n) with the errors of the tool point.

        Raises:
            NoEquilibriumError: A pose buckles.
        """
        model, found = self.model, self.springs.every
        moved = self._moved(q, wrench)
        self._require_settled(q, wrench, command)
        offset = self._offset(q, wrench)
        A = model.regressor(q, wrench)
        names = self.robot.joint_names
        known = tuple(names[j] for j in model.joints if self.k[j])
        p = A.shape[-1] - len(found.assumed)
        assumed = [one.joint for one in found.assumed]
        bare = Compensation(
            robot=self.robot,
            desired=q,
            wrench=wrench,
            command=command,
            uncompensated=with_rigid(moved, A[..., p:], assumed),
            remaining=None,
            band=None,
            linear=None if offset is None else np.linalg.norm(offset, axis=-1),
            rho0_bias=found.rho0_bias,
            verdict=found.verdict,
            rigid_joints=rigid_joints(model, q, wrench, (*self.springs.identified.joints, *known)),
            rotation=self._rotation(q, wrench),
            rows=rows,
        )
        still = np.zeros((len(q), 3)) if offset is None else offset
        return bare if found.covariance is None else self._with_errors(bare, A, still)

    def _with_errors(self, bare: Compensation, A: Array, still: Array) -> Compensation:
        """The commands with the errors that wrong compliances leave, and what the model leaves out.

        Args:
            bare: The commands.
            A: Regressors (t, 3, p + a) in the desired poses.
            still: Mean errors (t, 3) by the linear model [m].
        """
        found, left = self.springs.every, self.springs.left
        own = self.springs.identified.covariance
        assert found.covariance is not None
        assert own is not None
        noise, dof = (own, found.covariance_dof) if left is None else (left.noise, left.dof)
        p = len(noise)
        by_noise = compensation_accuracy(A[..., :p], noise)
        every = self._left(self.model, bare.desired, bare.wrench, still)
        if left is None:
            total = compensation_accuracy(A, found.covariance)
            every = replace(every, dof=_degrees_of_freedom(dof, total, by_noise))
        alone = NormalMixture.single(still, A[..., :p] @ noise @ np.swapaxes(A, -1, -2)[:, :p], dof)
        each = [
            (one.joint, A[..., :p] @ one.shifts - A[..., p + j] * one.joint.std)
            for j, one in enumerate(found.assumed)
        ]
        return replace(
            bare,
            remaining=every.size,
            band=band_of(every, alone),
            by_noise=by_noise,
            by_joints=tuple((joint, np.linalg.norm(error, axis=-1)) for joint, error in each),
        )

    def _left(
        self, model: ElastostaticModel, q: Array, wrench: Array, still: Array
    ) -> NormalMixture:
        """Errors (t, rows) by all that a sheet leaves open, and what it cannot tell.

        Args:
            model: The robot, and the rows that count.
            q: Poses (t, n) [rad or m].
            wrench: Loads (t, 6) [N, N m].
            still: Mean errors (t, rows) by the linear model [m, rad].
        """
        found, left = self.springs.every, self.springs.left
        assert found.covariance is not None
        A = model.regressor(q, wrench)
        if left is None:
            return NormalMixture.single(still, A @ found.covariance @ np.swapaxes(A, -1, -2))
        p, order = len(left.noise), A.shape[-1]
        more = order - p if len(left.beside) == p else 0
        beside = np.pad(left.beside[:order, :order], (0, more))
        return left.mixture(model, q, wrench).plus(A @ beside @ np.swapaxes(A, -1, -2), still)

    def _moved(self, q: Array, wrench: Array) -> Array:
        """Distance (t,) of the loaded tool point from the desired one without compensation [m]."""
        rest = Rest.of(self.model, q, wrench, self.k)
        moved = self.robot.forward(rest.end)[:, :3, 3] - self.robot.forward(rest.start)[:, :3, 3]
        return np.linalg.norm(moved, axis=-1)

    def _offset(self, q: Array, wrench: Array) -> Array | None:
        """Mean error (t, 3) that the bias of the linear model leaves, at rest [m].

        The robot whose compliances are those identified, less the bias, is commanded by the
        identified ones. None where the file does not know the bias, or has no covariance to go with
        it.
        """
        found = self.springs.every
        if found.bias is None or found.covariance is None:
            return None
        if not found.bias.any():  # of the loaded equilibrium: nothing is linear
            return np.zeros((len(q), 3))
        likely = np.maximum(found.k - found.bias, 0.0)
        return remaining_error(self.model, q, wrench, found.k, likely)

    def _rotation(self, q: Array, wrench: Array) -> Array | None:
        """Root mean square (t,) of the rotations that wrong compliances leave, to first order.

        None where rotations count in no task, or nothing is known of the errors [rad].
        """
        found = self.springs.every
        if found.covariance is None or not any(one.lever for one in self.springs.study.tasks):
            return None
        model = replace(self.model, rows="pose")
        bias = np.zeros(len(found.k)) if found.bias is None else found.bias
        still = -model.regressor(q, wrench) @ bias
        return self._left(model, q, wrench, still).among(slice(3, None)).size

    def _require_settled(self, q: Array, wrench: Array, command: Array) -> None:
        """Check that the loaded robot comes to rest in the desired joints.

        Raises:
            NoEquilibriumError: A pose buckles.
        """
        loaded = Rest.of(self.model, command, wrench, self.k).end
        apart = np.abs(loaded - unloaded(self.model, q, self.k)).max(axis=-1)
        lost = np.flatnonzero(apart > BUCKLED)
        if len(lost):
            raise NoEquilibriumError(lost.tolist())


def _degrees_of_freedom(dof: float, total: Array, noise: Array) -> float:
    """Those of the total (Satterthwaite), as only the noise is estimated; least of all poses."""
    share = np.divide(noise, total, out=np.ones_like(total), where=total > 0)
    most = float(share.max(initial=0.0))
    return dof / most**4 if most > 0 else np.inf


def predict_displacements(
    study: Study, springs: FittedSprings, certain: bool, poses: Table
) -> Prediction:
    """Predict what instruments read under load in the poses of a file, at the loaded equilibrium.

    The covariance of a reading is ``A C A' + V``, of the compliances with the derivatives A of the
    equilibrium, and of a reading: its instrument, joints that do not come back, and what the model
    leaves out.

    Args:
        study: The study of the calibration.
        springs: Its compliances.
        certain: Whether nothing is known of their uncertainty.
        poses: The file, or a data frame that holds what it would.

    Raises:
        UserError: The file cannot be read, or a load buckles the robot.
    """
    table = PoseTable.read(poses, "file of poses").without([REPEATS])
    load = study.space.load
    wrench = load.always if isinstance(load, FixedLoad) else None
    sigma = study_sigma(study)
    data, row = Measurements.expected(
        table, study.robot, study.fixed, wrench, sigma, study.model, study.is_absolute
    )
    model = replace(study.model, unknown=springs.joints)
    k = np.zeros(study.robot.n)
    k[list(springs.joints)] = springs.k
    try:
        linear = linearise(model, data, k)
    except NoEquilibriumError as error:
        first = np.unique(data.pose, return_index=True)[1][error.pose]
        message = why_no_rest(study.robot, data.q[first], k)
        raise UserError(message, where=path_of(poses), key=f"row {row[first] + 1}") from error
    predicted = linear.constant + linear.A @ springs.k
    half = _half_bands(study, springs, data, linear.A)
    moved = np.where(data.lengths[..., None], linear.A @ springs.open, 0.0)
    columns, of_columns = in_columns(_columns(data))
    names = [sensor.name for sensor in study.model.sensors]
    return Prediction(
        data=data,
        what="displacements",
        row=row,
        markers=() if data.sensor is None else tuple(names[i] for i in data.sensor),
        columns=columns,
        values=of_columns(predicted),
        half=of_columns(half),
        apart=of_columns(data.deflection - predicted),
        tests=np.all(np.isfinite(data.deflection), axis=1),
        open=np.sqrt((moved**2).sum(axis=(1, 2))),
        beyond=beyond_limits(study.robot, data.q, row),
        radians=like_radians(study, data.q),
        certain=certain,
    )


def _half_bands(study: Study, springs: FittedSprings, data: Measurements, A: Array) -> Array:
    """Half the width (m, rows) of 95 % bands of readings with regressors A (m, rows, a)."""
    reading = springs.noise.variance(study, data)
    if springs.model is None:
        spread = ((A @ springs.root) ** 2).sum(axis=-1)
        return np.asarray(student_quantile(0.975, springs.dof) * np.sqrt(spread + reading))
    beside = ((A @ springs.beside) ** 2).sum(axis=-1) + reading
    found = springs.model.of_readings(study.model, data, A).plus(beside.reshape(-1, 1, 1))
    return found.quantiles([0.95])[:, 0].reshape(beside.shape)


def _columns(data: Measurements) -> tuple[Columns, ...]:
    """The columns of all readings: a single rotation has one of its own beside single lengths."""
    columns = coordinate_columns(data.deflection.shape[1])
    if data.turn is None:
        return ((columns, np.ones(len(data), dtype=bool), slice(None)),)
    return (columns, ~data.turn, slice(None)), ((TURN_COLUMN,), data.turn, slice(None))
