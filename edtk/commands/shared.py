"""Options and helpers that several commands share."""

import math
from pathlib import Path
from typing import Any, NoReturn

import click

from edtk.commands.one_line import INTERRUPTED
from edtk.system.atomic_file import STANDARD_OUTPUT, is_standard_output, write_files
from edtk.system.errors import shortened
from edtk.system.interruptible import leave
from edtk.system.json_text import json_text

PARTIAL = 1  # exit code: there is an answer, but not to everything that was asked


class NamedPath(click.Path):
    """A path that is not empty: an empty one would mean the present folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert to a path.

        Raises:
            click.BadParameter: The value is empty, or no path of this kind.
        """
        if not str(value):
            self.fail("the path is empty.", param, ctx)
        return super().convert(value, param, ctx)


FilePath = NamedPath(path_type=Path, dir_okay=False)
FolderPath = NamedPath(path_type=Path, file_okay=False)


class Range(click.FloatRange):
    """A range of numbers that rejects NaN."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert to a number in the range.

        Raises:
            click.BadParameter: The value is not in the range.
        """
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not in the range {self._describe_range()}.", param, ctx)
        return number


class Number(click.IntRange):
    """A whole number from 1 on, whose limit is written with few digits."""

    def __init__(self, most: int) -> None:
        super().__init__(min=1, max=most)

    def _describe_range(self) -> str:
        return f"1<=x<={self.max:g}"


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
seed_option = click.option(
    "--seed", type=click.IntRange(min=0), help="Seed [default: the study's]."
)
criterion_option = click.option(
    "--criterion",
    help="Criterion to optimise [default: rho0 if the study optimises it, else its first].",
)
certificate_option = click.option(
    "--certificate", type=FilePath, help="Write what proves the numbers (JSON), for edtk verify."
)
workers_option = click.option(
    "--workers",
    type=click.IntRange(min=1),
    help="Processes on this machine [default: one a core].",
)
dask_option = click.option(
    "--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster, tcp://HOST:PORT."
)


def show(result: Any, as_json: bool, *outputs: Path | None) -> None:
    """Print a result on standard output: its text, or its JSON.

    Where a file was written to standard output, the result goes to standard error: a program that
    reads the one should not meet the other.
    """
    text = json_text(result.to_dict()) if as_json else result.summary()
    if any(map(is_standard_output, outputs)):
        click.echo(text, err=True)
    else:
        print_out(text)


def print_out(text: str) -> None:
    """Print on standard output.

    Raises:
        OSError: Standard output cannot be written; the error names it.
    """
    write_files({STANDARD_OUTPUT: text if text.endswith("\n") else f"{text}\n"})


def warn(message: str) -> None:
    """Print one line on standard error, as long as an error's at most."""
    click.echo(shortened(f"edtk: {message}"), err=True)


def warn_about(where: Path, warnings: tuple[str, ...]) -> None:
    """Print one line on standard error for each finding about a file."""
    for line in warnings:
        warn(f"{where}: {line}")


def end_interrupted() -> NoReturn:
    """End with the exit code of an interrupted program."""
    leave(INTERRUPTED)


def end_partial() -> NoReturn:
    """End with the exit code of an answer that leaves something out."""
    leave(PARTIAL)
