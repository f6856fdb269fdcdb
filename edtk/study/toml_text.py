"""Plain keys as the text of a TOML file."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
MOST_INLINE = 100  # characters of a line, beyond which a list is written an entry a line
SHORT_ESCAPES = {
    '"': '\\"',
    "\\": "\\\\",
    "\b": "\\b",
    "\t": "\\t",
    "\n": "\\n",
    "\f": "\\f",
    "\r": "\\r",
}


def toml_text(content: Mapping[str, Any]) -> str:
    """Write plain keys as TOML 1.0, so that `tomllib.loads` gives the same keys and values.

    Args:
        content: Booleans, integers, floats, strings, lists and tables (mappings with string keys),
            nested at will. Tuples are written as lists.

    Returns:
        The text. Keys keep their order, but for tables, which follow the other keys of their
        table, as TOML demands.

    Raises:
        TypeError: A value is of no such kind; TOML knows no None.
    """
    return "\n".join(_lines(content, ())).strip("\n") + "\n"


def inline(value: Any) -> str:
    """Write one value as it stands on the right of an equals sign; a table on one line."""
    return _value(value)


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Lines of a table: its plain keys, then its tables."""
    lines = []
    for key, value in table.items():
        if not (_is_table(value) or _is_table_array(value)):
            lines.append(f"{_key(key)} = {_value(value, len(key) + len(' = '))}")
    for key, value in table.items():
        inner = (*path, key)
        name = ".".join(map(_key, inner))
        if _is_table(value):
            inside = _lines(value, inner)
            needs_header = not inside or inside[0] != ""  # the header of a table inside says it all
            lines += ["", f"[{name}]", *inside] if needs_header else inside
        elif _is_table_array(value):
            for entry in value:
                lines += ["", f"[[{name}]]", *_lines(entry, inner)]
    return lines


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_list(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_table_array(value: Any) -> bool:
    return _is_list(value) and len(value) > 0 and all(map(_is_table, value))


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _string(key)


def _value(value: Any, indent: int = 0) -> str:
    """A value on the right of an equals sign, or inside a list."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return _float(float(value))
    if isinstance(value, str):
        return _string(value)
    if _is_table(value):  # inside a list that holds other things too
        return f"{{ {', '.join(f'{_key(key)} = {_value(v)}' for key, v in value.items())} }}"
    if _is_list(value):
        entries = [_value(entry) for entry in value]
        line = f"[{', '.join(entries)}]"
        if indent + len(line) <= MOST_INLINE:
            return line
        return "\n".join(["[", *(f"    {entry}," for entry in entries), "]"])
    raise TypeError(f"TOML has no form for {value!r}")


def _float(number: float) -> str:
    """The shortest text that is read as the same number."""
    if math.isnan(number):
        return "nan"
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    return repr(number)


def _string(text: str) -> str:
    """A basic string: quotes, backslashes and control characters are escaped."""
    return f'"{"".join(map(_character, text))}"'


def _character(character: str) -> str:
    if character in SHORT_ESCAPES:
        return SHORT_ESCAPES[character]
    is_control = ord(character) < 0x20 or ord(character) == 0x7F
    return f"\\u{ord(character):04x}" if is_control else character
