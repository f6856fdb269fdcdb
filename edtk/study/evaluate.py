"""What a plan is worth: all criteria, standard deviations and covariance."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import criteria
from edtk.design.plan import Plan
from edtk.inference.least_squares import covariance
from edtk.study.study import Study
from edtk.system.presented import Presented

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evaluation(Presented):
    """A plan's worth, in SI units throughout.

    Attributes:
        criteria: Value of every criterion that applies, by name; rho0 in metres.
        observability_unscaled: O1 to O5 from the singular values of A itself, not of A/sigma.
        std: Standard deviations (p,) of the compliances [rad/(N m)].
        covariance: Covariance (p, p) of the compliances, Eq. (13).
        parameters: Names (p,) of the parameters.
        joints: Names (p,) of their joints.
        units: Units (p,) of the parameters.
        experiments: Number of measurements.
    """

    criteria: dict[str, float]
    observability_unscaled: dict[str, float]
    std: Array
    covariance: Array
    parameters: tuple[str, ...]
    joints: tuple[str, ...]
    units: tuple[str, ...]
    experiments: int

    def headline(self) -> str:
        """Number of experiments, of criteria and of parameters."""
        return (
            f"{self.experiments} experiments under {len(self.criteria)} criteria, "
            f"standard deviations of {len(self.parameters)} parameters"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {
            "criteria": self.criteria,
            "observability_unscaled": self.observability_unscaled,
            "std": dict(zip(self.joints, self.std.tolist(), strict=True)),
            "covariance": self.covariance.tolist(),
            "parameters": list(self.parameters),
            "experiments": self.experiments,
        }


def evaluate(study: Study, plan: Plan) -> Evaluation:
    """Score a plan under every criterion that the study can evaluate.

    Raises:
        SingularPlanError: The plan cannot identify all parameters; names them.
    """
    M = study.space.information(plan)
    cov = covariance(M, study.model.parameters)
    names = [
        n
        for n in criteria.available()
        if study.target is not None or not criteria.get(n).needs_target
    ]
    values = {n: float(study.criterion(n).value(M)) for n in names}
    return Evaluation(
        criteria=values,
        observability_unscaled=_unscaled(study, plan),
        std=np.sqrt(np.diag(cov)),
        covariance=cov,
        parameters=study.model.parameters,
        joints=study.specification.joints.unknown,
        units=study.model.units,
        experiments=plan.experiments,
    )


def _unscaled(study: Study, plan: Plan) -> dict[str, float]:
    """O1 to O5 of the stacked regressor without division by sigma."""
    A = study.model.regressor(plan.q, plan.wrench)
    M = np.einsum("k,kri,krj->ij", plan.repeats, A, A)
    return {n: float(criteria.create(n).value(M)) for n in ("O1", "O2", "O3", "O4", "O5")}
