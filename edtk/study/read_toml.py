"""The content of a TOML file, with messages about what is wrong with it."""

from pathlib import Path
from typing import Any

from edtk.system.parse_toml import MOST_MB, parse_toml
from edtk.system.read_text import decode, read_bytes


def read_toml(path: Path) -> tuple[dict[str, Any], bytes]:
    """Read a study file.

    Returns:
        Its keys, and its bytes.

    Raises:
        UserError: The file does not exist, cannot be read, or is not valid TOML.
    """
    raw = read_bytes(path, MOST_MB)
    return parse_toml(decode(raw, path), path), raw
