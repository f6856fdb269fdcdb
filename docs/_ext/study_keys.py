"""The directive `study-keys`: tables of all keys of a study or robot file, read off the schema."""

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic_core import PydanticUndefined
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles


class StudyKeys(SphinxDirective):
    """Write one section for each table of the schema, with its keys, defaults and meanings.

    Its argument "robot" stands for the keys of a robot file.
    """

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the generated text in the place of the directive."""
        from edtk.robots.robot_file import RobotFile
        from edtk.study.schema import Specification

        table = RobotFile if self.arguments == ["robot"] else Specification
        lines: list[str] = []
        _describe(table, "", lines)
        section = nodes.section()
        section.document = self.state.document
        content = StringList(lines, source=table.__module__)
        nested_parse_with_titles(self.state, content, section)
        return list(section.children)


def _describe(table: type[BaseModel], path: str, lines: list[str]) -> None:
    """Add the keys of one table, then its tables."""
    title = f"`[{path}]`" if path else "Top level"
    lines += [f"## {title}", "", (table.__doc__ or "").strip(), ""]
    lines += ["| key | default | meaning |", "|---|---|---|"]
    inner: list[tuple[str, type[BaseModel]]] = []
    for key, field in table.model_fields.items():
        below = _tables(field.annotation)
        inner += [(f"{path}.{key}".lstrip("."), part) for part in below]
        default = "required" if field.is_required() else _default(field.default)
        lines.append(f"| `{key}` | {default} | {field.description or ''} |")
    lines.append("")
    for name, part in inner:
        _describe(part, name, lines)


def _tables(annotation: Any) -> list[type[BaseModel]]:
    """Tables among the types that a key may have."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    parts = getattr(annotation, "__args__", ())
    return [table for part in parts for table in _tables(part)]


def _default(value: Any) -> str:
    """A default as a person reads it."""
    if value is None or value is PydanticUndefined:
        return "none"
    if isinstance(value, BaseModel):
        return "see below"
    if isinstance(value, str | tuple | dict) and not value:
        return "empty"
    text = str(list(value) if isinstance(value, tuple) else value)
    return f"`{text}`"


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("study-keys", StudyKeys)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
