"""Independent work on the cores of this machine or on a cluster, each in one thread."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from threading import Event, Thread
from time import monotonic
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from edtk.system.time_limit import time_left, time_limit

# Two processes that take two seconds each to load what they need have done nothing more by then.
STARTING_S = 4.0
GREETING_S = 5.0  # in which a scheduler has to answer
PATIENCE_S = 20.0  # with a cluster that has lost all its workers
GLANCE_S = 1.0  # between two looks at a cluster's workers
SAFE_PATH = "PYTHONSAFEPATH"  # of Python's environment
CLOSING_S = 2.0  # for a connection to close; after it the connection is left to itself


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the libraries that are loaded compute in one thread, as `threadpool_limits(1)` does.

    Libraries are looked for when modules were imported since the last time, and not each time:
    that takes as long as a short descent.
    """
    with _libraries(len(sys.modules)).limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The libraries with threads of their own, where so many modules are imported."""
    return ThreadpoolController()


T = TypeVar("T")


class WorkersLostError(RuntimeError):
    """A cluster that cannot be reached, or workers that have gone away."""


@dataclass(frozen=True)
class Workers:
    """The processes that do the work; the answers do not depend on them.

    Attributes:
        size: Number of pieces that are done at the same time.
        name: The name of the machine or cluster in messages.
        remote: Whether it is reached over a network.
    """

    size: int = 1
    name: str = "this machine"
    remote: bool = False

    def run(self, pieces: Sequence[Callable[[], T]]) -> Iterator[tuple[int, T]]:
        """Do pieces of work.

        A limit (`time_limit`) holds for each piece, also for the time that it waits for a process
        of this machine. Where too little is left, no processes are started.

        Args:
            pieces: Functions without arguments; with more than one process they are sent to others,
                so that they have to be picklable.

        Returns:
            The index of each piece and its answer, in the order in which they are done.

        Raises:
            WorkersLostError: No process is left to do the work.
        """
        if self.size == 1 or (not self.remote and time_left() < STARTING_S):
            return (_numbered(i, piece) for i, piece in enumerate(pieces))
        return self._run_in_parallel(pieces)

    def _run_in_parallel(self, pieces: Sequence[Callable[[], T]]) -> Iterator[tuple[int, T]]:
        # Imported here, as a single process needs none of them.
        import asyncio
        from concurrent.futures import BrokenExecutor, CancelledError

        import joblib

        # Processes of one machine share a clock.
        limit = (time_left(), None if self.remote else monotonic())
        work = (joblib.delayed(_numbered)(i, piece, *limit) for i, piece in enumerate(pieces))
        # More processes than pieces would be started all the same, and a million of them.
        jobs = self.size if self.remote else min(self.size, max(1, len(pieces)))
        gone = f"the workers of {self.name} have gone away"
        try:
            with _safe_path():
                yield from joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(work)
        except (CancelledError, asyncio.CancelledError, BrokenExecutor) as error:
            raise WorkersLostError(gone) from error
        except (OSError, TimeoutError) as error:
            if not self.remote:  # an error of the work itself
                raise
            raise WorkersLostError(gone) from error
        except Exception as error:
            # Dask's error, compared by name so that Dask need not be installed.
            if type(error).__name__ == "KilledWorker":
                died = f"the workers of {self.name} died again and again"
                raise WorkersLostError(died) from error
            raise


THIS_PROCESS = Workers()


@contextmanager
def _safe_path() -> Iterator[None]:
    """Let processes that are started not search the current folder, where anybody may put modules.

    They get this process's own search path as soon as they run.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(SAFE_PATH, None)
        else:
            os.environ[SAFE_PATH] = before


def _numbered(
    index: int, piece: Callable[[], T], seconds: float = inf, since: float | None = None
) -> tuple[int, T]:
    """The answer of a piece, with its index.

    Args:
        index: The index.
        piece: The piece.
        seconds: Time that is left for it [s].
        since: From when on, on the clock of `time.monotonic` [s]; defaults to now.
    """
    import scipy.linalg  # noqa: F401, only libraries that are loaded can be limited

    # The rounding of a product may depend on the number of threads, which is another one in
    # processes of a team than in a single process; and so would the answer.
    waited = 0.0 if since is None else monotonic() - since
    with one_thread(), time_limit(max(0.0, seconds - waited)):
        return index, piece()


@contextmanager
def open_workers(
    workers: int | None = None,
    dask: str | None = None,
    greeting_s: float = GREETING_S,
    patience_s: float = PATIENCE_S,
) -> Iterator[Workers]:
    """Open processes on this machine, or a connection to the workers of a Dask cluster.

    Args:
        workers: Number of processes; defaults to one a core. Of a cluster all workers are used.
        dask: Address of a scheduler, like tcp://host:8786; defaults to this machine.
        greeting_s: Time in which the scheduler has to answer [s].
        patience_s: Time after which a cluster without workers counts as lost [s].

    Raises:
        WorkersLostError: No scheduler answers at the address, or the cluster has no workers.
    """
    if dask is None:
        yield Workers(workers or os.cpu_count() or 1)
        return
    import joblib

    client = _client(dask, greeting_s)
    done = Event()
    try:
        cores = sum(client.ncores().values())
        if not cores:
            raise WorkersLostError(f"the Dask cluster at {dask} has no workers")
        Thread(target=_watch, args=(client, done, patience_s), daemon=True).start()
        with joblib.parallel_config(backend=_backend(client, patience_s)):
            yield Workers(max(2, cores), f"the Dask cluster at {dask}", remote=True)
    finally:
        done.set()
        client.close(timeout=CLOSING_S)


def _backend(client: Any, patience_s: float) -> Any:
    """Joblib's way to a cluster, which is taken even where the cluster has a single core left."""
    from joblib._dask import DaskDistributedBackend

    class Backend(DaskDistributedBackend):
        def effective_n_jobs(self, n_jobs: int) -> int:
            """At least two: for one, joblib would do the work in this process."""
            return max(2, super().effective_n_jobs(n_jobs))

    return Backend(client=client, wait_for_workers_timeout=patience_s)


def _client(address: str, greeting_s: float) -> Any:
    """A connection to a scheduler, which reports by errors and not by a log."""
    import asyncio
    import logging
    from concurrent.futures import ThreadPoolExecutor

    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise WorkersLostError(
            "a Dask cluster needs the extra edtk[cluster], which is not installed"
        ) from None
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    greeting = asyncio.wait_for(_greet(address, greeting_s), greeting_s)
    try:
        # A thread has an event loop of its own, also where one is running, as in a notebook.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, greeting).result()
        return Client(address, timeout=GREETING_S, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError, MemoryError) as error:
        raise WorkersLostError(f"no Dask scheduler answers at {address}") from error


async def _greet(address: str, greeting_s: float) -> None:
    """Ask a scheduler for its identity.

    A client would wait for ever for a silent program, and prints a log where it cannot connect.

    Raises:
        ValueError: The program that answers is not a scheduler.
    """
    from distributed.comm import connect
    from distributed.security import Security

    comm = await connect(address, timeout=greeting_s, **Security().get_connection_args("client"))
    try:
        await comm.write({"op": "identity", "reply": True})
        answer = await comm.read()
    finally:
        comm.abort()
    if not isinstance(answer, dict) or answer.get("type") != "Scheduler":
        raise ValueError(f"{address} is no scheduler")


def _watch(client: Any, done: Event, patience_s: float) -> None:
    """Cancel the work of a cluster that has had no workers for a while.

    Its scheduler would wait for new workers for ever.
    """
    alone_s = 0.0
    while not done.wait(GLANCE_S) and client.status == "running":
        try:
            alone_s = 0.0 if client.ncores() else alone_s + GLANCE_S
        except Exception:
            return  # the connection is lost, which cancels the work too
        if alone_s >= patience_s:
            client.close(timeout=CLOSING_S)
