"""Teams: processes of this machine, and a real Dask cluster whose processes are killed."""

import operator
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from threading import Thread
from time import perf_counter, sleep, time

import pytest
from threadpoolctl import threadpool_info

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.study.study import load_study
from edtk.system.workers import Workers, WorkersLostError, open_workers

# What other processes search is what users search.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("whole_searches")]

LOOPBACK = "127.0.0.1"
STARTED_S = 30.0  # for a process of ours to come up
SOON_S = 15.0  # five for a connection or a loss to be noticed, and a machine that others use
SEARCH = SearchOptions(starts=64, patience=4)  # four batches, two at a time

# Pieces of work from the standard library, so that a new process has little to import.
NAP = partial(sleep, 0.2)
DEADLY = partial(signal.raise_signal, getattr(signal, "SIGKILL", signal.SIGTERM))
FAULTY = partial(operator.truediv, 1, 0)


def waits_for(path: Path) -> Callable[[], int]:
    """A piece of work that another process ends by making a file."""
    loop = 'until test -e "$0"; do sleep 0.02; done'
    return partial(subprocess.check_call, ["sh", "-c", loop, str(path)], timeout=STARTED_S)


@cache
def relaxed():
    """The paper's problem over a few candidates."""
    space = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml").space
    return relax_poses(CandidateSource(space, 0, "sobol", workers=1), 200, create("D"))


def test_processes_load_nothing_from_the_current_folder(tmp_path):
    """Where somebody has put a module that every process of a team imports first."""
    folder = tmp_path / "foreign"
    folder.mkdir()
    for name in ("joblib", "numpy", "multiprocessing"):
        (folder / f"{name}.py").write_text("open('RAN', 'w').close()\n")
    script = tmp_path / "script.py"
    script.write_text(
        "import operator\nfrom functools import partial\nfrom edtk.system.workers import Workers\n"
        "print(sorted(Workers(2).run([partial(operator.add, 1, i) for i in range(2)])))\n"
    )
    found = subprocess.run([sys.executable, script], cwd=folder, capture_output=True, text=True)
    assert (found.stdout, found.stderr) == ("[(0, 1), (1, 2)]\n", "")
    assert not (folder / "RAN").exists()


class Cluster:
    """A Dask scheduler and workers, each a process on the loopback interface.

    Args:
        folder: Where their files go.
    """

    def __init__(self, folder: Path) -> None:
        with socket.socket() as s:
            s.bind((LOOPBACK, 0))
            self.port = s.getsockname()[1]
        self.address = f"tcp://{LOOPBACK}:{self.port}"
        self.folder = folder
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._process("scheduler", "--host", LOOPBACK, "--port", str(self.port))

    def _process(self, kind: str, *options: str) -> "subprocess.Popen[bytes]":
        quiet = ["--no-dashboard", "--dashboard-address", ":0"]
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options, *quiet]
        with (self.folder / "log.txt").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)

    def listen(self) -> None:
        """Wait until the scheduler listens."""
        limit = time() + STARTED_S
        while True:
            with socket.socket() as s:
                if s.connect_ex((LOOPBACK, self.port)) == 0:
                    return
            assert time() < limit, (self.folder / "log.txt").read_text()
            sleep(0.05)

    def join(self, n: int) -> None:
        """Have n workers: those that are alive and new ones, or none; wait until all are known."""
        from distributed import Client

        if n == 0:
            for process in self.workers:
                process.kill()
                process.wait()
        self.workers = [process for process in self.workers if process.poll() is None]
        options = ["--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder)]
        missing = n - len(self.workers)
        self.workers += [self._process("worker", self.address, *options) for _ in range(missing)]
        limit = time() + STARTED_S
        with Client(self.address, timeout=STARTED_S, set_as_default=False) as client:
            while len(client.ncores()) != n:
                assert time() < limit, (self.folder / "log.txt").read_text()
                sleep(0.05)

    def close(self) -> None:
        """End all that was started."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def clusters(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], Cluster]]:
    """A function that gives a cluster whose scheduler is alive; starting one takes a second."""
    pytest.importorskip("distributed")
    started: list[Cluster] = []

    def alive() -> Cluster:
        if not started or started[-1].scheduler.poll() is not None:
            started.append(Cluster(tmp_path_factory.mktemp("cluster")))
            started[-1].listen()
        return started[-1]

    try:
        yield alive
    finally:
        for cluster in started:
            cluster.close()


@pytest.fixture
def cluster(clusters: Callable[[], Cluster]) -> Cluster:
    """A scheduler that is alive, and any number of workers."""
    return clusters()


@pytest.mark.parametrize("size", [1, 2])
def test_every_piece_is_answered_once(size):
    """Each piece comes back once with its index, whatever the number of processes."""
    pieces: list[Callable[[], int]] = [partial(pow, 10, i) for i in range(5)]
    assert sorted(Workers(size).run(pieces)) == [(i, 10**i) for i in range(5)]


def test_answers_come_when_they_are_there(tmp_path):
    """A piece that takes long does not hold up those after it."""
    path = tmp_path / "others_are_done"
    order = []
    for i, _ in Workers(2).run([waits_for(path), partial(pow, 1, 1), partial(pow, 1, 1)]):
        order.append(i)
        if len(order) == 2:
            path.touch()
    assert order[-1] == 0


@pytest.mark.parametrize("size", [1, 2])
def test_a_mistake_stays_what_it_is(size):
    """An exception inside a piece of work reaches the caller as itself."""
    with pytest.raises(ZeroDivisionError):
        list(Workers(size).run([FAULTY, FAULTY]))


def test_no_more_processes_than_pieces(monkeypatch):
    """A million workers for one piece are one: each would be a process, whatever it has to do."""
    asked = []

    class Parallel:
        def __init__(self, n_jobs, **others):
            asked.append(n_jobs)

        def __call__(self, work):
            return (call(*given, **named) for call, given, named in work)

    monkeypatch.setattr("joblib.Parallel", Parallel)
    assert list(Workers(10**6).run([int])) == [(0, 0)]
    assert asked == [1]


def test_this_machine():
    """A team of this machine has as many processes as one asks for, or one a core."""
    with open_workers(3) as three, open_workers() as every:
        assert three.size == 3
        assert every.size == os.cpu_count()


def test_a_process_that_dies():
    """The loss of a killed process is named, and the next processes work."""
    with pytest.raises(WorkersLostError, match="this machine"):
        list(Workers(2).run([DEADLY, DEADLY]))
    assert sorted(Workers(2).run([partial(pow, 10, i) for i in range(2)])) == [(0, 1), (1, 10)]


@pytest.mark.parametrize("address", [f"tcp://{LOOPBACK}:{{}}", "nonsense://here"])
def test_nobody_there(address):
    """An address where nobody answers, or that is none, is rejected soon, by its name."""
    pytest.importorskip("distributed")
    with socket.socket() as s:
        s.bind((LOOPBACK, 0))  # taken, but nobody listens
        address = address.format(s.getsockname()[1])
        since = perf_counter()
        with (
            pytest.raises(WorkersLostError, match=f"answers at {address}"),
            open_workers(dask=address, greeting_s=0.3),
        ):
            pass
        assert perf_counter() - since < SOON_S


@pytest.mark.parametrize("answer", [None, b"", b"HTTP/1.1 400 Bad Request\r\n\r\n" + 100 * b"x"])
def test_something_else_answers(answer, capfd):
    """A program that is no scheduler (silent, hanging up, a web server) is named soon."""
    pytest.importorskip("distributed")
    with socket.create_server((LOOPBACK, 0)) as server:
        address = f"tcp://{LOOPBACK}:{server.getsockname()[1]}"
        callers = []

        def listen():
            with suppress(OSError):  # closed at the end
                while True:
                    callers.append(server.accept()[0])
                    if answer is not None:
                        callers[-1].sendall(answer)
                        callers[-1].close()

        Thread(target=listen, daemon=True).start()
        start = perf_counter()
        with (
            pytest.raises(WorkersLostError, match=f"no Dask scheduler answers at {address}"),
            open_workers(dask=address, greeting_s=0.3),
        ):
            pass
        assert perf_counter() - start < SOON_S
    assert callers
    assert capfd.readouterr() == ("", "")


def test_without_distributed(monkeypatch):
    """Where Dask is not installed, the message names the extra that brings it."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(WorkersLostError, match=r"edtk\[cluster\]"),
        open_workers(dask=f"tcp://{LOOPBACK}:1"),
    ):
        pass


def test_scheduler_without_workers(cluster):
    """A cluster without workers is refused soon, by a message that says what it lacks."""
    cluster.join(0)
    since = perf_counter()
    with (
        pytest.raises(WorkersLostError, match=f"{cluster.address} has no workers"),
        open_workers(dask=cluster.address),
    ):
        pass
    assert perf_counter() - since < SOON_S


def test_a_worker_killed_between_batches(cluster):
    """Two Dask workers, one of them killed during the search, find the plan that one finds.

    The same plan is the same bit by bit, found just as often among as many others.
    """
    cluster.join(2)
    alone = find_plan(relaxed(), 3, options=SEARCH)
    with open_workers(dask=cluster.address) as both:
        assert both.size == 2
        options = replace(SEARCH, workers=both, progress=lambda *_: cluster.workers[0].kill())
        plan = find_plan(relaxed(), 3, options=options)
    assert cluster.workers[0].wait() == -signal.SIGKILL
    assert cluster.workers[1].poll() is None
    assert plan.starts == alone.starts == SEARCH.starts
    assert plan.plan.q.tobytes() == alone.plan.q.tobytes()
    assert plan.plan.repeats.tolist() == alone.plan.repeats.tolist()
    assert (plan.cost, plan.found, plan.optima, plan.ended) == (
        alone.cost,
        alone.found,
        alone.optima,
        alone.ended,
    )


def test_a_worker_killed_at_work(cluster):
    """A worker that is killed while it works has its pieces done by the other one.

    A cluster of that single core does the work itself too: no piece is done in this process.
    """
    cluster.join(2)
    with open_workers(dask=cluster.address) as both:
        answers = both.run([NAP] * 4)
        done = [next(answers)]  # and the next ones are under way
        cluster.workers[1].kill()
        cluster.workers[1].wait()
        assert sorted([*done, *answers]) == [(i, None) for i in range(4)]
        assert {pid for _, pid in both.run([os.getpid] * 4)} == {cluster.workers[0].pid}
    with open_workers(dask=cluster.address) as one:
        assert {pid for _, pid in one.run([os.getpid] * 4)} == {cluster.workers[0].pid}


@pytest.mark.parametrize("who", ["workers", "scheduler"])
def test_all_killed_at_work(cluster, capfd, who):
    """When the scheduler or every worker is killed, the work soon ends by one message."""
    cluster.join(2 if who == "workers" else 1)
    killed = []

    def work() -> None:
        with open_workers(dask=cluster.address, patience_s=1.0) as both:
            for _ in both.run([NAP] * 6):
                for process in cluster.workers if who == "workers" else [cluster.scheduler]:
                    process.kill()
                    process.wait()
                killed.append(perf_counter())

    with pytest.raises(WorkersLostError, match=f"{cluster.address} have gone away"):
        work()
    assert perf_counter() - killed[0] < SOON_S
    assert "distributed" not in capfd.readouterr().err


@pytest.mark.parametrize("size", [1, 2])
def test_a_piece_has_one_thread(size: int) -> None:
    """The rounding of a product does not depend on how many pieces are done at once."""
    with open_workers(size) as workers:
        for _, libraries in workers.run([threadpool_info, threadpool_info]):
            assert {library["num_threads"] for library in libraries} == {1}
