"""`edtk.identify`: compliances from measurements, with a verdict."""

from pathlib import Path

from edtk.calibration.calibration import Calibration
from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.findings.fitted_data import HowFitted
from edtk.measure.pose_table import Table
from edtk.system.arguments import checked
from edtk.verbs.bayes import Sampling
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study


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
) -> Calibration | GeometricCalibration:
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
