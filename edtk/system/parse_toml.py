"""The content of TOML text that nobody is trusted to have written."""

import re
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from edtk.system.check_leaves import check_leaves
from edtk.system.errors import UserError

MOST_MB = 1.0  # of a file: a study has some kilobytes, and a megabyte takes seconds to parse
MOST_PARTS = 16  # of a dotted key; the parser's time and memory grow with their third power
PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
DOTTED = re.compile(rf"(?<![\w-]){PART}(?:[ \t]*+\.[ \t]*+{PART}){{{MOST_PARTS}}}")
LARGEST = 2**63  # integers beyond 64 bits are no TOML, although Python's parser reads them


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
