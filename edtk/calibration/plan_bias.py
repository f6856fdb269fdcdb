"""How wrong the linear model makes a plan's compliances, for those that a study assumes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.plan_noise import plan_noise
from edtk.design.plan import Plan
from edtk.inference.bias import Bias, linearisation_bias
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.equilibrium import NoEquilibriumError
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class PlanBias(Presented):
    """A plan's bias, and its effect in the test pose.

    Attributes:
        bias: Bias and covariance of the compliances.
        joints: Names (p,) of their joints.
        parameters: Names (p,) of the parameters.
        experiments: Number of measurements.
        unit: Of the parameters.
        rho0: Error by the noise in the test pose, Eq. (20) [m]; None without a test pose.
        rho0_bias: Length of the mean error by the bias in the test pose [m]; None without one.
        poses: Number of test poses, over which both are roots of the mean of squares.
    """

    bias: Bias
    joints: tuple[str, ...]
    parameters: tuple[str, ...]
    experiments: int
    unit: str
    rho0: float | None
    rho0_bias: float | None
    poses: int = 1

    def headline(self) -> str:
        """The largest bias in standard deviations."""
        worst = int(np.abs(self.bias.in_std).argmax())
        return (
            f"linear model, {self.experiments} experiments: {self.parameters[worst]} is off by "
            f"{self.bias.in_std[worst]:+.3g} standard deviations at most"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units; a per cent value that is infinite is null."""
        percent = [p if np.isfinite(p) else None for p in self.bias.percent.tolist()]
        return {
            "experiments": self.experiments,
            "true": self._by_joint(self.bias.true),
            "expected": self._by_joint(self.bias.expected),
            "bias": self._by_joint(self.bias.bias),
            "std": self._by_joint(self.bias.std),
            "bias_in_std": self._by_joint(self.bias.in_std),
            "bias_percent": dict(zip(self.joints, percent, strict=True)),
            "rho0": self.rho0,
            "rho0_bias": self.rho0_bias,
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each compliance, SI units.

        Columns: `joint`, `parameter`, `true`, `expected`, `bias`, `std`, `bias_in_std` and
        `bias_percent`.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "joint": self.joints,
                "parameter": self.parameters,
                "true": self.bias.true,
                "expected": self.bias.expected,
                "bias": self.bias.bias,
                "std": self.bias.std,
                "bias_in_std": self.bias.in_std,
                "bias_percent": self.bias.percent,
            }
        )

    def _by_joint(self, values: Array) -> dict[str, float]:
        """Values (p,) by the names of the joints."""
        return dict(zip(self.joints, values.tolist(), strict=True))


def plan_bias(study: Study, plan: Plan, path: Path | str) -> PlanBias:
    """Carry out a plan on the robot of the study's [simulation] and identify with the linear model.

    Compliances that [simulation] gives for joints that are not unknown bend the robot too.

    Args:
        study: Model, noise, test pose and assumed true compliances.
        plan: The plan.
        path: Where the plan comes from, for the message.

    Raises:
        UserError: The study has no [simulation], or it lacks a joint or names an unknown one; or a
            pose of the plan has no equilibrium.
        SingularPlanError: The plan cannot identify all parameters; names them.
    """
    k = _assumed_compliances(study)
    # The mean of repetitions has all their information: counts need no rows.
    sigma = plan_noise(study, plan)
    try:
        found = linearisation_bias(study.model, plan.q, plan.wrench, sigma, k, study.known)
    except NoEquilibriumError as error:
        row = f"row {error.pose + 1}"
        message = "no stable equilibrium under its load"
        raise UserError(message, where=path, key=row) from error
    A0 = study.target
    return PlanBias(
        bias=found,
        joints=study.specification.joints.unknown,
        parameters=study.model.parameters,
        experiments=plan.experiments,
        unit=study.model.unit,
        rho0=None if A0 is None else float(compensation_accuracy(A0, found.covariance)),
        rho0_bias=None if A0 is None else found.in_pose(A0),
        poses=len(study.tasks),
    )


def _assumed_compliances(study: Study) -> Array:
    """Compliances (n,) of all joints [rad/(N m)].

    They are from [simulation]; where it does not name a joint, known ones from [joints], else zero.

    Raises:
        UserError: The study has no [simulation], or it lacks a joint or names an unknown one.
    """
    simulation = study.specification.simulation
    if simulation is None:
        message = "expected a table with the assumed true compliances; the study has none"
        raise study.error("simulation", message)
    names = study.robot.joint_names
    for name in simulation.compliance_rad_per_Nm:
        if name not in names:
            message = f"no joint {name!r}; this robot has {', '.join(names)}"
            raise study.error("simulation.compliance_rad_per_Nm", message)
    k = np.array([simulation.compliance_rad_per_Nm.get(name, 0.0) for name in names])
    for j, compliance in study.known.items():
        k[j] = simulation.compliance_rad_per_Nm.get(names[j], compliance)
    k[study.model.joints] = study.compliances
    return k
