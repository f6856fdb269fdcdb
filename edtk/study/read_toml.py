"""The content of a TOML file, with messages about what is wrong with it."""

import tomllib
from pathlib import Path
from typing import Any

from edtk.system.errors import UserError
from edtk.system.read_text import decode, read_bytes


def read_toml(path: Path) -> tuple[dict[str, Any], bytes]:
    """Read a study file.

    Returns:
        Its keys, and its bytes.

    Raises:
        UserError: The file does not exist, cannot be read, or is not valid TOML.
    """
    raw = read_bytes(path)
    text = decode(raw, path)
    try:
        return tomllib.loads(text), raw
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"not valid TOML: {error}", where=path) from error
