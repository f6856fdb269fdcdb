"""What accuracy to expect in a test pose, and around it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.neighbourhood import neighbourhood
from edtk.model.task import Task
from edtk.system.typing import Array

# Around a test pose alone the error is shown within so much: about how far a task reaches.
WITHIN = float(np.deg2rad(30))


@dataclass(frozen=True)
class ExpectedError:
    """Root mean square errors after compensation, Eq. (17), in a test pose and around it.

    Attributes:
        test_pose: In the test pose itself [m].
        mean: Root mean square over the neighbourhood [m].
        largest: The largest in any pose of the neighbourhood that was looked at [m].
        within: Size of the neighbourhood, see `neighbourhood` [rad].
        lever: Distance at which rotations of the tool count in all three; zero for none [m].
        rotation: Root mean square rotation of the tool in the test pose [rad]; None without lever.
    """

    test_pose: float
    mean: float
    largest: float
    within: float
    lever: float
    rotation: float | None = None

    def __str__(self) -> str:
        lever = ""
        if self.rotation is not None:
            angle = f"{np.rad2deg(self.rotation):.2g} deg in the test pose"
            lever = f"; a rotation, {angle}, counts as at {1e3 * self.lever:g} mm"
        return (
            f"expected error: {1e3 * self.test_pose:.2g} mm in the test pose; within "
            f"{np.rad2deg(self.within):.3g} deg of it {1e3 * self.mean:.2g} mm on average, "
            f"{1e3 * self.largest:.2g} mm at most{lever}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, SI, but the size of the neighbourhood in degrees."""
        return {
            "test_pose": self.test_pose,
            "mean": self.mean,
            "largest": self.largest,
            "within_deg": float(np.rad2deg(self.within)),
            "lever": self.lever,
            "rotation": self.rotation,
        }


def expected_error(task: Task, cov: Array) -> ExpectedError:
    """Find the error in a test pose, and in its neighbourhood.

    Args:
        task: The test pose; without a neighbourhood of its own, that of 30 degrees is taken.
        cov: Covariance (p, p) of the compliances.
    """
    within = task.within or WITHIN
    A = task.harm(neighbourhood(task.robot, task.q, within))
    errors = compensation_accuracy(A, cov)
    rotation = None
    if task.lever:
        rotation = float(compensation_accuracy(A[0, 3:], cov) / task.lever)
    return ExpectedError(
        test_pose=float(errors[0]),
        mean=float(np.sqrt(np.mean(errors**2))),
        largest=float(errors.max()),
        within=within,
        lever=task.lever,
        rotation=rotation,
    )
