"""Calls into libraries that Ctrl-C would have to wait for."""

import os
import sys
import threading
from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

T = TypeVar("T")
SIGNAL_GLANCE_S = 0.2  # between two looks for a signal, where waiting for a thread is deaf to it
NAME = "edtk-native"


def interruptible(call: Callable[[], T]) -> T:
    """The answer of a call that lets go of Python's lock, such as that of a solver.

    A thread of its own makes the call, so that this one hears Ctrl-C and SIGTERM at once. After
    that nobody waits for the call, which needs a limit of time of its own.
    """
    answers: list[T] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            answers.append(call())
        except BaseException as error:
            errors.append(error)

    # No daemon: foreign code that is cut off at the end of Python may abort the whole process.
    thread = threading.Thread(target=run, name=NAME)
    thread.start()
    while thread.is_alive():
        thread.join(SIGNAL_GLANCE_S)
    if errors:
        raise errors[0]
    return answers[0]


def leave(code: Any) -> NoReturn:
    """End the program, without waiting for a call that was interrupted."""
    # Where Ctrl-C came in code that was made from a text, such as that of a dataclass, Python would
    # end by the signal itself, although it was answered. Running another text takes that back.
    exec("")
    if any(thread.name == NAME for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)
    sys.exit(code)
