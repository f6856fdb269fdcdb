"""Joint variables that a controller takes."""

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.system.typing import Array
from edtk.tables.in_file_units import rounded

LIMIT = 1e-9  # [rad or m]: a pose beyond a limit by less is at the limit, but for rounding


def to_steps(space: DesignSpace, x: Array) -> Array:
    """Joint variables (k, n) at the controller's nearest steps, or at a limit that lies there.

    Args:
        space: The feasible set.
        x: Design variables (k, v).
    """
    n = len(space.fixed)
    q = rounded(space.workspace.robot, x[:, :n])
    lower, upper = space.workspace.robot.hard_limits
    # A limit in degrees may have been converted with another last bit.
    within = np.clip(q, lower, upper)
    return np.where(np.abs(within - q) <= LIMIT, within, q)
