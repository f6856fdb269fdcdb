"""The error to expect in tasks after a compensation, whole and in parts that have names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest, compensated_joints, unloaded
from edtk.measure.task import Task, Tasks, all_compliances
from edtk.robots.robot import Robot
from edtk.robots.workspace import neighbourhood
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

SAMPLE = 256  # poses within the limits, in which levers are looked for
SHORTEST = 1e-3  # reach of a robot that has none [m]
# Lever of a joint whose axis runs through the tool point, over the reach. No tool is a point: data
# sheets allow the payload at a tenth of the reach from the axes of a wrist, and at more of many.
WRIST = 0.1
# Gears are chosen so that the largest load turns them by minutes of arc.
BENT = 1e-3  # [rad]
SOFTEST = 1e-4  # no gear of a robot is softer, wrists of small collaborative robots included


def compensation_accuracy(A: Array, cov: Array) -> Array:
    """Eq. (17), the accuracy after compensation; Eq. (20) for the A0 of the test pose.

    ``rho = sqrt(E(dk' A' A dk)) = sqrt(trace(A cov A'))``.

    Args:
        A: Regressors (..., rows, p) of the task poses.
        cov: Covariance (p, p) of the compliances.

    Returns:
        Root mean square position error (...) [m].
    """
    return np.sqrt(np.einsum("...ri,...ri->...", A @ cov, A))


def remaining_error(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, believed: ArrayLike, true: ArrayLike
) -> Array:
    """Tool point under load minus the desired one, for a command from believed compliances.

    ``g(q + theta(q)) - g(q0)`` with ``q = q0 - believed * tau(q0)`` and the equilibrium theta of
    the true robot; to first order ``A0 (true - believed)``, of which Eq. (17) is the mean square.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) [N, N m].
        believed: Compliances (..., p) that the controller uses [rad/(N m)].
        true: Compliances (..., p) of the robot [rad/(N m)].

    Returns:
        Error (..., 3) [m].

    Raises:
        NoEquilibriumError: A pose buckles under the load.
    """
    q = compensated_joints(model, q0, wrench, believed)
    k = all_compliances(model, true)
    reached = model.robot.forward(Rest.of(model, q, wrench, k).end)[..., :3, 3]
    desired = model.robot.forward(unloaded(model, np.asarray(q0, dtype=float), k))[..., :3, 3]
    return np.asarray(reached - desired)


@dataclass(frozen=True)
class AssumedJoint:
    """A joint whose compliance is not identified.

    Attributes:
        name: The joint.
        index: Its index among the robot's joints.
        compliance: What the model takes: a known compliance, or zero of a joint that counts as
            rigid [rad/(N m)].
        std: How far the true compliance may be from that, at one standard deviation.
        source: Where that comes from, in words.
    """

    name: str
    index: int
    compliance: float
    std: float
    source: str

    @property
    def rigid(self) -> bool:
        """Whether it counts as rigid."""
        return self.compliance == 0.0


@dataclass(frozen=True, eq=False)
class AssumedError:
    """A joint that is not identified, and what its error does to the estimates.

    Attributes:
        joint: The joint.
        shifts: By how much estimates (p,) are off if its true compliance is one standard deviation
            more than is taken [rad/(N m)].
    """

    joint: AssumedJoint
    shifts: Array


def with_rigid(moved: ArrayLike, A: Array, joints: Sequence[AssumedJoint]) -> Array:
    """Root mean square displacement (...) without compensation, of which a part is assumed [m].

    How far a joint bends that counts as rigid is assumed, so that squares add up:
    ``sqrt(moved^2 + sum_j |A_j std_j|^2)``.

    Args:
        moved: Displacements (...) by the compliances that are identified or known [m].
        A: Columns (..., rows, a) of the target for the joints that are not identified.
        joints: These joints (a,).
    """
    std = np.array([one.std if one.rigid else 0.0 for one in joints])
    return np.asarray(np.sqrt(np.square(moved) + np.square(A * std).sum(axis=(-2, -1))))


@dataclass(frozen=True)
class Likely:
    """A compliance that a joint is likely to have.

    Attributes:
        compliance: Its size [rad/(N m)].
        source: Where it comes from, in words.
    """

    compliance: float
    source: str


def levers(robot: Robot) -> Array:
    """The largest distance (n,) of the tool point from each joint's axis [m].

    A gear is chosen for the load that it may have to hold, which is a force at the tool times this
    lever, whichever way the force points: so levers put joints in the order of their capacities.
    They are looked for in poses within the joint limits, ``max |dp/dq_j|``, and are a tenth of the
    reach at least, see `WRIST`.
    """
    lower, upper = np.clip(robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(0).uniform(lower, upper, (SAMPLE, robot.n))
    found = np.linalg.norm(robot.jacobian(q)[:, :3], axis=1).max(axis=0)
    return np.asarray(np.maximum(found, max(WRIST * robot.reach, SHORTEST)))


def as_neighbours(
    lever: Array, k: Mapping[int, float], joint: int, names: tuple[str, ...]
) -> Likely:
    """The compliance of a joint from those that are known of its neighbours by load capacity.

    It lies on a line of logarithms between the next longer and the next shorter lever; beyond the
    last of them it is that of the last.

    Args:
        lever: Levers (n,) of all joints [m].
        k: Positive compliances of some joints, by index [rad/(N m)].
        joint: Index of the joint.
        names: Names (n,) of the joints.
    """
    near = sorted(k, key=lambda other: lever[other])
    at = np.log(lever[near])
    here = float(np.log(lever[joint]))
    size = float(np.exp(np.interp(here, at, np.log([k[other] for other in near]))))
    above = int(np.searchsorted(at, here))
    ends = near[max(above - 1, 0) : above + 1]
    between = " and ".join(names[other] for other in sorted(ends))
    return Likely(size, f"as {between}, the nearest by load capacity")


def by_load(lever: float, force: float) -> Likely:
    """The compliance of a gear that the largest load on it turns by a milliradian.

    Args:
        lever: Its lever [m].
        force: Size of the force at the tool [N].
    """
    size = min(BENT / (lever * force), SOFTEST) if force > 0 else SOFTEST
    return Likely(size, "a gear that the load turns by 1 mrad at most")


@dataclass(frozen=True)
class JointPart:
    """What a joint that is not identified adds to the error in the task.

    Attributes:
        joint: The joint, with what is assumed of it.
        error: Its part of the total [m].
        told: With which standard deviation the measurements would tell its compliance, if it was
            unknown, by their noise; inf if they do not [rad/(N m)].
    """

    joint: AssumedJoint
    error: float
    told: float = np.inf

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, in SI units but for the error in millimetres."""
        return {
            "joint": self.joint.name,
            "rad_per_Nm": self.joint.compliance,
            "std_rad_per_Nm": self.joint.std,
            "source": self.joint.source,
            "error_mm": 1e3 * self.error,
            "told_std_rad_per_Nm": self.told if np.isfinite(self.told) else None,
        }


@dataclass(frozen=True)
class ErrorBudget(Presented):
    """Root mean square errors of the tool point after compensation in the task, by source [m].

    Attributes:
        noise: Of the measurements: rho0, Eq. (20).
        model: What the linear model leaves.
        load: A calibration load of another size or direction than stated.
        tool: A calibration tool point elsewhere than stated.
        rigid_joints: Joints that count as rigid, and bend.
        known_joints: Joints whose known compliances are not exactly so.
        drift: A shift between unloaded and loaded readings.
        repeatability: The robot does not stay where it was between two readings.
        uncompensated: The displacement of the task without any compensation, for comparison, with
            the joints that count as rigid.
        absolute: Whether displacements were counted from the rigid robot, whose geometry and
            place are then taken as exact.
        joints: The joints that make the parts of rigid and known ones, from base to tip.
        assumed_share: Share of what springs do that the model is assumed to leave out, where
            nothing is known of that; None where the study or a sheet says it.
    """

    noise: float
    model: float
    load: float
    tool: float
    rigid_joints: float
    known_joints: float
    drift: float
    repeatability: float
    uncompensated: float
    absolute: bool = False
    joints: tuple[JointPart, ...] = ()
    assumed_share: float | None = None

    @property
    def parts(self) -> dict[str, float]:
        """All parts by name [m]."""
        others = ("uncompensated", "absolute", "joints", "assumed_share")
        names = [field.name for field in fields(self) if field.name not in others]
        return {name: getattr(self, name) for name in names}

    @property
    def total(self) -> float:
        """The root of the sum of squares of all parts [m]."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @property
    def assumed(self) -> float:
        """The parts of the total that rest on what is assumed, together [m].

        They are of compliances, and of what springs leave out where nothing is known of that.
        """
        of_model = self.model if self.assumed_share is not None else 0.0
        return float(np.linalg.norm([self.rigid_joints, self.known_joints, of_model]))

    @property
    def measured(self) -> float:
        """All that the measurements make of the total [m]."""
        return float(np.sqrt(max(self.total**2 - self.assumed**2, 0.0)))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        return max(self.parts, key=self.parts.__getitem__)

    def headline(self) -> str:
        """The total and its largest part."""
        share = f"{1e3 * self.parts[self.largest]:.2g} mm by {self.largest.replace('_', ' ')}"
        return f"{1e3 * self.total:.2g} mm expected in the task, {share}"

    def to_dict(self) -> dict[str, Any]:
        """The parts and the total, in millimetres."""
        parts = {name: 1e3 * part for name, part in self.parts.items()}
        share = {} if self.assumed_share is None else {"assumed_percent": 100 * self.assumed_share}
        return {**parts, "total": 1e3 * self.total, **share}


@dataclass(frozen=True, eq=False)
class TaskAccuracy:
    """Errors of the tool point after compensation, for each task pose.

    Attributes:
        along: Length (t,) of the path from the first tool point to each, straight from one to the
            next [m].
        weight: Weights (t,) of the poses.
        error: Root mean square errors (t,), Eq. (17); rotations count where the task says so [m].
        band: Ends (t, 2) of the ranges in which 95 % of the errors lie [m].
        before: Displacement (t,) without compensation [m]; None if the compliances are not known.
        is_path: Whether the poses follow each other along a path.
        total: Errors (t,) with all that else is uncertain, see `ErrorBudget`, those around a pose
            included where its task says so [m]; None if they are not known.
    """

    along: Array
    weight: Array
    error: Array
    band: Array
    before: Array | None
    is_path: bool
    total: Array | None = None

    @property
    def worst(self) -> int:
        """Index of the pose with the largest error, among those that have a weight."""
        return self.worst_of(self.error)

    @property
    def mean(self) -> float:
        """Root of the weighted mean of squares: rho0, if no neighbourhoods count [m]."""
        return self.mean_of(self.error)

    def worst_of(self, errors: Array) -> int:
        """Index of the largest of some errors (t,), among poses that have a weight."""
        return int(np.where(self.weight > 0, errors, -1.0).argmax())

    def mean_of(self, errors: Array) -> float:
        """Root of the weighted mean of squares of some errors (t,)."""
        return float(np.sqrt(np.average(errors**2, weights=self.weight)))

    def to_frame(self) -> "pd.DataFrame":
        """A row for each pose: number from 1, weight, millimetres."""
        import pandas as pd

        columns: dict[str, Any] = {"pose": np.arange(1, len(self.error) + 1)}
        if self.is_path:
            columns["along_mm"] = 1e3 * self.along
        columns["weight"] = self.weight
        if self.before is not None:
            columns["uncompensated_mm"] = 1e3 * self.before
        if self.total is not None:
            columns["total_error_mm"] = 1e3 * self.total
        columns["error_mm"] = 1e3 * self.error
        columns["low_95_mm"] = 1e3 * self.band[:, 0]
        columns["high_95_mm"] = 1e3 * self.band[:, 1]
        return pd.DataFrame(columns)

    def to_dict(self) -> list[dict[str, Any]]:
        """Plain numbers for JSON, an object a pose [m]."""
        return [
            {
                "pose": i + 1,
                "along": float(self.along[i]),
                "weight": float(self.weight[i]),
                "uncompensated": None if self.before is None else float(self.before[i]),
                "error": float(self.error[i]),
                "error_band95": self.band[i].tolist(),
                **({} if self.total is None else {"total": float(self.total[i])}),
            }
            for i in range(len(self.error))
        ]


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
        by: What makes these errors, in words.
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
    by: str = "the noise alone"

    def __str__(self) -> str:
        if self.poses > 1:
            return self._of_several()
        lever = ""
        if self.rotation is not None:
            angle = f"{np.rad2deg(self.rotation):.2g} deg in the test pose"
            lever = f"; a rotation, {angle}, counts as at {1e3 * self.lever:g} mm"
        return (
            f"error by {self.by}: {1e3 * self.test_pose:.2g} mm in the test pose; within "
            f"{np.rad2deg(self.within):.3g} deg of it {1e3 * self.mean:.2g} mm on average, "
            f"{1e3 * self.largest:.2g} mm at most{lever}"
        )

    def _of_several(self) -> str:
        counted = ""
        if self.rotation is not None:
            counted = f"; rotations count as at {1e3 * self.lever:g} mm"
        return (
            f"error by {self.by}: {1e3 * self.test_pose:.2g} mm in the {self.poses} test "
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
        rotation = float(compensation_accuracy(A[0, -3:], cov) / task.lever)
    return ExpectedError(
        test_pose=float(errors[0]),
        mean=float(np.sqrt(np.mean(errors**2))),
        largest=float(errors.max()),
        within=within,
        lever=task.lever,
        rotation=rotation,
        worst=float(errors[0]),
    )
