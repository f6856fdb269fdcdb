"""What stands for a tool and a load that a table leaves out, where it has a payload."""

from typing import Any

from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from edtk.study.tool import Load, Tool
from edtk.system.finite import ZERO


def payload_stands_in(given: Any, info: ValidationInfo, no_load: Load | None) -> Any:
    """Take a given tool or load; where there is none, a payload needs neither, nor does geometry.

    Args:
        given: The value of `tool` or `load`; None if the key is left out.
        info: The name of the key, and the keys before it, of which `payload` is one.
        no_load: What stands for a load beside the payload.

    Returns:
        The given value. Without one: the frame of the last joint for a tool, or `no_load`.

    Raises:
        PydanticCustomError: Neither the key nor a payload is given.
    """
    if given is not None:
        return given
    # Absolute positions need no load, and find the tool.
    if all(info.data.get(key) is None for key in ("payload", "parameters")):
        raise PydanticCustomError("missing", "this key is required")
    return Tool(position_mm=ZERO) if info.field_name == "tool" else no_load
