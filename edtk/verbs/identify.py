"""`edtk.identify`: compliances from measurements, with a verdict."""

from pathlib import Path

from edtk.calibration.calibrate import calibrate
from edtk.calibration.calibration import Calibration
from edtk.calibration.geometry.calibrate_geometry import calibrate_geometry
from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.calibration.posterior_check import inference_data
from edtk.measure.pose_table import Table, path_of
from edtk.report.calibration_report import NAMES, calibration_files
from edtk.report.geometry_report import geometry_files
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.files import Content, write_files
from edtk.verbs.bayes import Sampling
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_plan,
    as_study,
    as_table,
    files_of,
    require_folder,
    require_output,
)


def identify(
    study: StudyLike,
    measurements: Table,
    *,
    robust: bool = False,
    sigma_unknown: bool = False,
    plan: PlanLike | None = None,
    as_is: bool = False,
    linear: bool = False,
    bayes: Sampling | bool = False,
    out: Path | str | None = None,
) -> Calibration | GeometricCalibration:
    """Identify the unknown compliances of a study by weighted least squares, and judge the result.

    Args:
        study: A study, or the path of a study file.
        measurements: The filled-in sheet (CSV, or a data frame); `edtk.template` makes an empty
            one. Rows that are not filled in yet are left out, with a note.
        robust: Whether Huber's loss takes the place of squares, so that outliers count less.
        sigma_unknown: Whether the size of the noise is estimated from the residuals.
        plan: The plan that was measured, or its CSV file, to compare the poses with.
        as_is: Whether the sheet is taken as it is, where columns look misread or rows copied: the
            result then comes with an alarm, instead of none.
        linear: Whether the linear model is fitted in any case. Otherwise the loaded equilibrium is,
            where that moves a compliance by more than a tenth of its standard deviation.
        bayes: Whether the posterior is sampled too; a `Sampling` says how.
        out: Folder for `k.json`, `residuals.csv` and `report.html`.

    Returns:
        For a study with [parameters], its geometry, base, tools and springs. Otherwise
        compliances `.k` and standard deviations `.std` by joint [rad/(N m)], the fit, and its
        findings.

    Raises:
        UserError: A file is not valid, or the measurements cannot be used; one line says why.
    """
    question = as_study(study)
    measurements = as_table(measurements, "measurements")
    sampling = bayes if isinstance(bayes, Sampling) else Sampling()
    if question.specification.parameters is not None:
        return _geometry(
            question,
            measurements,
            (robust, as_is),
            out,
            sampling if bayes else None,
            (sigma_unknown, plan, linear),
        )
    inputs = (*question.reads, *files_of(measurements, plan))
    sampling.require_writable(*inputs)
    require_folder(out)
    for name in NAMES if out is not None else ():
        require_output(Path(out or "") / name, *inputs, sampling.chain, sampling.export)
    planned = None if plan is None else as_plan(question, plan)
    found = calibrate(
        question,
        measurements,
        robust,
        not sigma_unknown,
        planned,
        as_is,
        linear,
        bayes=bool(bayes),
    )
    if bayes:
        with sampling.arguments(path_of(measurements), question.specification.seed) as arguments:
            found = found.sampled(**arguments)
    files: dict[Path, Content] = {}
    if found.check is not None and sampling.export is not None:
        files[Path(sampling.export)] = inference_data(found.check, question.tasks)
    if out is not None:
        files |= calibration_files(found, Path(out))
    write_files(files)
    return found


def _geometry(
    study: Study,
    measurements: Table,
    how: tuple[bool, bool],
    out: Path | str | None,
    sampling: Sampling | None,
    others: tuple[object, ...],
) -> GeometricCalibration:
    """Identify geometry, base, tools and springs of a study with [parameters].

    Args:
        study: The study.
        measurements: The sheet of positions.
        how: Whether poses that fit badly count less, and whether the sheet is taken as it is.
        out: Folder for `k.json`, `residuals.csv` and `report.html`.
        sampling: How the posterior is sampled; None where it is not asked for.
        others: What was asked for and is not known here: sigma_unknown, plan, linear.

    Raises:
        ArgumentError: Something of that was asked for.
        UserError: A file is not valid, or the positions cannot be used.
    """
    for name, given in zip(("sigma_unknown", "plan", "linear"), others, strict=True):
        if given is not None and given is not False:
            raise ArgumentError(
                "expected a study without [parameters]; geometry is fitted by least squares, with "
                "the size of its errors estimated",
                argument=name,
            )
    for name in ("chain", "export") if sampling is not None else ():
        if getattr(sampling, name) is not None:
            raise ArgumentError(
                "expected a study without [parameters]; the posterior of geometry is not kept",
                argument=name,
            )
    require_folder(out)
    for name in NAMES if out is not None else ():
        require_output(Path(out or "") / name, *study.reads, *files_of(measurements))
    found = calibrate_geometry(study, measurements, *how)
    if sampling is not None:
        with sampling.arguments(path_of(measurements), study.specification.seed) as arguments:
            found = found.sampled(**arguments)
    if out is not None:
        write_files(geometry_files(found, Path(out)))
    return found
