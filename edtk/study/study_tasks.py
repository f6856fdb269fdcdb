"""The tasks of a study, from its test poses or from the file of a path."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.design.plan import Plan
from edtk.model.task import Task
from edtk.model.tasks import Tasks
from edtk.study.check_tasks import check_limits
from edtk.study.study_model import task_weights
from edtk.study.test_pose import TestPose
from edtk.system.note import note
from edtk.tables.in_file_units import of_file_units

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects

MOST_POSES = 1000  # of a path that count; more would cost minutes, and tell no more


def study_tasks(study: "StudyObjects") -> Tasks:
    """The poses in which the robot shall be accurate, in their order; there may be none.

    Raises:
        UserError: The file of a path cannot be read, or has a pose that the robot cannot take;
            names the row and the column.
    """
    if study.specification.task is not None:
        return _of_file(study)
    return Tasks(_of_table(study, pose) for pose in study.specification.test_poses)


def _of_table(study: "StudyObjects", pose: TestPose) -> Task:
    """The task of one test pose."""
    return Task(
        q=of_file_units(study.robot, np.array(pose.q_deg)),
        tool=pose.tool.build(),
        wrench=pose.load.build(),
        robot=study.robot,
        unknown=study.unknown,
        known=tuple(study.known),
        within=float(np.deg2rad(pose.robust_deg)),
        lever=pose.lever_mm / 1e3,
        weight=pose.weight,
        dead_weights=task_weights(study, pose.payload),
    )


def _of_file(study: "StudyObjects") -> Tasks:
    """The tasks of a path, all with its tool, a row each; a long path is thinned, with a note."""
    given = study.specification.task
    assert given is not None
    load = None if given.load is None else given.load.build()
    path = study.folder / given.file
    plan = Plan.from_csv(path, study.robot, study.fixed, load)
    check_limits(study, plan.q)
    count = len(plan.q)
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_POSES)).round().astype(int))
    if len(rows) < count:
        note(
            f"{len(rows)} of {count} poses count, evenly spread from the first row to the last, "
            "and are numbered among themselves",
            path,
        )
    tool = given.tool.build()
    weights = task_weights(study, given.payload)
    return Tasks(
        Task(
            q=q,
            tool=tool,
            wrench=wrench,
            robot=study.robot,
            unknown=study.unknown,
            known=tuple(study.known),
            within=float(np.deg2rad(given.robust_deg)),
            lever=given.lever_mm / 1e3,
            dead_weights=weights,
        )
        for q, wrench in zip(plan.q[rows], plan.wrench[rows], strict=True)
    )
