"""Feasible candidate poses, uniform in the joint limits."""

import numpy as np
from numpy.typing import NDArray

from edtk.model import Workspace

Array = NDArray[np.float64]


class EmptyFeasibleSetError(ValueError):
    """No pose satisfies all constraints, as far as sampling can tell."""


def sample_feasible(
    workspace: Workspace,
    n: int,
    rng: np.random.Generator,
    free: list[int],
    fixed: Array,
    chunk: int = 4096,
    patience: int = 50,
) -> Array:
    """Draw poses uniformly in the joint limits until n of them satisfy every constraint.

    Args:
        workspace: The feasible set.
        n: How many poses.
        rng: Source of randomness.
        free: Indices of the joints that vary.
        fixed: Joint variables (n_joints,) whose entries outside `free` are kept.
        chunk: Draws per round.
        patience: Rounds to wait for the first feasible pose.

    Returns:
        Poses (n, n_joints) [rad or m].

    Raises:
        EmptyFeasibleSetError: Names the constraint that excludes most of the samples.
    """
    lower, upper = workspace.robot.limits[:, free]
    found: list[Array] = []
    count, drawn, violated = 0, 0, np.zeros(len(workspace.labels))
    while count < n:
        q = np.tile(fixed, (chunk, 1))
        q[:, free] = rng.uniform(lower, upper, size=(chunk, len(free)))
        slack = workspace.slack(q)
        inside = q[(slack >= 0).all(axis=-1)]
        found.append(inside)
        count, drawn = count + len(inside), drawn + chunk
        violated += (slack < 0).sum(axis=0)
        if not count and drawn >= patience * chunk:
            worst = int(violated.argmax())
            raise EmptyFeasibleSetError(
                f"no feasible pose among {drawn} samples; the constraint '{workspace.labels[worst]}' "
                f"excludes {100 * violated[worst] / drawn:.0f} % of them"
            )
    return np.concatenate(found)[:n] if found else np.empty((0, workspace.robot.n))
