"""The poses around a test pose in which the robot shall be accurate too."""

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Array

PAIRS = 127  # pairs of mirrored poses; with the test pose itself, 255 poses
# Of all generators of a lattice of 127 points that have the full order 126, this one leaves the
# least correlation between joints: at most 0.08 for up to eight of them, where random points have
# about 0.2.
GENERATOR = 45


def neighbourhood(robot: Robot, q: Array, within: float) -> Array:
    """Spread poses evenly over the neighbourhood of a test pose, always the same ones.

    A revolute joint moves by at most `within` to either side, and a prismatic joint by the share
    ``within / 2 pi`` of its range; joint limits cut both. The box that is left is filled by
    Korobov's lattice, which is more even than random points: point i = 1 .. 127 has the share
    ``u_ij = ((i 45^(j-1) mod 127) + 1/2) / 127`` of the way for joint j = 1 .. n. Each point comes
    with its mirror image 1 - u, which makes the mean of everything linear exact.

    Args:
        robot: The chain, with its limits.
        q: The test pose (n,) [rad or m].
        within: Largest turn of a joint [rad].

    Returns:
        Poses (255, n) [rad or m], the test pose first.
    """
    travel = np.array(
        [
            within if joint.kind == "revolute" else within / (2 * np.pi) * np.ptp(joint.limits)
            for joint in robot.joints
        ]
    )
    lower, upper = robot.hard_limits
    # A test pose beyond a limit stays in its own neighbourhood.
    low = np.minimum(q, np.maximum(lower, q - travel))
    high = np.maximum(q, np.minimum(upper, q + travel))
    steps = np.array([pow(GENERATOR, j, PAIRS) for j in range(robot.n)])
    u = (np.arange(1, PAIRS + 1)[:, None] * steps % PAIRS + 0.5) / PAIRS
    return np.concatenate([q[None], low + (high - low) * u, high - (high - low) * u])
