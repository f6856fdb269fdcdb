"""Constrained descent over feasible poses, by sequential quadratic programming."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from edtk.design.exact import PoseDesign

Array = NDArray[np.float64]
Objective = Callable[[Array], tuple[float, Array]]


def descend(
    design: PoseDesign, q: Array, objective: Objective, iterations: int = 150, tolerance: float = 1e-10
) -> Array:
    """Poses from which SLSQP sees no way further down, joint limits as bounds and the workspace as inequalities.

    At a kink of the objective the step uses a subgradient and may stall, so the best feasible poses met on the way
    are what is returned: never worse than a feasible start.

    Args:
        design: The feasible set and the free joints.
        q: Poses to start from (k, n).
        objective: Value and gradient (k, n) at poses (k, n); the value may be inf.
        iterations: Limit on iterations.
        tolerance: On the objective's change.

    Returns:
        Poses (k, n) that violate no constraint, unless the start did and nothing better was found.
    """
    workspace, free = design.workspace, design.free
    k, rows = len(q), len(workspace.labels) - 2 * workspace.robot.n  # joint limits come last, and are kept as bounds
    lower, upper = workspace.robot.limits[:, free]
    best, least = q, objective(q)[0] if workspace.contains(q).all() else np.inf

    def poses(x: Array) -> Array:
        here = q.copy()
        here[:, free] = np.clip(x.reshape(k, -1), lower, upper)
        return here

    def value(x: Array) -> tuple[float, Array]:
        nonlocal best, least
        here = poses(x)
        f, g = objective(here)
        if f < least and workspace.contains(here).all():
            best, least = here, f
        return (f, g[:, free].ravel()) if np.isfinite(f) else (1e3, np.zeros(x.shape))

    def slack(x: Array) -> Array:
        return workspace.slack(poses(x))[:, :rows].ravel() - 1e-9

    def slack_gradient(x: Array) -> Array:
        G = workspace.gradient(poses(x))[:, :rows][..., free]
        full = np.zeros((k, rows, k, len(free)))
        full[np.arange(k), :, np.arange(k)] = G
        return full.reshape(k * rows, -1)

    result = minimize(
        value,
        q[:, free].ravel(),
        jac=True,
        method="SLSQP",
        bounds=list(zip(np.tile(lower, k), np.tile(upper, k), strict=True)),
        constraints=[{"type": "ineq", "fun": slack, "jac": slack_gradient}] if rows else [],
        options={"maxiter": iterations, "ftol": tolerance},
    )
    value(result.x)
    return best
