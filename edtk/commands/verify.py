"""`edtk verify`: the claims of a certificate, recomputed."""

import sys
from pathlib import Path

import click

from edtk.commands.plan import MOST_EXPERIMENTS
from edtk.commands.shared import FilePath, Number, json_option, show

NOT_VALID = 1  # exit code: the file was read, and a claim does not hold


@click.command("verify", short_help="Recompute the claims of a certificate.")
@click.argument("certificate", type=FilePath, metavar="FILE")
@click.option("--study", type=FilePath, help="Study whose robot, load and limits FILE must have.")
@click.option(
    "--size",
    type=Number(MOST_EXPERIMENTS),
    help="Number of experiments that was asked for, kept ones counted; with --study.",
)
@click.option("--keep", type=FilePath, help="Plan (CSV) of experiments made before; with --study.")
@click.option("--exclude", type=FilePath, help="Plan (CSV) of poses to stay away from; likewise.")
@click.option(
    "--cost-budget", type=float, help="What a day may cost, where the study does not say; likewise."
)
@json_option
def command(
    certificate: Path,
    study: Path | None,
    size: int | None,
    keep: Path | None,
    exclude: Path | None,
    cost_budget: float | None,
    as_json: bool,
) -> None:
    """Recompute the claims of a certificate FILE (JSON) from its poses and multipliers alone.

    `edtk relax` and `edtk plan` write it with --certificate, `edtk run` into its folder. The exit
    code is 0 if every claim holds, 1 if one does not or cannot be recomputed, 2 if FILE is no
    certificate. The first line says what is proved, and on what. Without --study, robot, load,
    noise, limits, candidates, size and budget are the file's own word.
    """
    from edtk.verbs.verify import verify

    found = verify(
        certificate, study, size=size, keep=keep, exclude=exclude, cost_budget=cost_budget
    )
    show(found, as_json)
    if not found.valid:
        sys.exit(NOT_VALID)
