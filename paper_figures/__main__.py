"""`python -m paper_figures [NAME ...] [--out DIR]`."""

import sys
from pathlib import Path
from typing import Any

import click

from edtk.errors import UserError
from paper_figures import figure_7, table_5, table_6
from paper_figures.example import load_example

WRITERS = {"table_5": table_5.write, "table_6": table_6.write, "figure_7": figure_7.write}


class _OneLine(click.Command):
    """A command whose mistakes are one line on standard error, with exit code 2."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run; never a traceback for a user's mistake."""
        kwargs["standalone_mode"] = False
        try:
            sys.exit(super().main(*args, **kwargs) or 0)
        except click.ClickException as error:
            message = error.format_message()
        except UserError as error:
            message = str(error)
        except OSError as error:
            message = f"{error.filename}: {error.strerror}"
        click.echo(f"paper_figures: {' '.join(message.split())}", err=True)
        sys.exit(2)


@click.command(cls=_OneLine, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", nargs=-1)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/paper_figures"),
    show_default=True,
    help="Folder to write to.",
)
def main(names: tuple[str, ...], out: Path) -> None:
    """Recompute table_5, table_6 and figure_7 (default: all) and set them beside print."""
    for name in names:
        if name not in WRITERS:
            raise click.UsageError(f"unknown name {name!r}; choose from {', '.join(WRITERS)}")
    study = load_example()
    for name in names or tuple(WRITERS):
        for path in WRITERS[name](study, out):
            click.echo(f"wrote {path}", err=True)


if __name__ == "__main__":
    main(prog_name="python -m paper_figures")
