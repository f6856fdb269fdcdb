"""`edtk` in a copy of this process that may be interrupted or killed: nothing is imported anew."""

import os
import select
import signal
import sys
import threading
import time
import traceback
import warnings
from typing import NoReturn, Self

from tqdm import tqdm

from edtk.cli import main

CHUNK = 4096
BAR_S = 0.1  # until the line of progress that was read has been written to its end
PATIENCE_S = 60.0  # for the end, on a loaded machine


class ForkedCommand:
    """A command that runs beside the test, with the searches of the tests.

    Attributes:
        returncode: Exit code, or the negative number of the signal that ended it; None before.
    """

    def __init__(self, *words: object) -> None:
        self.returncode: int | None = None
        self._stdout = os.memfd_create("stdout")
        self._stderr, stderr = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # threads are idle here, and the copy waits for none
            self._pid = os.fork()
        if not self._pid:
            _run([*map(str, words)], self._stdout, stderr)
        os.close(stderr)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.returncode is None:
            self.send_signal(signal.SIGKILL)
            self._wait()
        os.close(self._stdout)
        os.close(self._stderr)

    def poll(self) -> int | None:
        """The exit code, where the command has ended."""
        if self.returncode is None:
            pid, status = os.waitpid(self._pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal."""
        os.kill(self._pid, number)

    def interrupted(self, after: bytes) -> tuple[bytes, bytes]:
        """Its answer to Ctrl-C, which comes as soon as standard error says `after`.

        Returns:
            Standard output, and standard error.
        """
        said = b""
        while after not in said:
            said += (chunk := os.read(self._stderr, CHUNK))
            assert chunk, f"ended before {after!r}: {said!r}"
        time.sleep(BAR_S)
        self.send_signal(signal.SIGINT)
        stdout, rest = self.communicate()
        return stdout, said + rest

    def communicate(self) -> tuple[bytes, bytes]:
        """Wait for the end; standard output, and the rest of standard error."""
        end = time.monotonic() + PATIENCE_S
        said = b""
        while select.select([self._stderr], [], [], max(0.0, end - time.monotonic()))[0]:
            chunk = os.read(self._stderr, CHUNK)
            if not chunk:
                self._wait()
                return os.pread(self._stdout, os.fstat(self._stdout).st_size, 0), said
            said += chunk
        raise TimeoutError(f"no end after {PATIENCE_S} s: {said!r}")

    def _wait(self) -> None:
        if self.returncode is None:
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])


def _run(words: list[str], stdout: int, stderr: int) -> NoReturn:
    """Run the command in the copy, as in a process that a shell has started."""
    code = 1
    try:
        os.dup2(stdout, 1)
        os.dup2(stderr, 2)
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", buffering=1, closefd=False)  # noqa: SIM115
        signal.signal(signal.SIGINT, signal.default_int_handler)
        # Bars share a lock between processes: a copy that is killed while it holds it keeps it.
        tqdm.set_lock(threading.RLock())
        main(words, prog_name="edtk")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
