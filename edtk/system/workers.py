"""Independent pieces of work on the cores of this machine, or on a Dask cluster, through joblib."""

import asyncio
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event, Thread
from typing import Any, TypeVar

import joblib

T = TypeVar("T")
GREETING_S = 5.0  # for a scheduler to answer
PATIENCE_S = 20.0  # with a cluster that has lost all its workers


class WorkersLostError(RuntimeError):
    """A cluster that is not there, or workers that have gone away."""


@dataclass(frozen=True)
class Workers:
    """Who does the work; the answers do not depend on it.

    Attributes:
        size: Number of pieces that are done at the same time.
        name: What a person calls it.
        remote: Whether it is reached over a network.
    """

    size: int = 1
    name: str = "this machine"
    remote: bool = False

    def run(self, pieces: Sequence[Callable[[], T]]) -> Iterator[tuple[int, T]]:
        """The index of each piece and its answer, in the order in which they are done.

        Raises:
            WorkersLostError: Nobody is left to do the work.
        """
        if self.size == 1:
            yield from ((i, piece()) for i, piece in enumerate(pieces))
            return
        work = (joblib.delayed(_numbered)(i, piece) for i, piece in enumerate(pieces))
        try:
            yield from joblib.Parallel(n_jobs=self.size, return_as="generator_unordered")(work)
        except (CancelledError, asyncio.CancelledError, BrokenExecutor) as error:
            raise WorkersLostError(f"the workers of {self.name} have gone away") from error
        except (OSError, TimeoutError) as error:
            if not self.remote:  # a mistake in the work itself
                raise
            raise WorkersLostError(f"the workers of {self.name} have gone away") from error
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                raise WorkersLostError(
                    f"the workers of {self.name} died again and again"
                ) from error
            raise


def _numbered(index: int, piece: Callable[[], T]) -> tuple[int, T]:
    return index, piece()


@contextmanager
def open_workers(workers: int | None = None, dask: str | None = None) -> Iterator[Workers]:
    """A team of processes on this machine, or of the workers of a Dask cluster.

    Args:
        workers: Number of processes; None for one a core. Of a cluster all workers are used.
        dask: Address of a scheduler, like tcp://host:8786; None for this machine.

    Raises:
        WorkersLostError: Nobody answers there, or the cluster has no workers.
    """
    if dask is None:
        yield Workers(workers or os.cpu_count() or 1)
        return
    client = _client(dask)
    done = Event()
    try:
        cores = sum(client.ncores().values())
        if not cores:
            raise WorkersLostError(f"the Dask cluster at {dask} has no workers")
        Thread(target=_watch, args=(client, done), daemon=True).start()
        with joblib.parallel_config(backend=_backend(client)):
            yield Workers(max(2, cores), f"the Dask cluster at {dask}", remote=True)
    finally:
        done.set()
        client.close(timeout=2)


def _backend(client: Any) -> Any:
    """Joblib's way to a cluster, which is taken even where a single core is left of it."""
    from joblib._dask import DaskDistributedBackend

    class Backend(DaskDistributedBackend):
        def effective_n_jobs(self, n_jobs: int) -> int:
            """At least two: for one, joblib would do the work in this process."""
            return max(2, super().effective_n_jobs(n_jobs))

    return Backend(client=client, wait_for_workers_timeout=PATIENCE_S)


def _client(address: str) -> Any:
    """A connection to a scheduler, which reports by errors and not by a log."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise WorkersLostError(
            "a Dask cluster needs the extra edtk[cluster], which is not installed"
        ) from None
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with ThreadPoolExecutor(1) as thread:  # an event loop of its own, also where one is running
            thread.submit(asyncio.run, asyncio.wait_for(_greeted(address), GREETING_S)).result()
        return Client(address, timeout=5, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError, MemoryError) as error:
        raise WorkersLostError(f"no Dask scheduler answers at {address}") from error


async def _greeted(address: str) -> None:
    """Ask a scheduler who it is; a client would wait for ever for a silent one, and is noisy where it cannot connect.

    Raises:
        ValueError: Something else answers.
    """
    from distributed.comm import connect
    from distributed.security import Security

    comm = await connect(address, timeout=GREETING_S, **Security().get_connection_args("client"))
    try:
        await comm.write({"op": "identity", "reply": True})
        answer = await comm.read()
    finally:
        comm.abort()
    if not isinstance(answer, dict) or answer.get("type") != "Scheduler":
        raise ValueError(f"{address} is no scheduler")


def _watch(client: Any, done: Event) -> None:
    """Cancel the work of a cluster that has had no workers for a while; a scheduler waits for new ones for ever."""
    alone = 0.0
    while not done.wait(1.0) and client.status == "running":
        try:
            alone = 0.0 if client.ncores() else alone + 1.0
        except Exception:
            return  # the connection is lost, which cancels the work too
        if alone >= PATIENCE_S:
            client.close(timeout=2)
