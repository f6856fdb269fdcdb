"""`edtk verify`: the claims of a certificate, recomputed."""

import sys
from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show

NOT_VALID = 1  # exit code: the file was read, and a claim does not hold


@click.command("verify", short_help="Recompute the claims of a certificate.")
@click.argument("certificate", type=FilePath, metavar="FILE")
@click.option("--study", type=FilePath, help="Study whose robot, load and limits FILE must have.")
@json_option
def command(certificate: Path, study: Path | None, as_json: bool) -> None:
    """Recompute the claims of a certificate FILE (JSON) from its poses and multipliers alone.

    `edtk relax` and `edtk plan` write it with --certificate, `edtk run` into its folder. The exit
    code is 0 if every claim holds, 1 if one does not or cannot be recomputed, 2 if FILE is no
    certificate.
    """
    from edtk.verbs.verify import verify

    found = verify(certificate, study)
    show(found, as_json)
    if not found.valid:
        sys.exit(NOT_VALID)
