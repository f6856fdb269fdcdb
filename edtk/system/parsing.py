"""JSON, TOML and XML that nobody is trusted to have written, and plain data as text."""

import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

from edtk.system.errors import UserError

if TYPE_CHECKING:
    from edtk.system.typing import Array

MOST_WRITTEN = 500  # digits of a number in a file: reading more takes the square of their number
MOST_DIGITS = 308  # of an integer, beyond which it is no finite number of double precision
MOST_STUDY_MB = 1.0  # of a file: a study has some kilobytes, and a megabyte takes seconds to parse
MOST_PARTS = 16  # of a dotted key; the parser's time and memory grow with their third power
PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
LARGEST = 2**63  # integers beyond 64 bits are no TOML, although Python's parser reads them
MOST_ELEMENTS = 200_000  # a robot with all its meshes has some thousand
MOST_DEPTH = 100
LARGEST_READ = 1e9  # number of a result: squares of larger ones lose all meaning


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


LONG_NUMBER = re.compile(rf"[0-9]{{{MOST_WRITTEN}}}")


def parse_json(text: str, where: Path | str | None = None) -> Any:
    """Read strict JSON: no key occurs twice in one table, and every number is finite.

    Args:
        text: The text.
        where: The file, for messages.

    Returns:
        Tables, lists, strings, numbers, booleans and None.

    Raises:
        UserError: The text is not valid JSON, or nested too deeply; names the place.
    """
    if LONG_NUMBER.search(text):
        raise UserError(f"has a number of {MOST_WRITTEN} digits or more", where=where)
    try:
        content = json.loads(text, object_pairs_hook=_unique, parse_int=_integer)
        check_leaves(content, partial(_require_finite, where))
    except RecursionError as error:
        message = "not valid JSON here: lists or tables are nested too deeply"
        raise UserError(message, where=where) from error
    except UserError:
        raise
    except ValueError as error:
        raise UserError(f"not valid JSON: {error}", where=where) from error
    return content


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A table; a key that occurs twice would be read as one number by one reader, another by us.

    Raises:
        ValueError: A key occurs twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key occurs twice in one table")
    return found


def _integer(digits: str) -> float:
    """A whole number; one beyond the range of double precision counts as infinite."""
    return int(digits) if len(digits) <= MOST_DIGITS else float(digits)


def _require_finite(where: Path | str | None, value: Any, key: str) -> None:
    """Python reads NaN and Infinity, which JSON does not have, and 1e999 as infinite."""
    if isinstance(value, float) and not math.isfinite(value):
        given = "NaN" if math.isnan(value) else "an infinite one"
        raise UserError(f"expected a finite number, got {given}", where=where, key=key)


DOTTED = re.compile(rf"(?<![\w-]){PART}(?:[ \t]*+\.[ \t]*+{PART}){{{MOST_PARTS}}}")


def parse_toml(text: str, where: Path | str | None = None) -> dict[str, Any]:
    """Read TOML in bounded time and depth.

    Args:
        text: The text.
        where: The file, for messages.

    Returns:
        The keys and their values, whose integers have 64 bits at most.

    Raises:
        UserError: The text is not valid TOML, or nested too deeply; names the place.
    """
    long = DOTTED.search(text)
    if long is not None:
        line = text.count("\n", 0, long.start()) + 1
        message = f"not valid TOML: a key of more than {MOST_PARTS} parts (at line {line})"
        raise UserError(message, where=where)
    try:
        content = tomllib.loads(text)
        check_leaves(content, partial(_require_short_integer, where))
    except RecursionError as error:
        message = "not valid TOML here: lists or tables are nested too deeply"
        raise UserError(message, where=where) from error
    except UserError:
        raise
    except ValueError as error:  # a TOMLDecodeError, or an integer of more than 4,300 digits
        reason = "an integer has too many digits" if "digits" in str(error) else str(error)
        raise UserError(f"not valid TOML: {reason}", where=where) from error
    return content


def _require_short_integer(where: Path | str | None, value: Any, key: str) -> None:
    """Python reads integers of any length, which TOML does not have."""
    if isinstance(value, int) and not -LARGEST <= value < LARGEST:
        raise UserError("the integer has more than 64 bits", where=where, key=key)


@dataclass
class Element:
    """An element of XML.

    Attributes:
        tag: Its name, with any prefix.
        attributes: Its attributes, as texts.
        line: The line in which it begins.
        children: The elements in it, in their order.
        text: All text that stands in it, but not in its children.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Element"] = field(default_factory=list)
    text: str = ""

    def all(self, tag: str) -> list["Element"]:
        """The children of one name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> "Element | None":
        """The first child of one name, None where there is none."""
        return next(iter(self.all(tag)), None)

    def everything(self) -> Iterator["Element"]:
        """This element and all elements in it."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)


def parse_xml(text: str, where: Path | str | None = None) -> Element:
    """Read the elements, attributes and texts of XML in bounded time, memory and depth.

    A document type is refused: with its entities, few lines can stand for gigabytes or for files.
    Prefixes of names are kept as they are, declared or not.

    Args:
        text: The text.
        where: The file, for messages.

    Returns:
        The root element.

    Raises:
        UserError: The text is not valid XML, or too large; names the line.
    """
    builder = _Builder(where)
    try:
        builder.parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        message = f"not valid XML: {reason} (at line {error.lineno}, column {error.offset + 1})"
        raise UserError(message, where=where) from error
    except ValueError as error:  # a lone half of a surrogate pair is no text that can be parsed
        if isinstance(error, UserError):
            raise
        raise UserError("not valid XML: no text in UTF-8", where=where) from error
    return builder.root.children[0]


class _Builder:
    """Collects the elements while the parser reads."""

    def __init__(self, where: Path | str | None) -> None:
        self.where = where
        self.root = Element("", {}, 0)
        self.open = [self.root]
        self.texts: list[list[str]] = [[]]
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MOST_ELEMENTS:
            raise UserError(f"has more than {MOST_ELEMENTS:,} elements", where=self.where)
        if len(self.open) > MOST_DEPTH:
            message = f"elements are nested more than {MOST_DEPTH} deep"
            raise UserError(f"{message} (at line {self._line})", where=self.where)
        element = Element(tag, attributes, self._line)
        self.open[-1].children.append(element)
        self.open.append(element)
        self.texts.append([])

    def _end(self, tag: str) -> None:
        self.open.pop().text = "".join(self.texts.pop())

    def _text(self, text: str) -> None:
        self.texts[-1].append(text)

    def _doctype(self, *declared: object) -> None:
        message = f"has a DOCTYPE (at line {self._line}); expected plain XML without one"
        raise UserError(message, where=self.where)

    @property
    def _line(self) -> int:
        return self.parser.CurrentLineNumber


def numbers_of(given: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> "Array":
    """Finite numbers of a shape.

    Raises:
        ValueError: The key has others.
    """
    import numpy as np  # commands that read no numbers start without it

    try:
        values = np.array(given.get(key), dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{key}: expected numbers") from None
    values = values.reshape(shape) if not values.size and 0 in shape else values
    if values.shape != shape or not np.isfinite(values).all():
        size = " by ".join(map(str, shape)) or "one"
        raise ValueError(f"{key}: expected {size} finite numbers")
    if (np.abs(values) > LARGEST_READ).any():
        raise ValueError(f"{key}: expected numbers up to {LARGEST_READ:g}")
    return values


def not_negative_of(given: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> "Array":
    """Numbers of a shape, none below zero.

    Raises:
        ValueError: The key has others.
    """
    values = numbers_of(given, key, shape)
    if (values < 0).any():
        raise ValueError(f"{key}: expected numbers that are not negative")
    return values


def json_text(content: Any, indent: int = 2) -> str:
    """Write strict JSON, as every program reads it.

    JSON knows no infinity and no NaN: in their place stands null, for "no number".

    Args:
        content: Tables with string keys, lists, strings, numbers, booleans and None.
        indent: Blanks in front of an entry of a table, for each table around it.

    Returns:
        The text, without a line break at its end.
    """
    try:
        return json.dumps(content, indent=indent, allow_nan=False)
    except ValueError:  # a number is not finite
        return json.dumps(_strict(content), indent=indent, allow_nan=False)


def _strict(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _strict(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(entry) for entry in value]
    return value
