"""Plain data as the text of a JSON file."""

import json
import math
from typing import Any


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
