"""A copy of this process that may be killed, or lose its disk, without harm to the tests."""

import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable


def forked(action: Callable[[], object]) -> int:
    """Carry out an action in a copy of this process.

    Returns:
        0; 1 where the action raised, with its traceback on standard error; and the negative number
        of the signal that ended the copy.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # threads are idle here, and the copy does not wait for any
        child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    try:
        action()
        os._exit(0)
    except BaseException:
        free_disk()
        traceback.print_exc()
    finally:
        os._exit(1)


def kill_at(moment: int) -> None:
    """Have the system kill this process at its n-th touch of the file system, counted from 1."""
    touched = 0

    def touch(event: str, _: object) -> None:
        nonlocal touched
        if event == "open" or event.startswith(("os.", "shutil.")):
            touched += 1
            if touched == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(touch)


def fill_disk(left: int) -> None:
    """Let no file of this process become larger than some bytes, as on a disk that is full."""
    import resource  # which Windows has not

    resource.setrlimit(resource.RLIMIT_FSIZE, (left, resource.RLIM_INFINITY))


def free_disk() -> None:
    """End the limit of `fill_disk`."""
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
