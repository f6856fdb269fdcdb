"""The checks of a study's tasks: what is given twice or not at all, loads, and joint limits."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.model.shown_limit import shown_limits
from edtk.system.errors import UserError
from edtk.system.typing import Array
from edtk.tables.pose_table import pose_factors

if TYPE_CHECKING:
    from edtk.study.study import Study
    from edtk.study.study_objects import StudyObjects

# Displacement of the tool by 1 rad/(N m) below which a load turns no joint: what rounding leaves.
LEAST_HARM = 1e-9  # [m]
ROUNDING = 1e-9  # by how much a joint may be beyond its limits [rad or m]


def check_tasks(study: "Study") -> None:
    """Check that a study's tasks make sense for its robot.

    Raises:
        UserError: One line that names the study or the file of the path, the key and what was
            expected.
    """
    specification = study.specification
    if specification.task is not None and specification.test_pose is not None:
        raise study.error("task", "expected one of [test_pose] and [task], the study has both")
    for i, pose in enumerate(specification.test_poses):
        key = key_of(study, i)
        if len(pose.q_deg) != study.robot.n:
            raise study.error(
                f"{key}.q_deg",
                f"has {len(pose.q_deg)} entries, expected {study.robot.n}, one per joint",
            )
        # rho0 has no meaning where errors of compliances do no harm; those of the geometry do.
        if (
            specification.parameters is None
            and pose.payload is None
            and not any((*pose.load.F_N, *pose.load.T_Nm))
        ):
            raise study.error(
                f"{key}.load", "a test pose without load has nothing to compensate; expected a load"
            )
    if not study.tasks:
        return
    _check_weights(study)
    if specification.task is None:
        check_limits(study, np.array([task.q for task in study.tasks]))
    if specification.parameters is not None:
        return  # the geometry is in error in every pose, whatever the load turns
    if study.target is not None and np.abs(study.target).max() < LEAST_HARM:
        where = "in the test pose" if len(study.tasks) == 1 else "in any of the test poses"
        raise study.error(
            "test_pose.load" if specification.task is None else "task.load",
            f"the load turns no joint of joints.unknown {where}, so that there is nothing "
            "to compensate; expected another load, tool or pose",
        )


def key_of(study: "StudyObjects", index: int) -> str:
    """The key of a test pose, as messages name it."""
    return "test_pose" if len(study.specification.test_poses) == 1 else f"test_pose.{index}"


def _check_weights(study: "Study") -> None:
    if not any(task.weight for task in study.tasks):
        raise study.error(
            f"{key_of(study, 0)}.weight",
            "the weights of all test poses are 0; expected one above it",
        )


def check_limits(study: "StudyObjects", q: Array) -> None:
    """Check that the robot can take all poses (t, n): the test poses, or the rows of a path.

    Raises:
        UserError: It cannot take one of them; names it.
    """
    lower, upper = study.robot.hard_limits
    outside = (q < lower - ROUNDING) | (q > upper + ROUNDING)
    if outside.any():
        i = int(outside.any(axis=1).argmax())
        joints = np.flatnonzero(outside[i])
        raise _beyond(study, i, q[i], joints[0], len(joints) - 1)


def _beyond(study: "StudyObjects", index: int, q: Array, j: int, more: int) -> UserError:
    """The error of a pose that is beyond a joint's limits, as the controller shows them."""
    lower, upper = study.robot.limits
    shown = shown_limits(study.robot)[j]
    limits = shown.range((lower[j], upper[j]))
    factor = pose_factors(study.robot)[j]
    low, value, high = np.array([limits[0], shown.of(q[j]), limits[1]]) / factor
    others = f", and {more} more" if more else ""
    message = (
        f"the robot cannot take this pose: joint {shown.label} is at {value:.6g}, beyond its "
        f"limits {low:.6g} .. {high:.6g}{others}"
    )
    given = study.specification.task
    if given is None:
        return study.error(f"{key_of(study, index)}.q_deg", message)
    return UserError(message, where=Path(study.folder / given.file), key=f"row {index + 1}")
