"""Readers of plain data that nobody is trusted to have written: each takes a value and its place.

All raise ValueError with a line that names the place and what was expected there.
"""

import reprlib
from collections.abc import Collection
from typing import Any

import numpy as np

from edtk.system.typing import Array

WRENCH = 9  # numbers of a wrench with its place


def table(value: Any, required: Collection[str], where: str, optional: Collection[str] = ()) -> Any:
    """A table with all required keys, and no others but the optional ones.

    An unknown key may mean something that is not checked here, such as a further constraint, so a
    table that has one is rejected.
    """
    if not isinstance(value, dict):
        raise ValueError(f"{where}: expected a table, got {reprlib.repr(value)}")
    for key in required:
        if key not in value:
            raise ValueError(f"{where}: the key {key!r} is missing")
    for key in value:
        if key not in required and key not in optional:
            raise ValueError(f"{where}: unknown key {reprlib.repr(key)}")
    return value


def rows(value: Any, most: int, where: str) -> list[Any]:
    """A list of at most so many entries."""
    if not isinstance(value, list):
        raise ValueError(f"{where}: expected a list, got {reprlib.repr(value)}")
    if len(value) > most:
        raise ValueError(f"{where}: expected at most {most} entries, got {len(value)}")
    return value


def text(value: Any, known: Collection[str], where: str) -> str:
    """One of the known words."""
    if not isinstance(value, str) or value not in known:
        words = ", ".join(map(repr, known))
        raise ValueError(f"{where}: expected one of {words}, got {reprlib.repr(value)}")
    return value


def numbers(value: Any, shape: tuple[int | None, ...], where: str) -> Array:
    """Finite numbers of a shape, in which None stands for any length."""
    expected = f"{where}: expected finite numbers of shape {_words(shape)}"
    if not _is_nested(value, len(shape)):
        raise ValueError(f"{expected}, got {reprlib.repr(value)}")
    try:
        found = np.array(value, dtype=float)
    except (ValueError, OverflowError):  # lists of several lengths, or an integer of 400 digits
        raise ValueError(expected) from None
    if not found.size and shape[0] is None:
        found = np.empty((0, *(length or 0 for length in shape[1:])))
    fits = found.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, found.shape, strict=True)
    )
    if not fits or not np.isfinite(found).all():
        raise ValueError(expected)
    return found


def in_range(found: Array, where: str) -> Array:
    """Numbers that were computed from given ones, if they and their squares are finite.

    Libraries of linear algebra print words of their own about any others, or never end.
    """
    with np.errstate(over="ignore"):
        if not np.isfinite(np.square(found).sum()):
            raise ValueError(f"{where}: numbers so large or so small that what follows is none")
    return found


def number(value: Any, where: str) -> float:
    """One finite number."""
    return float(numbers([value], (1,), where)[0])


def whole(value: Any, least: int, most: int, where: str) -> int:
    """A whole number in a range."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        got = reprlib.repr(value)
        raise ValueError(f"{where}: expected a whole number from {least} to {most}, got {got}")
    return value


def _is_nested(value: Any, depth: int) -> bool:
    """Whether a value is lists in lists of this depth that hold numbers, and nothing else."""
    if depth == 0:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(value, list) and all(_is_nested(entry, depth - 1) for entry in value)


def _words(shape: tuple[int | None, ...]) -> str:
    """A shape as a person writes it: (any, 6)."""
    return f"({', '.join('any' if length is None else str(length) for length in shape)})"


def wrenches_of(value: Any, where: str) -> Array:
    """Wrenches (k, 9): forces, torques, and how far from the load point each of them acts.

    The last three may be left out, of all of them: then all act at the load point.
    """
    found = numbers(value, (None, None), where)
    if len(found) and found.shape[1] not in (6, WRENCH):
        raise ValueError(f"{where}: expected wrenches of 6 numbers, or of 9 with a place")
    whole = np.zeros((len(found), WRENCH))
    whole[:, : found.shape[1]] = found
    return whole
