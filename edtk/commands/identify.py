"""`edtk identify`: compliances from measurements."""

import json
from pathlib import Path

import click

from edtk.commands.sampling import Sampling, sampling_options
from edtk.commands.shared import FilePath, require_output
from edtk.system.errors import UserError


@click.command("identify")
@click.argument("study", type=FilePath)
@click.argument("measurements", type=FilePath)
@click.option(
    "--robust", is_flag=True, help="Huber's loss instead of squares: outliers count less."
)
@click.option(
    "--sigma-unknown", is_flag=True, help="Estimate the size of the noise from the residuals."
)
@click.option(
    "--plan", type=FilePath, help="The plan (CSV) that was measured, to compare poses with."
)
@click.option(
    "--bayes", is_flag=True, help="Sample the posterior too; the options that follow are for that."
)
@sampling_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write k.json, residuals.csv and report.html there.",
)
def command(
    study: Path,
    measurements: Path,
    robust: bool,
    sigma_unknown: bool,
    plan: Path | None,
    bayes: bool,
    sampling: Sampling,
    as_json: bool,
    out: Path | None,
) -> None:
    """Identify the compliances of STUDY (TOML) from MEASUREMENTS (CSV), by weighted least squares.

    Columns of MEASUREMENTS: poses and wrenches as in a plan; dx_mm dy_mm dz_mm, or positions x0_mm y0_mm z0_mm without
    and x_mm y_mm z_mm with load; drx_deg dry_deg drz_deg if rotations are measured; optionally sigma_mm, of the
    displacement (the difference of the positions), and the marker's offset from the tool point in the tool frame,
    marker_x_mm marker_y_mm marker_z_mm. `edtk template` makes such a sheet.

    With --bayes priors are those of the [prior] of STUDY, errors Student-t if --robust, sigma unknown if
    --sigma-unknown. A killed run with --chain goes on where it was when it is started again.
    """
    from edtk.calibration.calibrate import calibrate
    from edtk.calibration.diagnostics.diagnostic import Severity
    from edtk.calibration.export_inference_data import export_inference_data
    from edtk.inference.fit_huber import SigmaTooSmallError
    from edtk.report.write_calibration import WRITTEN, write_calibration
    from edtk.study.study import load_study

    if sampling.given() and not bayes:
        raise UserError(f"{sampling.given()[0]}: expected --bayes with it")
    loaded = load_study(study)
    sampling.require_writable(*loaded.reads, measurements, plan)
    if out is not None:
        for name in WRITTEN:
            require_output(
                out / name, *loaded.reads, measurements, plan, sampling.chain, sampling.export
            )
    plan_study = None if plan is None else loaded.load_plan(plan)
    try:
        found = calibrate(loaded, measurements, robust, not sigma_unknown, plan_study)
    except UserError as error:
        if isinstance(error.__cause__, SigmaTooSmallError):
            raise UserError(f"{error}, or --sigma-unknown") from error
        raise
    if bayes:
        with sampling.arguments(measurements, loaded.specification.seed) as arguments:
            found = found.sampled(**arguments)
    if found.check is not None and sampling.export is not None:
        export_inference_data(found.check, sampling.export, loaded.target)
    if out is not None:
        write_calibration(found, out)
    click.echo(json.dumps(found.to_dict(), indent=2) if as_json else found.summary())
    for diagnostic in found.diagnostics:
        if diagnostic.severity > Severity.NOTE:
            click.echo(f"edtk: {measurements}: {diagnostic.text}", err=True)
