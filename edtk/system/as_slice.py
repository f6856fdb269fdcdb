"""Indices that follow each other, as a slice."""

from collections.abc import Sequence


def as_slice(indices: Sequence[int]) -> slice | list[int]:
    """A slice where indices follow each other, which takes a view; else a list, which copies."""
    first, last = indices[0], indices[-1]
    own = list(indices)
    return slice(first, last + 1) if own == list(range(first, last + 1)) else own
