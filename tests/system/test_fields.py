"""Numbers of files are numbers: what a table asks for is never a switch or a text."""

from typing import Any

import pytest

from edtk.robots.robot_file import RobotAndMore, RobotFile
from edtk.study.schema import Specification


def lax(schema: Any, asked: bool = False) -> list[Any]:
    """Numbers of a core schema that would take `true` or a text.

    Args:
        schema: A part of it.
        asked: Whether a validator stands before it.
    """
    if isinstance(schema, list | tuple):
        return [one for part in schema for one in lax(part)]
    if not isinstance(schema, dict):
        return []
    kind = schema.get("type")
    if kind in ("int", "float") and not (asked or schema.get("strict")):
        return [schema]
    before = kind == "function-before"
    found = [
        lax(part, before and key == "schema")
        for key, part in schema.items()
        if key != "serialization"
    ]
    return [one for part in found for one in part]


@pytest.mark.parametrize("table", [Specification, RobotFile, RobotAndMore])
def test_no_number_of_a_file_is_a_switch(table: Any) -> None:
    """Of a study and of a robot: `seed = true` is not 1."""
    assert lax(table.__pydantic_core_schema__) == []
