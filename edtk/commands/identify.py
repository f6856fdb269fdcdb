"""`edtk identify`: compliances from measurements."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from edtk.commands.shared import (
    FilePath,
    FolderPath,
    SamplingOptions,
    json_option,
    print_out,
    sampling_options,
    show,
    warn,
    warn_about,
    warn_in_full,
)
from edtk.system.errors import UserError
from edtk.system.parsing import json_text

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration
    from edtk.findings.finding import Finding

# Characters of a message and its hint, which leaves some of a line for the name of the file.
MOST_WITH_HINT = 220


@click.command("identify", short_help="Find compliances, or geometry, from measurements.")
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
    "--as-is", is_flag=True, help="Take the sheet as it is, even if columns look misread."
)
@click.option(
    "--linear", is_flag=True, help="Fit the linear model, even where the robot bends too much."
)
@click.option("--extend", is_flag=True, help="Fit the richest model that the sheet supports.")
@click.option(
    "--bayes", is_flag=True, help="Sample the posterior too; --accuracy to --seed are for that."
)
@sampling_options
@json_option
@click.option(
    "--out", type=FolderPath, help="Write k.json, residuals.csv, report.html and poses.html."
)
def command(
    study: Path,
    measurements: Path,
    robust: bool,
    sigma_unknown: bool,
    plan: Path | None,
    as_is: bool,
    linear: bool,
    extend: bool,
    bayes: bool,
    sampling: SamplingOptions,
    as_json: bool,
    out: Path | None,
) -> None:
    """Identify the compliances of STUDY (TOML) from MEASUREMENTS (CSV), by weighted least squares.

    Columns of MEASUREMENTS: poses and wrenches as in a plan; dx_mm dy_mm dz_mm, or positions x0_mm
    y0_mm z0_mm without and x_mm y_mm z_mm with load; drx_deg dry_deg drz_deg if rotations are
    measured; optionally sigma_mm, of the displacement (the difference of the positions), or
    sigma_x_mm sigma_y_mm sigma_z_mm, or its covariance in the world frame, cov_xx_mm2 cov_xy_mm2
    cov_xz_mm2 cov_yy_mm2 cov_yz_mm2 cov_zz_mm2; and the marker's offset from the tool point in
    the tool frame, marker_x_mm marker_y_mm marker_z_mm. A study with several
    markers or distances has their names in the column marker; a distance has
    change_mm, or before_mm after_mm.
    `edtk template` makes such a sheet.

    A study with [parameters] takes absolute positions x_mm y_mm z_mm without a load, a row a
    marker or, as NAMEx_mm and so on, a row a pose, and tells geometry, base, tools and springs.

    With --bayes its posterior is sampled where it has 12 parameters at most, or with --chain; else
    it is Laplace's approximation with a check. In other studies priors are those of the [prior] of
    STUDY, errors Student-t if --robust, sigma unknown if --sigma-unknown. A killed run with --chain
    goes on where it was when it is started again.
    """
    from edtk.calibration.calibrate import InputError, misread_sheet
    from edtk.verbs.identify import identify

    if sampling.given() and not bayes:
        raise UserError(f"{sampling.given()[0]}: expected --bayes with it")
    try:
        with (
            _prior_hint(bayes),
            sampling.with_progress() if bayes else nullcontext(False) as posterior,
        ):
            found = identify(
                study,
                measurements,
                robust=robust,
                sigma_unknown=sigma_unknown,
                plan=plan,
                as_is=as_is,
                linear=linear,
                extend=extend,
                bayes=posterior,
                out=out,
            )
    except InputError as error:
        # Files of results are not written for such a sheet; the refusal says why.
        said = misread_sheet(error.calibration) if as_json and out is None else None
        if said is None:
            raise
        print_out(json_text(said))
        warn(str(error))
        return
    show(found, as_json, sampling.export)
    warn_about(study, found.study.warnings)
    for text in _harmful(found, robust):
        warn_in_full(text, measurements)


def _harmful(found: "Calibration", robust: bool) -> Iterator[str]:
    """What is worse than a note, each with the options that help."""
    from edtk.findings.finding import Severity

    for one in found.findings:
        if one.severity > Severity.NOTE:
            yield f"{one.words}{_hint(one, robust)}"


@contextmanager
def _prior_hint(bayes: bool) -> Iterator[None]:
    """Say that prior knowledge helps where measurements alone do not tell every compliance."""
    from edtk.fit.least_squares import SingularPlanError

    try:
        yield
    except UserError as error:
        cause = error.__cause__
        if not isinstance(cause, SingularPlanError):
            raise
        how = "a [prior] of them" if bayes else "a [prior] of them and --bayes"
        hint = f"{how} would tell them"
        message = f"{cause}; {hint}"
        if len(message) > MOST_WITH_HINT:
            # One direction of several is enough, beside what helps.
            message = f"{SingularPlanError(cause.parameters, cause.directions[:1])}; {hint}"
        raise UserError(message, where=error.where) from cause


def _hint(finding: "Finding", robust: bool) -> str:
    """The options that help against a finding, where there are any."""
    if finding.kind == "outliers":
        return "" if robust else " (--robust trusts such rows less)"
    if finding.kind != "noise_above_sigma":
        return ""
    if finding.data["caused"]:
        return ""  # options would hide the fault that is named
    # Residuals far beyond sigma are no matter of its size: estimating it would hide the fault.
    options = ["--robust"] * (not robust)
    if not finding.data["unexplained"]:
        options.insert(0, "--sigma-unknown")
    return f"; see {' and '.join(options)}" if options else ""
