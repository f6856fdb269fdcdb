"""Compliances that a calibration has found, as commands ask them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.calibration.compensate import Calibrated, Commanded, Compensation, band_of
from edtk.calibration.model_left import ModelLeft
from edtk.calibration.prediction import POSSIBLE, model_of_result
from edtk.calibration.tasks_in_use import ToolInUse
from edtk.fit.distributions import NormalMixture
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
from edtk.measure.task import all_compliances, rigid_joints
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

SETTLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


@dataclass(frozen=True, eq=False)
class CalibratedSprings(Calibrated):
    """A robot of which compliances were identified, and nothing else.

    Attributes:
        study: The study of the calibration.
        identified: Those that were identified, with their covariance by noise and model.
        every: The same with those of all other joints, and with all that is uncertain. Joints that
            have a compliance neither here nor among the known ones of the study count as rigid.
        left: What errors of the model leave; None where nothing is known of them.
    """

    study: Study
    identified: Compliances
    every: Compliances
    left: ModelLeft | None = None

    @classmethod
    def of(cls, study: Study, found: Compliances) -> "CalibratedSprings":
        """With what the study takes of joints that were not identified.

        Raises:
            UserError: What the file says of errors of the model is not valid.
        """
        given = dict(zip(found.joints, found.k, strict=True))
        k = np.array([given.get(name, 0.0) for name in study.specification.joints.unknown])
        try:
            left = model_of_result(study, found.possible)
        except ValueError as error:
            raise UserError(str(error), where=found.where, key=POSSIBLE) from error
        return cls(study, found, found.including(assumed_joints(study, k)), left)

    @property
    def compliances(self) -> Mapping[str, float]:
        """Those that were identified, by joint [rad/(N m)]."""
        return dict(zip(self.identified.joints, self.identified.k.tolist(), strict=True))

    def with_tool(self, tool: ToolInUse) -> "SpringsWithTool":
        """The same with the tool, and the weights, of some poses."""
        return SpringsWithTool(self, tool)


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
    def robot(self) -> Robot:  # type: ignore[override]
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
        transposed = np.swapaxes(A, -1, -2)
        p, a = len(noise), A.shape[-1] - len(noise)
        # At least what the budget counts without errors of the model, see `Propagation.budget`.
        V = A @ (found.covariance + np.pad(noise - own, (0, a))) @ transposed
        by_noise = compensation_accuracy(A[..., :p], noise)
        if left is None:
            total = compensation_accuracy(A, found.covariance)
            every = NormalMixture.single(still, V, _degrees_of_freedom(dof, total, by_noise))
        else:
            more = a if len(left.beside) == p else 0
            beside = np.pad(left.beside[: p + a, : p + a], (0, more))
            mixture = left.mixture(self.model, bare.desired, bare.wrench)
            every = mixture.plus(A @ beside @ transposed, still)
        alone = NormalMixture.single(still, A[..., :p] @ noise @ transposed[:, :p], dof)
        squares = np.einsum("trr->t", V) + np.square(still).sum(axis=-1)
        each = [
            (one.joint, A[..., :p] @ one.shifts - A[..., p + j] * one.joint.std)
            for j, one in enumerate(found.assumed)
        ]
        return replace(
            bare,
            remaining=np.sqrt(np.maximum(np.square(every.size), squares)),
            band=band_of(every, alone),
            by_noise=by_noise,
            by_joints=tuple((joint, np.linalg.norm(error, axis=-1)) for joint, error in each),
        )

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
        likely = np.maximum(found.k - found.bias, 0.0)
        return remaining_error(self.model, q, wrench, found.k, likely)

    def _rotation(self, q: Array, wrench: Array) -> Array | None:
        """Root mean square (t,) of the rotations that wrong compliances leave, to first order.

        None where rotations count in no task, or nothing is known of the errors [rad].
        """
        found = self.springs.every
        if found.covariance is None or not any(one.lever for one in self.springs.study.tasks):
            return None
        A = replace(self.model, rows="pose").regressor(q, wrench)[:, 3:]
        bias = np.zeros(len(found.k)) if found.bias is None else found.bias
        noise = compensation_accuracy(A, found.covariance)
        return np.asarray(np.hypot(noise, np.linalg.norm(A @ bias, axis=-1)))

    def _require_settled(self, q: Array, wrench: Array, command: Array) -> None:
        """Check that the loaded robot comes to rest in the desired joints.

        Raises:
            NoEquilibriumError: A pose buckles.
        """
        loaded = Rest.of(self.model, command, wrench, self.k).end
        apart = np.abs(loaded - unloaded(self.model, q, self.k)).max(axis=-1)
        lost = np.flatnonzero(apart > SETTLED)
        if len(lost):
            raise NoEquilibriumError(lost.tolist())


def _degrees_of_freedom(dof: float, total: Array, noise: Array) -> float:
    """Those of the total (Satterthwaite), as only the noise is estimated; least of all poses."""
    share = np.divide(noise, total, out=np.ones_like(total), where=total > 0)
    most = float(share.max(initial=0.0))
    return dof / most**4 if most > 0 else np.inf
