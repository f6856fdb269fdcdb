"""`python -m paper_figures [NAME ...] [--out DIR]`."""

from pathlib import Path

import click

from edtk.commands.shared import OneLine
from paper_figures import figure_7, table_5, table_6
from paper_figures.example import load_example

WRITERS = {"table_5": table_5.write, "table_6": table_6.write, "figure_7": figure_7.write}


class _Command(OneLine):
    """A command that answers a user's mistake with one line."""

    program = "paper_figures"


@click.command(cls=_Command, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", nargs=-1)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/paper_figures"),
    show_default=True,
    help="Folder to write to.",
)
def main(names: tuple[str, ...], out: Path) -> None:
    """Recompute table_5, table_6 and figure_7 (default: all), and set them beside print."""
    for name in names:
        if name not in WRITERS:
            raise click.UsageError(f"unknown name {name!r}; choose from {', '.join(WRITERS)}")
    study = load_example()
    for name in names or tuple(WRITERS):
        for path in WRITERS[name](study, out):
            click.echo(f"wrote {path}", err=True)


if __name__ == "__main__":
    main(prog_name="python -m paper_figures")
