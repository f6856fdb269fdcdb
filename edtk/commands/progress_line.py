"""What a command says on standard error while a user waits."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from time import time

SHOWN_AFTER_S = 1.0


@contextmanager
def progress_line(first: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error that says the current step and the time since the beginning.

    It appears after a second, so that short work and refused input show none.

    Args:
        first: The first step, which may take long.

    Yields:
        What to call with each next step.
    """
    from tqdm import tqdm

    bar = tqdm(
        desc=first,
        file=sys.stderr,
        bar_format="{desc} [{elapsed}]",
        delay=SHOWN_AFTER_S,
        mininterval=0,
        miniters=1,
    )

    def appear() -> None:
        bar.last_print_t = time()  # else its end would take the line for one never shown
        bar.refresh()

    # A bar looks at the clock when there is news only, of which the first step has none.
    timer = Timer(SHOWN_AFTER_S, appear)
    timer.daemon = True
    timer.start()
    try:
        with bar:

            def say(step: str) -> None:
                bar.set_description_str(step, refresh=False)
                bar.update()

            yield say
    finally:
        timer.cancel()
