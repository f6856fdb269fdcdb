"""`edtk criteria`: the criteria that are there."""

import json

import click

import criteria


@click.command("criteria")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool) -> None:
    """List the criteria that are there, built in or from plug-ins."""
    rows = [criteria.get(name).describe() for name in criteria.available()]
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return
    click.echo(f"{'name':6}{'sense':6}{'convex':8}{'title':32}formula")
    for r in rows:
        convex = "yes" if r["convex"] else "no"
        click.echo(f"{r['name']:6}{r['sense']:6}{convex:8}{r['title']:32}{r['formula']}")
