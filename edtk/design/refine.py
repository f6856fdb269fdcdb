"""Nonlinear refinement: all poses of a plan move together under the constraints."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from criteria import Criterion
from edtk.design.exact import PoseDesign
from edtk.design.plan import Plan

Array = NDArray[np.float64]


def refine(design: PoseDesign, criterion: Criterion, plan: Plan, iterations: int = 150) -> Plan:
    """Improve the poses by sequential quadratic programming with analytic gradients.

    Minimises the logarithm of the criterion's cost over the free joints of all poses, joint limits as bounds
    and the workspace as inequalities. At a kink of a non-smooth criterion the step uses a subgradient and may
    stall, so the best feasible plan met on the way is what is returned: never worse than a feasible start.

    Args:
        design: Model, feasible set and free joints.
        criterion: What to improve.
        plan: The start; its repetitions and wrenches are kept.
        iterations: Limit on iterations.

    Returns:
        A plan that violates no constraint, unless the start did and nothing better was found.
    """
    k, free = len(plan.q), design.free
    lower, upper = design.workspace.robot.limits[:, free]
    cases = list(range(_workspace_rows(design)))
    best: list[tuple[float, Plan]] = [(_score(design, criterion, plan), plan)]

    def poses(x: Array) -> Plan:
        q = plan.q.copy()
        q[:, free] = np.clip(x.reshape(k, -1), lower, upper)
        return replace(plan, q=q)

    def objective(x: Array) -> tuple[float, Array]:
        here = poses(x)
        f, g = design.cost_and_gradient(criterion, here)
        if f < best[0][0] and _feasible(design, here):
            best[0] = (f, here)
        return (f, g[:, free].ravel()) if np.isfinite(f) else (1e3, np.zeros(x.shape))

    def slack(x: Array) -> Array:
        return design.workspace.slack(poses(x).q)[:, cases].ravel() - 1e-9

    def slack_gradient(x: Array) -> Array:
        G = design.workspace.gradient(poses(x).q)[:, cases][..., free]
        full = np.zeros((k, len(cases), k, len(free)))
        full[np.arange(k), :, np.arange(k)] = G
        return full.reshape(k * len(cases), -1)

    result = minimize(
        objective,
        plan.q[:, free].ravel(),
        jac=True,
        method="SLSQP",
        bounds=list(zip(np.tile(lower, k), np.tile(upper, k), strict=True)),
        constraints=[{"type": "ineq", "fun": slack, "jac": slack_gradient}] if cases else [],
        options={"maxiter": iterations, "ftol": 1e-10},
    )
    objective(result.x)
    return best[0][1]


def _workspace_rows(design: PoseDesign) -> int:
    """Number of inequalities besides the joint limits, which come last and are kept as bounds."""
    return len(design.workspace.labels) - 2 * design.workspace.robot.n


def _feasible(design: PoseDesign, plan: Plan) -> bool:
    return bool(design.workspace.contains(plan.q).all())


def _score(design: PoseDesign, criterion: Criterion, plan: Plan) -> float:
    """Log cost of a feasible plan, else inf."""
    return design.cost_and_gradient(criterion, plan)[0] if _feasible(design, plan) else np.inf
