"""The way up to the largest sensitivity nearby."""

from edtk.design.interior_point.descend import descend
from edtk.design.relaxation.sensitivity import Sensitivity
from edtk.design.space import Space
from edtk.system.typing import Array

STEPS = 200
BARRIER = 0.1  # larger than for plans: one experiment is worth more than each of many


def ascend(
    space: Space,
    x: Array,
    Z: Array,
    per_trace: bool = False,
    unit: float = 1.0,
    accuracy: float = 1e-6,
    steps: int = STEPS,
) -> Array:
    """Move experiments uphill to a local maximum of the sensitivity, each under its own multiplier.

    Args:
        space: Feasible set and movable variables.
        x: Feasible starts (b, v).
        Z: Multipliers (b, p, p).
        per_trace: Whether sensitivities are per trace, see `sensitivity_and_slope`.
        unit: The size of a sensitivity.
        accuracy: Accuracy of the sensitivity at the end, in that unit.
        steps: Limit on steps.

    Returns:
        Feasible experiments (b, v), no less sensitive than the starts.
    """
    objective = Sensitivity(Z / unit, per_trace)
    ends = descend(space, x[:, None], objective, steps, accuracy, BARRIER)
    return ends[:, 0]
