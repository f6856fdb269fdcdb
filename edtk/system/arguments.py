"""Arguments of calls, held against the types that their signatures name."""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from math import isnan
from numbers import Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeGuard, TypeVar, Union, get_args, get_origin

from edtk.system.errors import ArgumentError

P = ParamSpec("P")
R = TypeVar("R")

BOOLEANS = ("bool", "bool_")  # names of the classes: numpy has one of its own
# What a message calls them; other kinds by the names of their classes.
WORDS: Mapping[Any, str] = {
    Path: "a path",
    str: "text",
    bool: "True or False",
    float: "a number",
    Mapping: "a table by name",
    Sequence: "a list",
    Callable: "a function",
}
# What a message calls several of a kind; others are "entries".
MANY: Mapping[Any, str] = {float: "numbers", int: "whole numbers", str: "texts"}
READ_BY_CALL = frozenset((int, Any, None))
# What is asked for in their place.
CONTAINERS: Mapping[Any, Any] = {dict: Mapping, list: Sequence, tuple: Sequence}


def checked(call: Callable[P, R]) -> Callable[P, R]:
    """A call that says on one line which argument is of a wrong type, before any work.

    It asks for what the signature says: paths, texts, numbers, switches, functions, objects, lists
    and tables of these. Whole numbers, and objects in whose place a text or a file may stand, such
    as a study, the call reads itself, as it knows what else to say of them.

    Args:
        call: A function whose signature names types.

    Returns:
        The same function, which raises an `ArgumentError` for such an argument.
    """
    parameters = inspect.signature(call).parameters.values()
    names = [one.name for one in parameters]
    typed = (one for one in parameters if one.annotation is not inspect.Parameter.empty)
    hints = {one.name: one.annotation for one in typed if is_plain(one.annotation)}

    @wraps(call)
    def asked(*args: P.args, **kwargs: P.kwargs) -> R:
        given = dict(zip(names, args, strict=False)) | kwargs
        for name, hint in hints.items():
            if name in given:
                _require(given[name], hint, name)
        return call(*args, **kwargs)

    return asked


def _require(given: object, hint: Any, argument: str) -> None:
    """Check an argument, or an entry of one.

    Raises:
        ArgumentError: It is of another type.
    """
    options = _options(hint)
    own = next((option for option in options if _fits(given, _kind(option))), None)
    if own is None:
        kinds = [kind for kind in map(_kind, options) if kind is not NoneType]
        if Path in kinds and str in kinds:  # which is a path, too
            kinds.remove(str)
        words = ", or ".join(WORDS.get(kind, kind.__name__) for kind in kinds)
        other = given if isinstance(given, float) else type(given).__name__
        raise ArgumentError(f"expected {words}, not {other}", argument=argument)
    for name, entry, entry_hint in _entries(given, own, argument):
        if is_plain(entry_hint):
            _require(entry, entry_hint, f"{argument} {name}")


def _entries(given: Any, hint: Any, argument: str) -> Iterator[tuple[Any, Any, Any]]:
    """Name or number, value and type of each entry of a list or a table.

    Raises:
        ArgumentError: It has another number of entries.
    """
    inner = get_args(hint)
    kind = _kind(hint)
    if kind is Mapping and inner:
        yield from ((name, entry, inner[1]) for name, entry in given.items())
    elif get_origin(hint) is tuple and Ellipsis not in inner:
        if len(given) != len(inner):
            entries = MANY.get(inner[0], "entries") if len(set(inner)) == 1 else "entries"
            message = f"expected {len(inner)} {entries}, not {len(given)}"
            raise ArgumentError(message, argument=argument)
        yield from zip(range(1, len(inner) + 1), given, inner, strict=True)
    elif kind is Sequence and inner:
        yield from ((i, entry, inner[0]) for i, entry in enumerate(given, 1))


def is_plain(hint: Any) -> bool:
    """Whether all kinds that a type allows are those that are checked here."""
    kinds = {_kind(option) for option in _options(hint)} - {NoneType}
    is_read_by_call = bool(kinds & READ_BY_CALL) or (str in kinds and not kinds <= WORDS.keys())
    return bool(kinds) and not is_read_by_call


def _options(hint: Any) -> tuple[Any, ...]:
    """The types of a union, or the type itself."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _kind(hint: Any) -> Any:
    """What a type is called in `WORDS`: of `Mapping[str, float]` it is `Mapping`."""
    kind = get_origin(hint) or hint
    return CONTAINERS.get(kind, kind) if isinstance(kind, type) else None  # of a quoted name


def _fits(given: Any, kind: Any) -> bool:
    """Whether a value is of a kind."""
    if kind is bool:
        return type(given).__name__ in BOOLEANS
    if kind is float:
        return is_number(given)
    if kind is Sequence:  # arrays are no `Sequence` of Python
        is_list = hasattr(given, "__getitem__") and getattr(given, "ndim", 1) > 0
        return is_list and not isinstance(given, str | bytes | Mapping | type)
    return isinstance(given, kind)


def is_number(given: object) -> TypeGuard[float]:
    """Whether a value is a number that a float can be, and no NaN; true and false are none."""
    if not isinstance(given, Real) or type(given).__name__ in BOOLEANS:
        return False
    try:
        return not isnan(given)
    except OverflowError:
        return False
