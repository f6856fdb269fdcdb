"""The error to expect in the task after a compensation, in parts that have names."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from edtk.calibration.causes.families import families
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.task import Task
from edtk.system.presented import Presented
from edtk.system.typing import Array

TOOL = ("tool_x", "tool_y", "tool_z")


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
        rigid: Compliances that joints may have which count as rigid, by joint [rad/(N m)].
    """

    load_size: float = 0.01
    load_direction: float = float(np.deg2rad(1.0))
    tool: float = 1e-3
    drift: float = 0.0
    repeatability: float = 0.0
    rigid: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class ErrorBudget(Presented):
    """Root mean square errors of the tool point after compensation in the task, by source [m].

    Attributes:
        noise: Of the measurements: rho0, Eq. (20).
        model: What the linear model leaves.
        load: A calibration load of another size or direction than stated.
        tool: A calibration tool point elsewhere than stated.
        rigid_joints: Joints that count as rigid, and bend.
        drift: A shift between unloaded and loaded readings.
        repeatability: The robot does not stay where it was between two readings.
        uncompensated: The displacement of the task without any compensation, for comparison, with
            the joints that count as rigid.
    """

    noise: float
    model: float
    load: float
    tool: float
    rigid_joints: float
    drift: float
    repeatability: float
    uncompensated: float

    @property
    def parts(self) -> dict[str, float]:
        """All parts by name [m]."""
        names = [field.name for field in fields(self) if field.name != "uncompensated"]
        return {name: getattr(self, name) for name in names}

    @property
    def total(self) -> float:
        """The root of the sum of squares of all parts [m]."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        return max(self.parts, key=self.parts.__getitem__)

    def headline(self) -> str:
        """The total and its largest part."""
        share = f"{1e3 * self.parts[self.largest]:.2g} mm by {self.largest.replace('_', ' ')}"
        return f"{1e3 * self.total:.2g} mm expected in the task, {share}"

    def to_dict(self) -> dict[str, Any]:
        """The parts and the total, in millimetres."""
        parts = {name: 1e3 * part for name, part in self.parts.items()}
        return {**parts, "total": 1e3 * self.total}


def error_budget(
    model: ElastostaticModel,
    data: Measurements,
    task: Task,
    k: Array,
    covariance: Array,
    uncertainty: Uncertainty,
    model_error: float = 0.0,
) -> ErrorBudget:
    """Propagate what is uncertain in a calibration to the error in the task, to first order.

    A circumstance u changes the measurements by ``D u`` with ``D = d(A k)/du``, the estimate by
    ``A+ D u`` with the weighted least-squares inverse A+, and the tool point after compensation by
    ``A0 A+ D u``. A joint that counts as rigid, with compliance c, adds ``A_j c`` to the
    measurements and ``A0_j c`` to the task: its error is ``(A0_j - A0 A+ A_j) c``.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, loads, markers and noise of the calibration; measured values are not used.
        task: Where the robot shall be accurate.
        k: Compliances (p,), identified or assumed [rad/(N m)].
        covariance: Their covariance (p, p) by the noise.
        uncertainty: How well the circumstances are known.
        model_error: Error that the linear model leaves [m].

    Raises:
        SingularPlanError: The poses do not identify all parameters.
    """
    A0 = task.target
    whitened = Whitened.of(data.regressor(model), data.sigma, model.parameters)

    def moved(change: Array) -> Array:
        """Shift of the tool point (3, c) in the task, by changes (m, rows, c) of readings."""
        return A0 @ whitened.solve(np.moveaxis(change, -1, 0)).T

    faults = {family.cause: family for family in families(model, data, k)}
    tilted = moved(faults["load_direction"].derivative_at_zero(k))
    tool = np.hstack([moved(faults[name].derivative_at_zero(k)) for name in TOOL])
    # Compliances take up a load of another size in full: they come out as much too large.
    displacement = float(np.linalg.norm(A0 @ k))
    shift = np.zeros((*data.sigma.shape, 3))
    shift[:, :3] = np.eye(3)
    rigid, bends = _rigid(model, data, task, whitened, uncertainty)
    return ErrorBudget(
        noise=float(np.sqrt(np.trace(A0 @ covariance @ A0.T))),
        model=model_error,
        load=float(
            np.hypot(
                uncertainty.load_size * displacement,
                uncertainty.load_direction * np.linalg.norm(tilted),
            )
        ),
        tool=uncertainty.tool * float(np.linalg.norm(tool)),
        rigid_joints=rigid,
        drift=uncertainty.drift * float(np.linalg.norm(moved(shift))),
        repeatability=_repeatability(data, A0, whitened, uncertainty.repeatability),
        uncompensated=float(np.hypot(displacement, bends)),
    )


def _rigid(
    model: ElastostaticModel,
    data: Measurements,
    task: Task,
    whitened: Whitened,
    uncertainty: Uncertainty,
) -> tuple[float, float]:
    """Error by joints that count as rigid, after compensation and without any [m]."""
    names = model.robot.joint_names
    after = 0.0
    without = 0.0
    for name, compliance in uncertainty.rigid:
        joint = names.index(name)
        bent = data.regressor(ElastostaticModel(model.robot, (joint,), model.rows))[..., 0]
        absorbed = whitened.solve(bent)
        # One target of all of them: that of a neighbourhood is a triangle, without rows of poses.
        target = replace(task, unknown=(*task.unknown, joint)).target
        after += float(np.sum((compliance * (target @ np.append(-absorbed, 1.0))) ** 2))
        without += float(np.sum((compliance * target[:, -1]) ** 2))
    return float(np.sqrt(after)), float(np.sqrt(without))


def _repeatability(data: Measurements, A0: Array, whitened: Whitened, std: float) -> float:
    """Error by independent shifts of every measurement [m]."""
    # A row's shift u enters the whitened measurements as u/sigma, and the estimate by Q.
    rows = slice(0, 3)
    Q = whitened.Q[:, rows] * whitened.weight[:, rows, None]
    gram = np.einsum("mrp,mrq->pq", Q, Q)
    T = A0 @ (np.linalg.inv(whitened.R) / whitened.scale[:, None])
    return std * float(np.sqrt(np.trace(T @ gram @ T.T)))
