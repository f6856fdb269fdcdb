"""Options of the commands that sample a posterior."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING

import click

from edtk.commands.progress_line import SHOWN_AFTER_S
from edtk.commands.shared import FilePath, Range, seed_option

if TYPE_CHECKING:
    from edtk.verbs.sampling import Sampling

Command = Callable[..., None]
_OPTIONS = (
    click.option(
        "--accuracy",
        type=Range(min=1e-4, max=0.5),
        help="Monte-Carlo error of standard deviations, relative.  [default: 0.01]",
    ),
    click.option("--most", type=click.IntRange(min=1), help="Limit on steps.  [default: 60000]"),
    click.option(
        "--chain", type=FilePath, help="Keep the chain (HDF5), and go on from a kept one."
    ),
    click.option("--export", type=FilePath, help="Write ArviZ InferenceData (NetCDF)."),
    seed_option,
)


@dataclass(frozen=True)
class SamplingOptions:
    """The options as they are given on the command line; None where one is not given."""

    accuracy: float | None
    most: int | None
    chain: Path | None
    export: Path | None
    seed: int | None

    def given(self) -> list[str]:
        """Names of the options that are given."""
        return [f"--{name}" for name, value in vars(self).items() if value is not None]

    @contextmanager
    def with_progress(self) -> "Iterator[Sampling]":
        """How to sample, with a progress bar on standard error for long runs."""
        from tqdm import tqdm

        from edtk.verbs.sampling import Sampling

        with tqdm(
            unit="step", file=sys.stderr, desc="emcee", delay=SHOWN_AFTER_S, leave=False
        ) as bar:
            yield Sampling(**vars(self), progress=lambda steps: bar.update(steps - bar.n))


def sampling_options(command: Command) -> Command:
    """Add the options to a command, which takes them as one argument `sampling`."""

    @wraps(command)
    def bundled(
        *args: object,
        accuracy: float | None,
        most: int | None,
        chain: Path | None,
        export: Path | None,
        seed: int | None,
        **others: object,
    ) -> None:
        options = SamplingOptions(accuracy, most, chain, export, seed)
        command(*args, sampling=options, **others)

    for option in reversed(_OPTIONS):
        bundled = option(bundled)
    return bundled
