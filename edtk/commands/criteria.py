"""`edtk criteria`: the criteria that are there."""

import json

import click

import criteria
from edtk.report.text.criteria_table import criteria_table


@click.command("criteria")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool) -> None:
    """List the criteria that are there, built in or from plug-ins."""
    rows = [criteria.get(name).describe() for name in criteria.available()]
    click.echo(json.dumps(rows, indent=2) if as_json else criteria_table(rows))
