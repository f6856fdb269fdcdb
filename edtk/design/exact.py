"""Information and cost of exact plans as functions of the poses, with gradients."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria import Criterion
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.model import ElastostaticModel, Workspace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PoseDesign:
    """Where poses may lie and what a measurement in them tells.

    Args:
        model: The elastostatic model, with the calibration tool.
        workspace: The feasible set of the same robot.
        sigma: Standard deviation of each measured row (rows,) [m, rad].
        wrench: The wrench (6,) of every experiment [N, N m].
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,) whose entries outside `free` are kept.
    """

    model: ElastostaticModel
    workspace: Workspace
    sigma: Array
    wrench: Array
    free: list[int]
    fixed: Array

    def problem(self, q: Array, wrench: ArrayLike | None = None) -> Problem:
        """The candidates q (k, n) as a problem of arrays."""
        W = self.wrench if wrench is None else wrench
        return Problem(self.model.regressor(q, W), self.sigma, self.model.parameters)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan."""
        return self.problem(plan.q, plan.wrench).information(plan.repeats)

    def plan(self, q: Array, repeats: NDArray[np.int_]) -> Plan:
        """A plan of these poses under the common wrench."""
        return Plan(q, np.tile(self.wrench, (len(q), 1)), repeats)

    def cost_and_gradient(self, criterion: Criterion, plan: Plan) -> tuple[float, Array]:
        """Logarithm of the criterion's cost, and its gradient (k, n) with respect to the poses.

        ``d log f = <G, dM>/f`` and ``dM = sum r_i (dA_i' A_i + A_i' dA_i)/sigma^2`` give
        ``d log f/dq_ik = (2 r_i/f) <A_i G, dA_i/dq_k>/sigma^2``.
        """
        A, dA = self.model.linearise(plan.q, plan.wrench)
        A, dA = A / self.sigma[:, None], dA / self.sigma[:, None, None]
        M = np.einsum("k,kri,krj->ij", plan.repeats, A, A)
        cost = float(criterion.cost(M))
        if not np.isfinite(cost):
            return np.inf, np.zeros_like(plan.q)
        dq = np.einsum("kri,krin->kn", A @ criterion.gradient(M), dA)
        return float(np.log(cost)), 2.0 / cost * plan.repeats[:, None] * dq
