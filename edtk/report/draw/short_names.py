"""Names that fit into a picture."""

from collections.abc import Sequence
from itertools import takewhile

MOST = 18  # signs of a name
LEAST_SHARED = 4  # signs that all names begin or end with, before these are left out
DOTS = "…"


def short_names(names: Sequence[str]) -> list[str]:
    """Shorten names that are too long for a picture; names that differ still do.

    If one is, all lose the words that they begin and end with alike, as names of ROS joints do.
    Then the middle of a name that is still too long is left out.
    """
    if max(map(len, names), default=0) <= MOST:
        return list(names)
    first = _shared(names)
    last = _shared([name[first:][::-1] for name in names])
    before = DOTS if first else ""
    after = DOTS if last else ""
    parts = [f"{before}{name[first : len(name) - last]}{after}" for name in names]
    short = [_without_middle(part) for part in parts]
    return short if len(set(short)) == len(set(names)) else parts


def _shared(names: Sequence[str]) -> int:
    """Number of signs in the words that all names begin with, none of which is left empty."""
    if len(names) < 2:
        return 0
    words = [name.split("_") for name in names]
    alike = takewhile(lambda position: len(set(position)) == 1, zip(*words, strict=False))
    length = sum(len(position[0]) + 1 for position in alike)
    return length if LEAST_SHARED <= length < min(map(len, names)) else 0


def _without_middle(name: str) -> str:
    if len(name) <= MOST:
        return name
    end = (MOST - len(DOTS)) // 2
    return f"{name[: MOST - len(DOTS) - end]}{DOTS}{name[-end:]}"
