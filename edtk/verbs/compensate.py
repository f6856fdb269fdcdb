"""`edtk.compensate`: commands, or a robot program, that make up for the task's load."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.compensate import Compensation
from edtk.programs.targets.brand import brand_of
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study
from edtk.verbs.of_studies import CompliancesLike

if TYPE_CHECKING:
    from edtk.calibration.correct_program import CorrectedProgram


@checked
def compensate(
    study: StudyLike,
    compliances: CompliancesLike,
    task: PlanLike | None = None,
    *,
    out: Path | str | None = None,
    table: Path | str | None = None,
    all_literals: bool = False,
) -> "Compensation | CorrectedProgram":
    """Compute joint angles to command, at which the loaded robot is where the task wants it.

    Args:
        study: A study, or the path of a study file; its test pose gives the tool, and the load
            where the task names none.
        compliances: A calibration, compliances by joint like {"q2": 3e-7} [rad/(N m)], or the path
            of a k.json file.
        task: The desired poses and wrenches, as a plan or a table (CSV, or data frame); defaults to
            the test poses, each with its own tool and payload, or the path, of the study itself. Or
            the path of a robot program (.src, .dat, .mod, .prg, .script, .urscript, .ls), whose
            targets are corrected.
        out: File to write commands and errors to (CSV), or the corrected program; "-" is standard
            output.
        table: File to write what moved by how much to (CSV); of a program alone.
        all_literals: Whether to correct targets of a program in conditionals and loops, too, and
            those that something is computed with.

    Returns:
        For a study with [parameters], commands that bring the tool of the test poses, or without
        one the markers, where the robot of the drawing would have them, unloaded. Otherwise
        commands, the error without compensation, and the error that remains, with a 95 % band. Rows
        that have no command, as it would be out of limits or the arm buckles, are in `.refused`;
        `.rows` says which the others are. Of a program the corrected text, and what moved by how
        much; lines that are left as they are, are in `.left`.

    Raises:
        UserError: A file is not valid, or no row has a command.
    """
    asked = of_study(study)
    if isinstance(task, str | Path) and brand_of(Path(task).name) is not None:
        return asked.correct(compliances, task, out, table, all_literals)
    for argument, given in (("table", table is not None), ("all_literals", all_literals)):
        if given:
            raise ArgumentError("is for robot programs; the task is none", argument=argument)
    return asked.compensate(compliances, task, out)
