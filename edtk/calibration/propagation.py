"""How what is uncertain in a calibration moves its compliances, and with them the tool point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.causes.families_with_known import families_with_known
from edtk.calibration.least_squares_inverse import LeastSquaresInverse
from edtk.calibration.uncertainty import Uncertainty
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.inference.translations import translations
from edtk.model.dead_weights import DeadWeights
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.error_budget import ErrorBudget
from edtk.model.tasks import Tasks
from edtk.system.typing import Array, Indices, Mask

TOOL = ("tool_x", "tool_y", "tool_z")


@dataclass(frozen=True, eq=False)
class Bent:
    """A joint that counts as rigid.

    Attributes:
        joint: Its index.
        compliance: What it may have [rad/(N m)].
        absorbed: By how much 1 rad/(N m) of it changes the estimates (p,).
    """

    joint: int
    compliance: float
    absorbed: Array


@dataclass(frozen=True, eq=False)
class Propagation:
    """Shifts of the estimates by a circumstance of unit size, an array (p, c) for each cause.

    Attributes:
        k: The compliances (p,) [rad/(N m)].
        covariance: Their covariance (p, p) by the noise.
        uncertainty: How well the circumstances are known.
        load: By the size of the load, as a share (p,).
        payload: By the mass of a payload beside the load, as a share (p,).
        direction: By the direction of the load [rad/(N m) per rad].
        tool: By the tool point, along each axis.
        drift: By a shift between unloaded and loaded readings.
        readings: By shifts of every reading: a root (p, p) of what they add to the covariance.
        bent: The joints that count as rigid.
        known: Further joints, by index, with their known compliances [rad/(N m)].
        absolute: Whether displacements are counted from the rigid robot.
    """

    k: Array
    covariance: Array
    uncertainty: Uncertainty
    load: Array
    payload: Array
    direction: Array
    tool: tuple[Array, ...]
    drift: Array
    readings: tuple[Array, Array]
    bent: tuple[Bent, ...]
    known: tuple[tuple[int, float], ...] = ()
    absolute: bool = False

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        data: Measurements,
        k: Array,
        covariance: Array,
        uncertainty: Uncertainty,
        repeats: Indices | Array | None = None,
        known: Mapping[int, float] | None = None,
        prior: PriorRows | None = None,
        payload: DeadWeights | None = None,
    ) -> "Propagation":
        """Propagate what is uncertain in a calibration to its estimates, to the first order.

        A circumstance u changes the measurements by ``D u`` with ``D = d(A k)/du``, the estimate by
        ``A+ D u`` with the weighted least-squares inverse A+, and the tool point after compensation
        by ``A0 A+ D u``. A joint that counts as rigid, with compliance c, adds ``A_j c`` to the
        measurements and ``A0_j c`` to the task: its error is ``(A0_j - A0 A+ A_j) c``.

        Args:
            model: The robot with its calibration tool, and the measured rows.
            data: Poses, loads, markers and noise of the calibration; measured values are not used.
            k: Compliances (p,), identified or assumed [rad/(N m)].
            covariance: Their covariance (p, p) by the noise.
            uncertainty: How well the circumstances are known.
            repeats: Repetitions (m,) that each row stands for; one by default.
            known: Compliances of further joints, by their index [rad/(N m)].
            prior: What else is known of the compliances, where the estimate rests on that, too.
            payload: A payload beside the load, whose mass is as uncertain as the load's size.

        Raises:
            SingularPlanError: The poses do not identify all parameters.
        """
        A = data.regressor(model)
        inverse = LeastSquaresInverse.of(model, data, A, prior)
        moved = inverse.shifts
        every = families_with_known(model, data, A, k, known or {}, prior is not None)
        faults = {family.cause: family for family in every}
        load = k  # compliances take up a load of another size in full
        if "load_size" in faults:
            load = moved(faults["load_size"].derivative_at_zero(k))[:, 0]
        return cls(
            k=k,
            covariance=covariance,
            uncertainty=uncertainty,
            load=load,
            payload=moved(_by_weights(model, data, k, known or {}, payload))[:, 0],
            direction=moved(faults["load_direction"].derivative_at_zero(k)),
            tool=tuple(moved(faults[name].derivative_at_zero(k)) for name in TOOL),
            drift=moved(translations(model, data)),
            readings=_readings(inverse, data.lengths, repeats),
            bent=_bent(model, data, inverse, uncertainty),
            known=tuple((known or {}).items()),
            absolute=data.absolute,
        )

    def budget(self, tasks: Tasks, model_error: float = 0.0) -> ErrorBudget:
        """The error in some tasks, in parts.

        Args:
            tasks: Where the robot shall be accurate.
            model_error: Error that the linear model leaves [m].
        """
        A0 = tasks.target
        given = self.uncertainty
        scaled = given.load_size * _length(A0, [self.load[:, None], self.payload[:, None]])
        rigid, bends = self._rigid(tasks)
        gram, inverse = self.readings
        T = A0 @ inverse
        return ErrorBudget(
            noise=float(np.sqrt(np.trace(A0 @ self.covariance @ A0.T))),
            model=model_error,
            load=float(np.hypot(scaled, given.load_direction * _length(A0, [self.direction]))),
            tool=given.tool * _length(A0, self.tool),
            rigid_joints=rigid,
            drift=given.drift * _length(A0, [self.drift]),
            repeatability=given.repeatability * float(np.sqrt(np.trace(T @ gram @ T.T))),
            uncompensated=float(np.hypot(self._displacement(tasks), bends)),
            absolute=self.absolute,
        )

    def totals(self, tasks: Tasks, model_errors: Array) -> Array:
        """The total error (t,) in each task by itself [m].

        Args:
            tasks: Where the robot shall be accurate.
            model_errors: Errors (t,) that the linear model leaves [m].
        """
        each = zip(tasks, model_errors, strict=True)
        return np.array([self.budget(Tasks([task]), float(error)).total for task, error in each])

    def _displacement(self, tasks: Tasks) -> float:
        """What the load moves the tool point by in the task, joints of known compliance too [m]."""
        joints = tuple(joint for joint, _ in self.known)
        k = np.append(self.k, [compliance for _, compliance in self.known])
        target = tasks.with_unknown((*tasks[0].unknown, *joints)).target if joints else tasks.target
        return float(np.linalg.norm(target @ k))

    def _rigid(self, tasks: Tasks) -> tuple[float, float]:
        """Error by joints that count as rigid, after compensation and without any [m]."""
        after = 0.0
        without = 0.0
        for one in self.bent:
            # One target of all: that of a neighbourhood is a triangle, without rows of poses.
            target = tasks.with_unknown((*tasks[0].unknown, one.joint)).target
            left = target @ np.append(-one.absorbed, 1.0)
            after += float(np.sum((one.compliance * left) ** 2))
            without += float(np.sum((one.compliance * target[:, -1]) ** 2))
        return float(np.sqrt(after)), float(np.sqrt(without))


def _length(A0: Array, shifts: Sequence[Array]) -> float:
    """Length of the tool point's shift in the task [m]."""
    return float(np.linalg.norm(np.hstack([A0 @ shift for shift in shifts])))


def _bent(
    model: ElastostaticModel,
    data: Measurements,
    inverse: LeastSquaresInverse,
    uncertainty: Uncertainty,
) -> tuple[Bent, ...]:
    """What the estimates absorb of joints that count as rigid."""
    found = []
    for name, compliance in uncertainty.rigid:
        joint = model.robot.joint_names.index(name)
        bent = data.regressor(replace(model, unknown=(joint,)))[..., 0]
        found.append(Bent(joint, compliance, inverse.solve(bent)))
    return tuple(found)


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
) -> tuple[Array, Array]:
    """Two factors (p, p) by which independent shifts of every reading move the estimates."""
    # A row's shift u enters the whitened measurements as W u, and the estimate by Q.
    Q = inverse.by_reading() * lengths[..., None]
    whitened = inverse.whitened
    if repeats is not None:
        Q = Q / np.sqrt(repeats[:, None, None])
    gram = np.einsum("mrp,mrq->pq", Q, Q)
    return gram, np.linalg.inv(whitened.R) / whitened.scale[:, None]
