"""What several commands have in common."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from edtk.errors import UserError

if TYPE_CHECKING:
    from edtk.parallel import Team

FilePath = click.Path(path_type=Path, dir_okay=False)


@contextmanager
def mistakes_in(where: Path) -> Iterator[None]:
    """Name the file in mistakes that only show in the arithmetic, or in the file system."""
    from edtk.inference import SingularPlanError

    try:
        yield
    except SingularPlanError as error:
        raise UserError(f"{where}: {error}") from error
    except OSError as error:
        raise UserError(f"{error.filename or where}: {error.strerror or error}") from error


workers_option = click.option(
    "--workers", type=click.IntRange(min=1), help="Processes on this machine [default: one a core]."
)
dask_option = click.option("--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster, tcp://HOST:PORT.")


@contextmanager
def team_of(workers: int | None, dask: str | None) -> Iterator["Team"]:
    """Who does the work; a cluster that is not there is the user's mistake."""
    from edtk.parallel import WorkersLostError, team

    try:
        with team(workers, dask) as found:
            yield found
    except WorkersLostError as error:
        raise UserError(f"--dask: {error}") from error
