"""Calls into libraries that Ctrl-C would have to wait for."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from edtk.system.interruptible import interruptible


def test_the_answer_and_the_error_are_those_of_the_call() -> None:
    """Whoever calls notices nothing of the thread."""
    assert interruptible(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0)


@pytest.mark.unix
def test_a_signal_need_not_wait_for_the_call() -> None:
    """Ctrl-C is heard at once while the call goes on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    done = threading.Event()
    timer = threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    since = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda: done.wait(60))
        assert time.monotonic() - since < 30
        assert not done.is_set()
    finally:
        done.set()
        signal.signal(signal.SIGINT, before)


def test_an_interruption_in_a_text_that_is_run_ends_with_the_code() -> None:
    """Ctrl-C while a dataclass is made, whose text Python runs, ends with 130 and no signal."""
    code = (
        "from edtk.system.interruptible import leave\n"
        "try:\n"
        "    exec('raise KeyboardInterrupt')\n"
        "except KeyboardInterrupt:\n"
        "    leave(130)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == 130
