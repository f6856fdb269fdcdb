"""`edtk bayes`: the sampled posterior of a plan beside Eq. (13)."""

import math
from pathlib import Path
from typing import Any

import click

from edtk.commands.shared import (
    FilePath,
    FolderPath,
    SamplingOptions,
    json_option,
    sampling_options,
    show,
)


class _Number(click.ParamType[Any]):
    """A positive number, possibly inf, or one of some words."""

    def __init__(self, *words: str, least: float = 0.0) -> None:
        self.words = words
        self.least = least
        self.name = "|".join(("number", *words))

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> object:
        """Convert to one of the words, or to a number.

        Raises:
            click.BadParameter: The value is neither.
        """
        if value in self.words:
            return value
        try:
            number = float(str(value))
        except ValueError:
            number = math.nan
        if not (number > 0 and number >= self.least):
            least = f"of at least {self.least:g}" if self.least else "above zero"
            words = "".join(f" or {word!r}" for word in self.words)
            self.fail(f"expected a number {least}{words}, got {value!r}", param, ctx)
        return number


@click.command("bayes", short_help="Sample the posterior that a plan leads to.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option(
    "--sigma-factor",
    type=_Number(least=1.0),
    help="Sigma is known to that factor: 1, or inf for not at all.",
)
@click.option(
    "--nu",
    type=_Number("normal", "sampled"),
    metavar="NUMBER|normal|sampled",
    help="Student-t errors with so many degrees of freedom.",
)
@sampling_options
@click.option("--figures", type=FolderPath, help="Folder for pictures (PNG).")
@json_option
def command(
    study: Path,
    plan: Path,
    sigma_factor: float | None,
    nu: float | str | None,
    sampling: SamplingOptions,
    figures: Path | None,
    as_json: bool,
) -> None:
    """Simulate measurements of PLAN, sample their posterior, compare it with the promise.

    The [prior] of STUDY (TOML) says what is known before the measurements. A killed run with
    --chain goes on where it was when it is started again.
    """
    from edtk.verbs.bayes import bayes

    with sampling.with_progress() as options:
        found = bayes(
            study, plan, sigma_factor=sigma_factor, nu=nu, sampling=options, figures=figures
        )
    show(found, as_json, sampling.export)
