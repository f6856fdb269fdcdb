"""Nonlinear refinement: all poses of a plan move together under the constraints."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.descend import descend
from edtk.design.exact import PoseDesign
from edtk.design.plan import Plan

Array = NDArray[np.float64]


def refine(design: PoseDesign, criterion: Criterion, plan: Plan, iterations: int = 150) -> Plan:
    """Minimise the logarithm of the criterion's cost over the free joints of all poses, see `descend`.

    Args:
        design: Model, feasible set and free joints.
        criterion: What to improve.
        plan: The start; its repetitions and wrenches are kept.
        iterations: Limit on iterations.

    Returns:
        A plan that violates no constraint, unless the start did and nothing better was found.
    """

    def objective(q: Array) -> tuple[float, Array]:
        return design.cost_and_gradient(criterion, replace(plan, q=q))

    return replace(plan, q=descend(design, plan.q, objective, iterations))
