"""Keys of a study given in Python, as plain values that a TOML file could hold."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from edtk.study.table import Table


def plain_keys(keys: Mapping[str, Any]) -> dict[str, Any]:
    """Turn arrays into lists, paths into strings and tables into mappings, at every depth.

    Args:
        keys: Keys and their values; a key whose value is None counts as not given.

    Returns:
        The same keys with plain values. Values of other kinds stay as they are, for the
        validation to reject.
    """
    return {str(key): _plain(value) for key, value in keys.items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, Table):
        return value.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    if isinstance(value, Mapping):
        return plain_keys(value)
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value
