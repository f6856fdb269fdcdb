"""What accuracy to expect in test poses, and around them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.neighbourhood import neighbourhood
from edtk.model.task import Task
from edtk.model.tasks import Tasks
from edtk.system.typing import Array

# Around a test pose alone the error is shown within so much: about how far a task reaches.
WITHIN = float(np.deg2rad(30))


@dataclass(frozen=True)
class ExpectedError:
    """Root mean square errors after compensation, Eq. (17), in a test pose and around it.

    Over several test poses they are roots of the mean of squares, with the weights of the poses.

    Attributes:
        test_pose: In the test pose itself [m].
        mean: Root mean square over the neighbourhood [m].
        largest: The largest in any pose of the neighbourhood that was looked at [m].
        within: Size of the neighbourhood, see `neighbourhood` [rad].
        lever: Distance at which rotations of the tool count in all three; zero for none [m].
        rotation: Root mean square rotation of the tool in the test pose [rad]; None without lever.
        poses: Number of test poses.
        worst: Error in the worst test pose that has a weight [m].
        worst_pose: Which one that is, counted from 1.
    """

    test_pose: float
    mean: float
    largest: float
    within: float
    lever: float
    rotation: float | None = None
    poses: int = 1
    worst: float = 0.0
    worst_pose: int = 1

    def __str__(self) -> str:
        if self.poses > 1:
            return self._of_several()
        lever = ""
        if self.rotation is not None:
            angle = f"{np.rad2deg(self.rotation):.2g} deg in the test pose"
            lever = f"; a rotation, {angle}, counts as at {1e3 * self.lever:g} mm"
        return (
            f"error by the noise alone: {1e3 * self.test_pose:.2g} mm in the test pose; within "
            f"{np.rad2deg(self.within):.3g} deg of it {1e3 * self.mean:.2g} mm on average, "
            f"{1e3 * self.largest:.2g} mm at most{lever}"
        )

    def _of_several(self) -> str:
        counted = ""
        if self.rotation is not None:
            counted = f"; rotations count as at {1e3 * self.lever:g} mm"
        return (
            f"error by the noise alone: {1e3 * self.test_pose:.2g} mm in the {self.poses} test "
            f"poses (root mean square), {1e3 * self.worst:.2g} mm in the worst of them, pose "
            f"{self.worst_pose}; within {np.rad2deg(self.within):.3g} deg of them "
            f"{1e3 * self.mean:.2g} mm on average, {1e3 * self.largest:.2g} mm at most{counted}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, SI, but the size of the neighbourhood in degrees."""
        found = {
            "test_pose": self.test_pose,
            "mean": self.mean,
            "largest": self.largest,
            "within_deg": float(np.rad2deg(self.within)),
            "lever": self.lever,
            "rotation": self.rotation,
        }
        if self.poses == 1:
            return found
        return found | {"poses": self.poses, "worst": self.worst, "worst_pose": self.worst_pose}


def expected_error(task: Task | Tasks, cov: Array) -> ExpectedError:
    """Find the error in test poses, and in their neighbourhoods.

    Args:
        task: The test pose, or several; without a neighbourhood of its own, that of 30 degrees is
            taken.
        cov: Covariance (p, p) of the compliances.
    """
    if isinstance(task, Task):
        return _in_one(task, cov)
    if len(task) == 1:
        return _in_one(task[0], cov)
    return _in_several(task, [_in_one(each, cov) for each in task])


def _in_several(tasks: Tasks, each: list[ExpectedError]) -> ExpectedError:
    """The errors over several test poses, from those in each of them."""
    shares = tasks.shares
    counts = shares > 0

    def mean(errors: list[float]) -> float:
        return float(np.sqrt(shares @ np.square(errors)))

    errors = np.array([one.test_pose for one in each])
    worst = int(np.where(counts, errors, -1.0).argmax())
    levers = {one.lever for one in each}
    rotation = None
    if len(levers) == 1 and max(levers):
        rotation = mean([one.rotation or 0.0 for one in each])
    return ExpectedError(
        test_pose=mean([one.test_pose for one in each]),
        mean=mean([one.mean for one in each]),
        largest=max(one.largest for one, counted in zip(each, counts, strict=True) if counted),
        within=max(one.within for one in each),
        lever=max(levers),
        rotation=rotation,
        poses=len(each),
        worst=float(errors[worst]),
        worst_pose=worst + 1,
    )


def _in_one(task: Task, cov: Array) -> ExpectedError:
    """The errors in one test pose and its neighbourhood."""
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
        worst=float(errors[0]),
    )
