"""Numbers, strings and the like in a tree of tables and lists, each with its key."""

from collections.abc import Callable
from typing import Any


def check_leaves(value: Any, check: Callable[[Any, str], None], key: str = "") -> None:
    """Call a check with every value that is no table or list, and its key.

    Args:
        value: A table, a list, or a single value.
        check: Called with each value and its key, such as "poses.0.q"; raises where it is wrong.
        key: Key of the whole; empty for that of a file.
    """
    entries: Any = ()
    if isinstance(value, dict):
        entries = value.items()
    elif isinstance(value, list):
        entries = enumerate(value)
    else:
        check(value, key)
    for name, entry in entries:
        check_leaves(entry, check, f"{key}.{name}" if key else str(name))
