"""What is uncertain in a calibration, propagated to the error in the task."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.causes.families import families
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.error_budget import ErrorBudget
from edtk.model.tasks import Tasks
from edtk.system.typing import Array, Indices

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


def error_budget(
    model: ElastostaticModel,
    data: Measurements,
    tasks: Tasks,
    k: Array,
    covariance: Array,
    uncertainty: Uncertainty,
    model_error: float = 0.0,
    repeats: Indices | Array | None = None,
) -> ErrorBudget:
    """Propagate what is uncertain in a calibration to the error in the task, to first order.

    A circumstance u changes the measurements by ``D u`` with ``D = d(A k)/du``, the estimate by
    ``A+ D u`` with the weighted least-squares inverse A+, and the tool point after compensation by
    ``A0 A+ D u``. A joint that counts as rigid, with compliance c, adds ``A_j c`` to the
    measurements and ``A0_j c`` to the task: its error is ``(A0_j - A0 A+ A_j) c``.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, loads, markers and noise of the calibration; measured values are not used.
        tasks: Where the robot shall be accurate.
        k: Compliances (p,), identified or assumed [rad/(N m)].
        covariance: Their covariance (p, p) by the noise.
        uncertainty: How well the circumstances are known.
        model_error: Error that the linear model leaves [m].
        repeats: Repetitions (m,) that each row stands for; one by default.

    Raises:
        SingularPlanError: The poses do not identify all parameters.
    """
    A0 = tasks.target
    A = data.regressor(model)
    whitened = Whitened.of(A, data.noise, model.parameters)

    def moved(*changes: Array) -> float:
        """Length of the tool point's shift in the task, by changes (m, rows, c) of readings."""
        shifts = [A0 @ whitened.solve(np.moveaxis(change, -1, 0)).T for change in changes]
        return float(np.linalg.norm(np.hstack(shifts)))

    faults = {family.cause: family for family in families(model, data, A, k)}
    tilted = moved(faults["load_direction"].derivative_at_zero(k))
    tool = moved(*(faults[name].derivative_at_zero(k) for name in TOOL))
    shift = np.zeros((*data.sigma.shape, 3))
    shift[:, :3] = np.eye(3)
    # Compliances take up a load of another size in full: they come out as much too large.
    displacement = float(np.linalg.norm(A0 @ k))
    scaled = uncertainty.load_size * displacement
    rigid, bends = _rigid(model, data, tasks, whitened, uncertainty)
    return ErrorBudget(
        noise=float(np.sqrt(np.trace(A0 @ covariance @ A0.T))),
        model=model_error,
        load=float(np.hypot(scaled, uncertainty.load_direction * tilted)),
        tool=uncertainty.tool * tool,
        rigid_joints=rigid,
        drift=uncertainty.drift * moved(shift),
        repeatability=_repeatability(A0, whitened, repeats, uncertainty.repeatability),
        uncompensated=float(np.hypot(displacement, bends)),
    )


def _rigid(
    model: ElastostaticModel,
    data: Measurements,
    tasks: Tasks,
    whitened: Whitened,
    uncertainty: Uncertainty,
) -> tuple[float, float]:
    """Error by joints that count as rigid, after compensation and without any [m]."""
    names = model.robot.joint_names
    after = 0.0
    without = 0.0
    for name, compliance in uncertainty.rigid:
        joint = names.index(name)
        bent = data.regressor(replace(model, unknown=(joint,)))[..., 0]
        absorbed = whitened.solve(bent)
        # One target of all of them: that of a neighbourhood is a triangle, without rows of poses.
        target = tasks.with_unknown((*tasks[0].unknown, joint)).target
        after += float(np.sum((compliance * (target @ np.append(-absorbed, 1.0))) ** 2))
        without += float(np.sum((compliance * target[:, -1]) ** 2))
    return float(np.sqrt(after)), float(np.sqrt(without))


def _repeatability(
    A0: Array, whitened: Whitened, repeats: Indices | Array | None, std: float
) -> float:
    """Error by independent shifts of every measurement [m]."""
    # A row's shift u enters the whitened measurements as W u, and the estimate by Q.
    Q = whitened.by_reading()[:, :3]
    if repeats is not None:
        Q = Q / np.sqrt(repeats[:, None, None])
    gram = np.einsum("mrp,mrq->pq", Q, Q)
    T = A0 @ (np.linalg.inv(whitened.R) / whitened.scale[:, None])
    return std * float(np.sqrt(np.trace(T @ gram @ T.T)))
