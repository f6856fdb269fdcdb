"""Joint variables in the units and digits of files."""

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Array
from edtk.tables.pose_table import pose_factors

DIGITS = 3  # decimals of a degree or a millimetre that a controller takes
CONVERSION = 1e-10  # [deg or mm]: more than the rounding of a conversion to SI units and back


def in_file_units(robot: Robot, q: Array) -> Array:
    """What the controller shows (..., n) in degrees and millimetres, for q (..., n) [rad or m].

    A number that a controller takes comes out as that number to the last digit.
    """
    values = np.asarray(robot.shown(q) / pose_factors(robot))
    whole = np.round(values, DIGITS)
    # The sum has no negative zero.
    return np.where(np.abs(values - whole) <= CONVERSION, whole, values) + 0.0


def of_file_units(robot: Robot, values: Array) -> Array:
    """Joint variables (..., n) [rad or m] for what the controller shows (..., n) [deg or mm]."""
    return robot.of_shown(np.asarray(values * pose_factors(robot)))


def controller_step(robot: Robot) -> Array:
    """Steps (n,) in which a controller takes joint variables [rad or m]."""
    return np.asarray(pose_factors(robot) / 10**DIGITS)


def rounded(robot: Robot, q: Array) -> Array:
    """Joint variables (..., n) [rad or m] as a controller takes them, nearest to q (..., n).

    A file gives the same numbers back, bit by bit.
    """
    shown = np.round(robot.shown(q) / pose_factors(robot), DIGITS) + 0.0
    return of_file_units(robot, shown)
