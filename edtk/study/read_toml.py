"""The content of a TOML file, with messages about what is wrong with it."""

import tomllib
from pathlib import Path
from typing import Any

from edtk.system.errors import UserError


def read_toml(path: Path) -> tuple[dict[str, Any], bytes]:
    """Read a study file.

    Returns:
        Its keys, and its bytes.

    Raises:
        UserError: The file does not exist, cannot be read, or is not valid TOML.
    """
    try:
        raw = path.read_bytes()
        return tomllib.loads(raw.decode("utf-8")), raw
    except FileNotFoundError:
        raise UserError("no such study file", where=path) from None
    except OSError as error:
        raise UserError(str(error.strerror), where=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"not valid TOML: {error}", where=path) from error
