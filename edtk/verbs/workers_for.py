"""Who does the work of a verb: processes on this machine, or a cluster."""

from collections.abc import Iterator
from contextlib import contextmanager

from edtk.system.errors import ArgumentError
from edtk.system.workers import Workers, WorkersLostError, open_workers


@contextmanager
def workers_for(workers: int | None, dask: str | None) -> Iterator[Workers]:
    """Workers that are open as long as the block runs.

    Args:
        workers: Processes on this machine; None for one a core.
        dask: Address of a Dask scheduler; None for this machine.

    Raises:
        ArgumentError: Both are given, no scheduler answers there, or its workers are lost.
    """
    if workers is not None and dask is not None:
        message = "a cluster's own workers do the work; expected one of both options"
        raise ArgumentError(message, argument="workers", given=workers)
    try:
        with open_workers(workers, dask) as found:
            yield found
    except WorkersLostError as error:
        raise ArgumentError(str(error), argument="dask") from error
