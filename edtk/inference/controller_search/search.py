"""The best fit of each way to count, over all offsets of the joints."""

from itertools import product

import numpy as np

from edtk.inference.controller_search.descend import descend
from edtk.inference.controller_search.fits import Fits
from edtk.inference.controller_search.place_frames import place_frames
from edtk.inference.controller_search.positions import Positions
from edtk.inference.controller_search.ways_to_count import WayToCount
from edtk.model.robot import Robot
from edtk.system.typing import Array

QUARTERS = np.deg2rad([0.0, 90.0, 180.0, -90.0])  # zeros that makers choose
MOST_QUARTERS = 1024
SPREAD = (16, 4, 1024)  # further offsets, spread evenly: 16 times 4 for each, at most 1024
# Of all offsets those that begin best are improved a little, and of these a few to the end.
BEGIN = 64
SHORT = 6
FINISH = 6
LONG = 30
MOST_TOGETHER = 100_000  # fits times positions: each takes some kilobytes


def search(
    robot: Robot, ways: tuple[WayToCount, ...], positions: Positions, free: list[int]
) -> Fits:
    """Find the best fit of each way to count.

    Args:
        robot: The chain, its tool frame the flange.
        ways: The ways (w,).
        positions: The measurements.
        free: Joints whose offsets are told by such measurements.

    Returns:
        One fit for each way (w,).
    """
    offsets = _offsets(robot, free)
    markers = len(positions.names)
    lots = []
    for way in ways:
        counting = np.broadcast_to(way.counting, (len(offsets), robot.n, robot.n))
        begun = place_frames(robot, Fits.at(counting, offsets, markers), positions)
        lots.append(begun[np.argsort(begun.rms)[:BEGIN]])
    size = len(lots[0])
    together = max(1, MOST_TOGETHER // (size * len(positions)))
    found = []
    for first in range(0, len(lots), together):
        begun = Fits.joined(lots[first : first + together])
        short = descend(robot, begun, positions, free, SHORT)
        long = descend(robot, _best(short, size, FINISH), positions, free, LONG)
        found.append(_best(long, min(size, FINISH), 1))
    return Fits.joined(found)


def _best(fits: Fits, size: int, kept: int) -> Fits:
    """Of each lot of `size` fits the best ones."""
    rms = fits.rms.reshape(-1, size)
    order = np.argsort(rms, axis=1)[:, :kept] + size * np.arange(len(rms))[:, None]
    return fits[order.reshape(-1)]


def _offsets(robot: Robot, free: list[int]) -> Array:
    """Offsets (s, n) to begin with; those of joints that slide begin at zero."""
    from scipy.stats import qmc

    turning = [j for j in free if robot.joints[j].kind != "prismatic"]
    if not turning:
        return np.zeros((1, robot.n))
    first, factor, most = SPREAD
    count = min(first * factor ** len(turning), most)
    spread = (2 * qmc.Sobol(len(turning), seed=0).random(count) - 1) * np.pi
    parts = [spread]
    if len(QUARTERS) ** len(turning) <= MOST_QUARTERS:
        parts.append(np.array(list(product(QUARTERS, repeat=len(turning)))))
    values = np.concatenate(parts)
    offsets = np.zeros((len(values), robot.n))
    offsets[:, turning] = values
    return offsets
