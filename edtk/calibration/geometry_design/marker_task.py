"""A test pose of a study of geometry, in which all markers shall be where the model has them."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.geometry_design.geometry_question import UNTOLD, GeometryQuestion
from edtk.calibration.geometry_design.position_rows import MM, PositionRows
from edtk.model.task import Task
from edtk.model.tasks import Tasks
from edtk.system.typing import Array
from edtk.tables.in_file_units import of_file_units


@dataclass(frozen=True, eq=False, kw_only=True)
class MarkerTask(Task):
    """A task whose harm is the error of all markers, by geometry and springs.

    Args:
        question: The question of the study, whose parameters they are.
    """

    question: GeometryQuestion

    def harm(self, q: Array) -> Array:
        """Rows (..., 3k, p) whose squares, times an error, add up to the mean square of k markers.

        Args:
            q: Joint variables (..., n) [rad or m].
        """
        rows = self._rows(q)
        return np.asarray(rows[..., self.question.shares.kept])

    def is_told(self, q: Array) -> bool:
        """Whether what feasible poses leave open moves no marker in poses q (..., n)."""
        shares = self.question.shares
        rows = self._rows(q)
        apart = rows[..., shares.left] - rows[..., shares.kept] @ shares.shares
        return bool(MM * np.abs(apart).max(initial=0.0) <= UNTOLD)

    def _rows(self, q: Array) -> Array:
        """Rows (..., 3k, structural p) of the root of the mean square [m]."""
        question = self.question
        flat = q.reshape(-1, self.robot.n)
        wrench = np.tile(self.wrench, (len(flat), 1))
        rows = PositionRows(question.structural, question.setting.loads)(flat, wrench)
        rows = rows[:, question.model.placed_rows] / MM / np.sqrt(len(question.model.markers))
        return np.asarray(rows.reshape(*q.shape[:-1], *rows.shape[1:]))


def marker_tasks(question: GeometryQuestion) -> Tasks:
    """The test poses of a study of geometry; there may be none."""
    study = question.study
    return Tasks(
        MarkerTask(
            q=of_file_units(study.robot, np.array(pose.q_deg)),
            tool=study.robot.tool,
            wrench=pose.load.build(),
            robot=study.robot,
            unknown=(),
            weight=pose.weight,
            question=question,
        )
        for pose in study.specification.test_poses
    )
