"""Some pairs of two lists, where all of them would prove nothing more."""

from collections.abc import Sequence
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")


def some_pairs(first: Sequence[A], second: Sequence[B], times: int = 1) -> list[tuple[A, B]]:
    """Pairs in which each of the first list has so many of the second, and all of these come.

    A law of every criterion and every case is shown for each criterion, and in each case.
    """
    n = len(second)
    step = -(-n // times)
    found = [(one, second[(i + k * step) % n]) for i, one in enumerate(first) for k in range(times)]
    assert all(any(b == other for _, other in found) for b in second)
    return found
