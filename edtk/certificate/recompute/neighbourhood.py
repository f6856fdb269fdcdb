"""The poses around a test pose, one after the other from their definition."""

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.system.typing import Array

LEVELS = 127  # of each joint; a prime
STEP = 45  # from one joint's order of the levels to the next joint's


def neighbourhood(chain: Chain, q: Array, within: float) -> Array:
    """Poses (255, n) whose joints are within an angle of the test pose q (n,), itself the first.

    They are the points of a lattice in the box ``[lower, upper]`` and their mirror images in turn.
    Each joint takes 127 levels once: point i has level i for the first joint, and for each further
    joint 45 times the level of the joint before, modulo 127.

    Args:
        chain: The robot, whose limits cut the box.
        q: The test pose [rad or m].
        within: Largest turn [rad]; a prismatic joint moves by ``within / 2 pi`` of its range.
    """
    ranges = chain.limits[1] - chain.limits[0]
    most = np.where(chain.prismatic, ranges * within / (2 * np.pi), within)
    # The test pose belongs to the box even where it is beyond a limit.
    lower = np.minimum(np.clip(q - most, chain.ends[0], None), q)
    upper = np.maximum(np.clip(q + most, None, chain.ends[1]), q)
    poses = [q]
    for i in range(LEVELS):
        levels = [i]
        while len(levels) < len(q):
            levels.append(levels[-1] * STEP % LEVELS)
        share = (np.array(levels) + 0.5) / LEVELS
        poses.append(lower * (1 - share) + upper * share)
        poses.append(lower * share + upper * (1 - share))
    return np.array(poses)
