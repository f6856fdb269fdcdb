"""`edtk.compensate`: commands that make up for the deflection under the task's load."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from edtk.calibration.compensate import Compensation
from edtk.calibration.compensate import compensate as compensate_task
from edtk.calibration.geometry.compensate_geometry import GeometricCompensation, compensate_geometry
from edtk.calibration.geometry.geometric_calibration import GeometricCalibration, read_result
from edtk.calibration.tasks_in_use import load_task
from edtk.design.plan import Plan
from edtk.measure.compliances import Compliances, load_compliances
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_study,
    as_table,
    content_of,
    files_of,
    name_of,
    plan_of,
    require_output,
)

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration

CompliancesLike = Union[
    Compliances, "Calibration", GeometricCalibration, Mapping[str, Any], Path, str
]


def compensate(
    study: StudyLike,
    compliances: CompliancesLike,
    task: PlanLike | None = None,
    *,
    out: Path | str | None = None,
) -> Compensation | GeometricCompensation:
    """Compute joint angles to command, at which the loaded robot is where the task wants it.

    Args:
        study: A study, or the path of a study file; its test pose gives the tool, and the load
            where the task names none.
        compliances: A calibration, compliances by joint like {"q2": 3e-7} [rad/(N m)], or the path
            of a k.json file.
        task: The desired poses and wrenches, as a plan or a table (CSV, or data frame); defaults to
            the test poses, each with its own tool and payload, or the path, of the study itself.
        out: File to write commands and errors to (CSV); "-" is standard output.

    Returns:
        For a study with [parameters], commands that bring the markers where the robot of the
        drawing would have them, unloaded. Otherwise commands, the error without compensation, and
        the error that remains, with a 95 % band. Rows that have no command, as it would be out of
        limits or the arm buckles, are in `.refused`; `.rows` says which the others are.

    Raises:
        UserError: A file is not valid, or no row has a command.
    """
    question = as_study(study)
    if question.specification.parameters is not None:
        return _geometry(question, compliances, task, out)
    require_output(out, *question.reads, *files_of(compliances, task))
    if isinstance(compliances, GeometricCalibration):
        raise question.error("parameters", "expected a study of geometry, as the result is of one")
    poses = plan_of(question, task, "task")
    if poses is None:
        poses = load_task(question, None if task is None else as_table(task, "task"))
    known = _compliances(question, compliances)
    where = name_of(question.where if task is None else task, "task")
    found = compensate_task(question, known, poses, where, own=task is None)
    if out is not None:
        found.to_csv(out)
    return found


def _geometry(
    study: Study,
    result: CompliancesLike,
    task: PlanLike | None,
    out: Path | str | None,
) -> GeometricCompensation:
    """The commands of a study with [parameters].

    Raises:
        UserError: There are no poses, or a file is not valid.
    """
    if task is None:
        raise ArgumentError(
            "expected poses (CSV): geometry is compensated in them", argument="task"
        )
    if not isinstance(result, GeometricCalibration | Mapping | str | Path):
        raise ArgumentError("expected a result of this study", argument="compliances")
    require_output(out, *study.reads, *files_of(result, task))
    where = name_of(result, "result")
    content = read_result(result)
    poses = plan_of(study, task, "task")
    if poses is None:
        table = as_table(task, "task")
        poses = Plan.from_csv(table, study.robot, study.fixed, np.zeros(6))
    found = compensate_geometry(study, content, where, poses, name_of(task, "task"))
    if out is not None:
        found.to_csv(out)
    return found


def _compliances(study: Study, given: object) -> Compliances:
    """Compliances of a file, of a calibration, by joint, or as they are.

    Raises:
        UserError: The file is not valid, or lacks a joint; or it is none of these.
    """
    if isinstance(given, Compliances):
        return given
    names = study.robot.joint_names
    needed = study.specification.joints.unknown
    if isinstance(given, str | Path):
        return load_compliances(given, names, needed)
    content = content_of(given)
    if content is None:
        message = (
            "expected a calibration, compliances by joint [rad/(N m)], or the path of a k.json "
            f"file, not {type(given).__name__}"
        )
        raise ArgumentError(message, argument="compliances")
    return Compliances.from_dict(content, names, needed, "compliances")
