"""`edtk.compensate`: commands that make up for the deflection under the task's load."""

from pathlib import Path

from edtk.calibration.compensate import Compensation
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study
from edtk.verbs.of_studies import CompliancesLike


def compensate(
    study: StudyLike,
    compliances: CompliancesLike,
    task: PlanLike | None = None,
    *,
    out: Path | str | None = None,
) -> Compensation:
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
        For a study with [parameters], commands that bring the tool of the test poses, or without
        one the markers, where the robot of the drawing would have them, unloaded. Otherwise
        commands, the error without compensation, and the error that remains, with a 95 % band. Rows
        that have no command, as it would be out of limits or the arm buckles, are in `.refused`;
        `.rows` says which the others are.

    Raises:
        UserError: A file is not valid, or no row has a command.
    """
    return of_study(study).compensate(compliances, task, out)
