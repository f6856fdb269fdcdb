"""Nonlinear refinement: all poses of a plan move together under the constraints."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.descend import descend
from edtk.design.exact import PoseDesign
from edtk.design.plan import Plan

Array = NDArray[np.float64]


SHARPNESS = (10.0, 50.0, 250.0)  # of the soft maxima that take a criterion with kinks down


def refine(design: PoseDesign, criterion: Criterion, plan: Plan, iterations: int = 150) -> Plan:
    """Minimise the logarithm of the criterion's cost over the free joints of all poses, see `descend`.

    A criterion with kinks is taken down by smooth ones above it, sharper and sharper (`Criterion.smoothed`); what
    counts in the end is the criterion itself.

    Args:
        design: Model, feasible set and free joints.
        criterion: What to improve.
        plan: The start; its repetitions and wrenches are kept.
        iterations: Limit on iterations, of each smooth criterion.

    Returns:
        A plan that violates no constraint, unless the start did and nothing better was found; never worse than a
        feasible start.
    """
    guides = [criterion] if criterion.smooth else [criterion.smoothed(s) for s in SHARPNESS]
    met = [plan]
    for guide in guides:

        def objective(q: Array, guide: Criterion = guide) -> tuple[float, Array]:
            return design.cost_and_gradient(guide, replace(plan, q=q))

        met.append(replace(plan, q=descend(design, met[-1].q, objective, iterations)))
    return min(met, key=lambda p: _score(design, criterion, p))


def _score(design: PoseDesign, criterion: Criterion, plan: Plan) -> tuple[bool, float]:
    """Order of plans: feasible ones first, then by cost."""
    outside = not design.workspace.contains(plan.q).all()
    return bool(outside), float(criterion.cost(design.information(plan)))
