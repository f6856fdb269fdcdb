"""Options of the commands that sample a posterior."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from edtk.commands.shared import FilePath, Range, require_output
from edtk.system.errors import UserError

Command = Callable[..., None]
_OPTIONS = (
    click.option(
        "--accuracy",
        type=Range(min=1e-4, max=0.5),
        help="Monte-Carlo error of standard deviations, relative.  [default: 0.01]",
    ),
    click.option("--most", type=click.IntRange(min=1), help="Limit on steps.  [default: 60000]"),
    click.option(
        "--chain", type=FilePath, help="Keep the chain (HDF5), and go on with what is there."
    ),
    click.option("--export", type=FilePath, help="Write ArviZ InferenceData (NetCDF)."),
    click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's]."),
)


@dataclass(frozen=True)
class Sampling:
    """What the options say; None where one is not given."""

    accuracy: float | None
    most: int | None
    chain: Path | None
    export: Path | None
    seed: int | None

    def given(self) -> list[str]:
        """Names of the options that are given."""
        return [f"--{name}" for name, value in vars(self).items() if value is not None]

    def require_writable(self, *inputs: Path | None) -> None:
        """Check, before long work, that the files can be written, are none of the inputs, and ArviZ is there.

        Raises:
            UserError: They are one, or it is not.
            OSError: They cannot be written.
        """
        from edtk.calibration.export_inference_data import require_arviz

        if self.export is not None:
            require_arviz(self.export)
        for path in (self.chain, self.export):
            require_output(path, *inputs)
        require_output(self.export, self.chain)

    @contextmanager
    def arguments(self, source: Path, seed: int) -> Iterator[dict[str, Any]]:
        """Arguments of a posterior check, with a progress bar; what can go wrong becomes one line.

        Args:
            source: The file that a message is about.
            seed: Where no option gives one.
        """
        import numpy as np

        from edtk.inference.chain_file import ChainFileError
        from edtk.inference.least_squares import SingularPlanError
        from edtk.inference.run_chain import Demand, UnconvergedError
        from edtk.inference.sample_posterior import ImproperPosteriorError, SamplingOptions

        default = Demand()
        demand = Demand(
            self.accuracy or default.accuracy, default.length, self.most or default.most
        )
        rng = np.random.default_rng(seed if self.seed is None else self.seed)
        with tqdm(unit="step", file=sys.stderr, desc="emcee", delay=1.0, leave=False) as bar:

            def progress(steps: int) -> None:
                bar.update(steps - bar.n)

            try:
                yield {"rng": rng, "options": SamplingOptions(demand, self.chain, progress)}
            except UnconvergedError as error:
                raise UserError(
                    f"{source}: {error} with --most, or expect less with --accuracy"
                ) from error
            except (SingularPlanError, ImproperPosteriorError) as error:
                raise UserError(f"{source}: {error}") from error
            except ChainFileError as error:
                raise UserError(str(error)) from error


def sampling_options(command: Command) -> Command:
    """Add the options to a command, which takes them as the argument `sampling`."""

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
        command(*args, sampling=Sampling(accuracy, most, chain, export, seed), **others)

    for option in reversed(_OPTIONS):
        bundled = option(bundled)
    return bundled
