"""Calls into libraries that Ctrl-C would have to wait for."""

import os
import signal
import threading
import time

import pytest

from edtk.system.interruptible import interruptible


def test_the_answer_and_the_error_are_those_of_the_call() -> None:
    """Whoever calls notices nothing of the thread."""
    assert interruptible(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0)


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
