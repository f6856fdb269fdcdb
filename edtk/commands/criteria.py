"""`edtk criteria`: the criteria that can be used."""

import click

from edtk.commands.shared import json_option, print_out, warn
from edtk.system.parsing import json_text


@click.command("criteria", short_help="List the criteria.")
@json_option
def command(as_json: bool) -> None:
    """List the criteria, built in or from plug-ins."""
    import criteria
    from edtk.report.views.evaluation import criteria_table, families_table

    loaded = criteria.load_all()
    rows = [criterion.describe() for criterion in loaded.classes.values()]
    families = [
        {**criteria.get(name).describe(), "parameters": list(criteria.parameters_of(name))}
        for name in criteria.families()
    ]
    table = f"{criteria_table(rows)}\n\n{families_table(families)}"
    print_out(json_text([*rows, *families]) if as_json else table)
    for problem in loaded.problems.values():
        warn(f"left out: {problem}")
