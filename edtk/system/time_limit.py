"""How long a call may take: whoever improves something asks whether there is time to go on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from time import monotonic

import numpy as np

LONGEST_S = 300.0  # of one program: nobody waits longer for the last digits of a bound
SHORTEST_S = 5.0  # which a first program has in any case: without it there is no design at all

Progress = Callable[[str, float], object]  # called with the current step, and a number beside it


@dataclass
class Limit:
    """A limit on what is done within it, or within limits in it that have a share of its time.

    Attributes:
        end: When it ends, on the clock of `time.monotonic` [s].
        cut: Whether somebody was told that the time is over, and left with the best so far.
    """

    end: float
    cut: bool = False


# A limit holds for all that is called within it, in the same thread; other processes get what is
# left.
_limit: ContextVar[Limit | None] = ContextVar("limit", default=None)


@contextmanager
def time_limit(seconds: float) -> Iterator[Limit]:
    """Limit what is done within; a limit around it holds as well.

    Args:
        seconds: Time from now on [s]. Zero asks for the first answer that can be given.
    """
    outer = _limit.get()
    end = monotonic() + seconds
    own = Limit(end if outer is None else min(outer.end, end))
    before = _limit.set(own)
    try:
        yield own
    finally:
        _limit.reset(before)
        if outer is not None:
            # A first answer that was asked for is whole.
            outer.cut |= own.cut and seconds > 0


def time_left() -> float:
    """Time until the limit [s], zero after it; infinite without a limit."""
    limit = _limit.get()
    return np.inf if limit is None else max(0.0, limit.end - monotonic())


def time_of_program() -> float:
    """How long a solver may take for one program [s]."""
    return min(LONGEST_S, max(SHORTEST_S, time_left()))


def out_of_time() -> bool:
    """Whether the time is over: leave with the best so far."""
    limit = _limit.get()
    if limit is None or time_left() > 0.0:
        return False
    limit.cut = True
    return True


def no_progress(*told: object) -> None:
    """Show nothing of how far work is."""
