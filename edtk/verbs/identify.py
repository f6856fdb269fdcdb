"""From measurements to parameters, and what these are for: predictions and commands.

`edtk.identify`, `edtk.predict` and `edtk.compensate`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edtk.calibration.calibration import Calibration
from edtk.calibration.compensate import Compensation
from edtk.calibration.prediction import Prediction
from edtk.findings.fitted_data import HowFitted
from edtk.measure.pose_table import Table
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, whole_number
from edtk.verbs.bayes import Sampling
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study
from edtk.verbs.of_studies import CompliancesLike

if TYPE_CHECKING:
    from edtk.calibration.correct_program import CorrectedProgram


@checked
def identify(
    study: StudyLike,
    measurements: Table,
    *,
    robust: bool = False,
    sigma_unknown: bool = False,
    plan: PlanLike | None = None,
    as_is: bool = False,
    linear: bool = False,
    extend: bool = False,
    bayes: Sampling | bool = False,
    out: Path | str | None = None,
) -> Calibration:
    """Identify the unknown compliances of a study by weighted least squares, and judge the result.

    Args:
        study: A study, or the path of a study file.
        measurements: The filled-in sheet (CSV, or a data frame); `edtk.template` makes an empty
            one. Rows that are not filled in yet are left out, with a note.
        robust: Whether Huber's loss takes the place of squares, so that outliers count less.
        sigma_unknown: Whether the size of the noise is estimated from the residuals; of positions,
            where repeated poses do not tell it.
        plan: The plan that was measured, or its CSV file, to compare the poses with.
        as_is: Whether the sheet is taken as it is, where columns look misread or rows copied: the
            result then comes with an alarm, instead of none.
        linear: Whether the linear model is fitted in any case. Otherwise the loaded equilibrium is,
            where that moves a compliance by more than a tenth of its standard deviation.
        extend: Whether the richest model is fitted that the sheet supports: ideal springs with
            springs across joints, laws of springs, and compensators; `.extension` of the result
            has all models with their weights. Compensators are looked for by displacements alone.
        bayes: Whether the posterior is sampled too; a `Sampling` says how.
        out: Folder for `k.json`, `residuals.csv`, `report.html` and `poses.html`.

    Returns:
        For a study with [parameters], its geometry, base, tools and springs. Otherwise
        compliances `.k` and standard deviations `.std` by joint [rad/(N m)], the fit, and its
        findings.

    Raises:
        UserError: A file is not valid, or the measurements cannot be used; one line says why.
    """
    question = of_study(study)
    sampling = bayes if isinstance(bayes, Sampling) else Sampling()
    question.require(
        "identify", sigma_unknown=sigma_unknown, plan=plan, linear=linear, extend=extend
    )
    how = HowFitted(
        robust=robust, sigma_unknown=sigma_unknown, linear=linear, as_is=as_is, extended=extend
    )
    return question.identify(measurements, how, plan, sampling if bayes else None, out)


@checked
def predict(
    study: StudyLike,
    result: Calibration | Mapping[str, Any] | Path | str,
    poses: PlanLike,
    *,
    tool_rows: int = 0,
    out: Path | str | None = None,
) -> Prediction:
    """Predict readings in other poses, with bands; where they were measured, compare.

    Args:
        study: The study of the calibration, or the path of its file. Of one with [parameters]
            positions of markers are predicted, of another one displacements under load.
        result: A calibration of it, its `to_dict`, or the path of its JSON file.
        poses: A plan, or the poses (CSV, or a data frame) with their loads, and with readings as in
            a sheet where they were measured: these are tests.
        tool_rows: Of positions, so many rows at the beginning tell where each marker sits on the
            tool, where that is not where it sat before; they are no tests.
        out: File to write the predictions to (CSV); "-" is standard output.

    Returns:
        Readings with bands, errors where they were measured, and the share inside the bands.

    Raises:
        UserError: A file is not valid, or of another study; one line says why.
    """
    question = of_study(study)
    tool_rows = whole_number(tool_rows, "tool_rows", 0)
    question.require("predict", tool_rows=tool_rows or None)
    return question.predict(result, poses, tool_rows, out)


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
    if isinstance(task, str | Path):
        from edtk.calibration.correct_program import brand_of  # knows all brands of programs

        if brand_of(Path(task).name) is not None:
            return asked.correct(compliances, task, out, table, all_literals)
    for argument, given in (("table", table is not None), ("all_literals", all_literals)):
        if given:
            raise ArgumentError("is for robot programs; the task is none", argument=argument)
    return asked.compensate(compliances, task, out)
