"""The content of JSON text that nobody is trusted to have written."""

import json
import math
import re
from functools import partial
from pathlib import Path
from typing import Any

from edtk.system.check_leaves import check_leaves
from edtk.system.errors import UserError

MOST_WRITTEN = 500  # digits of a number in a file: reading more takes the square of their number
LONG_NUMBER = re.compile(rf"[0-9]{{{MOST_WRITTEN}}}")
MOST_DIGITS = 308  # of an integer, beyond which it is no finite number of double precision


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
