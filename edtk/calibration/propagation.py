"""How what is uncertain in a calibration moves its compliances, and with them the tool point."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.causes.families import families
from edtk.calibration.uncertainty import Uncertainty
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.error_budget import ErrorBudget
from edtk.model.tasks import Tasks
from edtk.system.typing import Array, Indices

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
        direction: By the direction of the load [rad/(N m) per rad].
        tool: By the tool point, along each axis.
        drift: By a shift between unloaded and loaded readings.
        readings: By shifts of every reading: a root (p, p) of what they add to the covariance.
        bent: The joints that count as rigid.
    """

    k: Array
    covariance: Array
    uncertainty: Uncertainty
    direction: Array
    tool: tuple[Array, ...]
    drift: Array
    readings: tuple[Array, Array]
    bent: tuple[Bent, ...]

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        data: Measurements,
        k: Array,
        covariance: Array,
        uncertainty: Uncertainty,
        repeats: Indices | Array | None = None,
    ) -> "Propagation":
        """Propagate to the estimates, see `error_budget`."""
        A = data.regressor(model)
        whitened = Whitened.of(A, data.noise, model.parameters)

        def moved(change: Array) -> Array:
            """Shift (p, c) of the estimates by changes (m, rows, c) of readings."""
            return whitened.solve(np.moveaxis(change, -1, 0)).T

        faults = {family.cause: family for family in families(model, data, A, k)}
        shift = np.zeros((*data.sigma.shape, 3))
        shift[:, :3] = np.eye(3)
        return cls(
            k=k,
            covariance=covariance,
            uncertainty=uncertainty,
            direction=moved(faults["load_direction"].derivative_at_zero(k)),
            tool=tuple(moved(faults[name].derivative_at_zero(k)) for name in TOOL),
            drift=moved(shift),
            readings=_readings(whitened, repeats),
            bent=_bent(model, data, whitened, uncertainty),
        )

    def budget(self, tasks: Tasks, model_error: float = 0.0) -> ErrorBudget:
        """The error in some tasks, in parts.

        Args:
            tasks: Where the robot shall be accurate.
            model_error: Error that the linear model leaves [m].
        """
        A0 = tasks.target
        given = self.uncertainty
        # Compliances take up a load of another size in full: they come out as much too large.
        displacement = float(np.linalg.norm(A0 @ self.k))
        scaled = given.load_size * displacement
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
            uncompensated=float(np.hypot(displacement, bends)),
        )

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
    model: ElastostaticModel, data: Measurements, whitened: Whitened, uncertainty: Uncertainty
) -> tuple[Bent, ...]:
    """What the estimates absorb of joints that count as rigid."""
    found = []
    for name, compliance in uncertainty.rigid:
        joint = model.robot.joint_names.index(name)
        bent = data.regressor(replace(model, unknown=(joint,)))[..., 0]
        found.append(Bent(joint, compliance, whitened.solve(bent)))
    return tuple(found)


def _readings(whitened: Whitened, repeats: Indices | Array | None) -> tuple[Array, Array]:
    """Two factors (p, p) by which independent shifts of every reading move the estimates."""
    # A row's shift u enters the whitened measurements as W u, and the estimate by Q.
    Q = whitened.by_reading()[:, :3]
    if repeats is not None:
        Q = Q / np.sqrt(repeats[:, None, None])
    gram = np.einsum("mrp,mrq->pq", Q, Q)
    return gram, np.linalg.inv(whitened.R) / whitened.scale[:, None]
