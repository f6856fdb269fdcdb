"""How wrong the linear model makes a plan's compliances, for the compliances that a study assumes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.design.plan import Plan
from edtk.inference.bias import Bias, linearisation_bias
from edtk.inference.equilibrium_deflection import marker_motion
from edtk.inference.least_squares import SingularPlanError, estimate
from edtk.inference.measurements import Measurements
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.presented import Presented

Array = NDArray[np.float64]
MOST_POSES = 2000


@dataclass(frozen=True, eq=False)
class PlanBias(Presented):
    """A plan's bias, and what it does in the test pose.

    Attributes:
        bias: Bias and covariance of the compliances.
        joints: Names (p,) of their joints.
        parameters: Names (p,) of the parameters.
        experiments: Number of measurements.
        unit: Of the parameters.
        rho0: Eq. (20), what the noise leaves in the test pose [m]; None without one.
        rho0_bias: Length of the mean error that the bias leaves there [m]; None without one.
    """

    bias: Bias
    joints: tuple[str, ...]
    parameters: tuple[str, ...]
    experiments: int
    unit: str
    rho0: float | None
    rho0_bias: float | None

    def headline(self) -> str:
        """The largest bias in standard deviations."""
        worst = int(np.abs(self.bias.in_std).argmax())
        return (
            f"linear model, {self.experiments} experiments: {self.parameters[worst]} is off by "
            f"{self.bias.in_std[worst]:+.3g} standard deviations at most"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units; a per cent value that is infinite is null."""
        b = self.bias
        columns = {
            "true": b.true,
            "expected": b.expected,
            "bias": b.bias,
            "std": b.std,
            "bias_in_std": b.in_std,
        }
        percent = [p if np.isfinite(p) else None for p in b.percent.tolist()]
        return {
            "experiments": self.experiments,
            **{
                name: dict(zip(self.joints, values.tolist(), strict=True))
                for name, values in columns.items()
            },
            "bias_percent": dict(zip(self.joints, percent, strict=True)),
            "rho0": self.rho0,
            "rho0_bias": self.rho0_bias,
        }


def plan_bias(study: Study, plan: Plan, path: Path) -> PlanBias:
    """Carry out a plan on the robot of the study's [simulation] and identify with the linear model.

    Compliances that [simulation] gives for joints that are not unknown bend the robot too.

    Args:
        study: Model, noise, test pose and assumed true compliances.
        plan: The plan.
        path: Where the plan comes from, for the message.

    Raises:
        UserError: There is no [simulation], or it lacks a joint or names one that is not there; or a pose of the plan
            has no equilibrium.
        SingularPlanError: The plan cannot identify all parameters; names them.
    """
    if study.specification.simulation is None:
        raise study.error(
            "simulation", "expected a table with the assumed true compliances, and there is none"
        )
    given, names = study.specification.simulation.compliance_rad_per_Nm, study.robot.joint_names
    for name in given:
        if name not in names:
            message = f"no joint {name!r}; this robot has {', '.join(names)}"
            raise study.error("simulation.compliance_rad_per_Nm", message)
    k = np.array([given.get(name, 0.0) for name in names])
    k[study.model.joints] = study.compliances
    each = np.repeat(np.arange(len(plan.q)), plan.repeats)
    try:
        found = linearisation_bias(study.model, plan.q[each], plan.wrench[each], study.sigma, k)
    except NoEquilibriumError as error:
        raise UserError(
            f"{path}: row {each[error.pose] + 1}: no stable equilibrium under its load"
        ) from error
    A0 = study.target
    return PlanBias(
        bias=found,
        joints=study.specification.joints.unknown,
        parameters=study.model.parameters,
        experiments=plan.experiments,
        unit=study.model.unit,
        rho0=None if A0 is None else float(compensation_accuracy(A0, found.covariance)),
        rho0_bias=None if A0 is None else found.in_pose(A0),
    )


def bias_in_test_pose(study: Study, data: Measurements, k: Array) -> float | None:
    """What the linear model costs in the test pose, if the robot has the compliances that were identified.

    Of very many poses every second, third, ... is enough to tell.

    Args:
        study: Model and test pose.
        data: The measurements from which they were identified.
        k: Those compliances (p,) [rad/(N m)].

    Returns:
        Length of the mean error ``|A0 (E(k_hat) - k)|`` [m]; None without a test pose, or if such a robot would not
        come to rest.
    """
    if study.target is None:
        return None
    all_joints = np.zeros(study.robot.n)
    all_joints[study.model.joints] = k
    every = -(-(1 + data.pose.max()) // MOST_POSES)
    some = data[np.flatnonzero(data.pose % every == 0)]
    one = some[np.unique(some.pose, return_index=True)[1]]
    try:
        moved = equilibrium(study.robot, one.q, one.wrench, all_joints).displacement[some.pose]
        measured = marker_motion(study.model, some.q, moved, some.marker)
        expected = estimate(
            some.regressor(study.model), measured, some.sigma, study.model.parameters
        ).k
    except (NoEquilibriumError, SingularPlanError):
        return None
    return float(np.linalg.norm(study.target @ (expected - k)))
