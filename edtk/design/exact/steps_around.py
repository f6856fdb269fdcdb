"""Poses on the steps of a controller around one."""

from itertools import product

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.exact.to_steps import to_steps
from edtk.system.typing import Array
from edtk.tables.in_file_units import controller_step


def steps_around(space: DesignSpace, x: Array, wider: int) -> Array:
    """Feasible experiments (n, v) whose designed joints are at the steps around those of one.

    Args:
        space: Model and feasible set.
        x: Design variables (v,) of the one.
        wider: Steps beyond the two neighbouring ones of each joint.
    """
    robot = space.workspace.robot
    step = controller_step(robot)[space.free]
    shown = robot.shown(x[: robot.n])
    offsets = np.array(list(product(range(-wider, 2 + wider), repeat=len(step))))
    near = np.tile(shown, (len(offsets), 1))
    near[:, space.free] = (np.floor(shown[space.free] / step) + offsets) * step
    tried = np.tile(x, (len(offsets), 1))
    tried[:, space.free] = robot.of_shown(near)[:, space.free]
    tried[:, space.free] = to_steps(space, tried)[:, space.free]
    return np.asarray(tried[space.at(tried).feasible])


def number_around(space: DesignSpace, wider: int) -> int:
    """Number of these steps."""
    return int((2 * (1 + wider)) ** len(space.free))
