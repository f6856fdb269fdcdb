"""Computing in one thread, so that the rounding of products is always the same."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the libraries that are loaded compute in one thread, as `threadpool_limits(1)` does.

    Libraries are looked for when modules were imported since the last time, and not each time:
    that takes as long as a short descent.
    """
    with _libraries(len(sys.modules)).limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The libraries with threads of their own, where so many modules are imported."""
    return ThreadpoolController()
