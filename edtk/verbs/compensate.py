"""`edtk.compensate`: commands that make up for the deflection under the task's load."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.compensate import compensate as compensate_task
from edtk.calibration.compensation import Compensation
from edtk.calibration.load_task import load_task
from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.tables.compliances import Compliances, load_compliances
from edtk.verbs.inputs import PlanLike, StudyLike, as_study, name_of
from edtk.verbs.require_output import require_output

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration


def compensate(
    study: StudyLike,
    compliances: "Compliances | Calibration | Path | str",
    task: PlanLike | None = None,
    *,
    out: Path | str | None = None,
) -> Compensation:
    """Compute joint angles to command, at which the loaded robot is where the task wants it.

    Args:
        study: A study, or the path of a study file; its test pose gives the tool, and the load
            where the task names none.
        compliances: A calibration, or the path of a k.json file.
        task: The desired poses and wrenches, or the path of their CSV file; defaults to the test
            poses, each with its own tool and payload, or the path, of the study itself.
        out: File to write commands and errors to (CSV); "-" is standard output.

    Returns:
        Commands, the error without compensation, and the error that remains, with a 95 % band.

    Raises:
        UserError: A file is not valid, or a pose is out of the joints' limits or buckles.
    """
    question = as_study(study)
    read = [given for given in (compliances, task) if isinstance(given, str | Path)]
    require_output(out, *question.reads, *read)
    poses = task if isinstance(task, Plan) else load_task(question, task)
    known = _compliances(question, compliances)
    where = name_of(question.where if task is None else task, "task")
    found = compensate_task(question, known, poses, where, own=task is None)
    if out is not None:
        found.to_csv(out)
    return found


def _compliances(study: Study, given: "Compliances | Calibration | Path | str") -> Compliances:
    """Compliances of a file, of a calibration, or as they are.

    Raises:
        UserError: The file is not valid, or lacks a joint.
    """
    if isinstance(given, Compliances):
        return given
    names = study.robot.joint_names
    needed = study.specification.joints.unknown
    if isinstance(given, str | Path):
        return load_compliances(given, names, needed)
    return Compliances.from_dict(given.to_dict(), names, needed)
