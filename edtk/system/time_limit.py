"""How long a call may take: whoever improves something asks whether there is time to go on."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import monotonic

import numpy as np

# On the clock of `time.monotonic` [s]. A limit holds for all that is called within it, in the same
# thread; other processes get what is left.
_end: ContextVar[float] = ContextVar("end", default=np.inf)


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Limit what is done within; a limit around it holds as well.

    Args:
        seconds: Time from now on [s]. Zero asks for the first answer that can be given.
    """
    outer = _end.set(min(_end.get(), monotonic() + seconds))
    try:
        yield
    finally:
        _end.reset(outer)


def time_left() -> float:
    """Time until the limit [s], zero after it; infinite without a limit."""
    return max(0.0, _end.get() - monotonic())


def out_of_time() -> bool:
    """Whether the time is over: leave with the best so far."""
    return time_left() <= 0.0
