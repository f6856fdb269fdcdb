"""What several commands have in common."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from edtk.system.atomic_file import require_writable
from edtk.system.errors import UserError

if TYPE_CHECKING:
    from edtk.system.workers import Workers

FilePath = click.Path(path_type=Path, dir_okay=False)


class Range(click.FloatRange):
    """A range that holds no NaN."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not in the range {self._describe_range()}.", param, ctx)
        return number


def require_output(path: Path | None, *inputs: Path | None) -> None:
    """Check, before long work, that a file can be written, and is neither read by the command nor a filled sheet.

    Raises:
        UserError: It is one of them, or has measurements in it.
        OSError: It cannot be written.
    """
    if path is None:
        return
    if any(other is not None and path.resolve() == other.resolve() for other in inputs):
        raise UserError(f"{path}: is read by this command; expected another file to write")
    require_writable(path)
    if path.exists():
        from edtk.calibration.is_filled import is_filled

        if is_filled(path):
            raise UserError(f"{path}: has measurements in it; expected another file to write")


@contextmanager
def mistakes_in(where: Path) -> Iterator[None]:
    """Name the file in mistakes that only show in the arithmetic, or in the file system."""
    from edtk.inference.least_squares import SingularPlanError

    try:
        yield
    except SingularPlanError as error:
        raise UserError(f"{where}: {error}") from error
    except OSError as error:
        raise UserError(f"{error.filename or where}: {error.strerror or error}") from error


workers_option = click.option(
    "--workers", type=click.IntRange(min=1), help="Processes on this machine [default: one a core]."
)
dask_option = click.option(
    "--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster, tcp://HOST:PORT."
)


@contextmanager
def team_of(workers: int | None, dask: str | None) -> Iterator["Workers"]:
    """Who does the work; a cluster that is not there is the user's mistake."""
    from edtk.system.workers import WorkersLostError, open_workers

    try:
        with open_workers(workers, dask) as found:
            yield found
    except WorkersLostError as error:
        raise UserError(f"--dask: {error}") from error
