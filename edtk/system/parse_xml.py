"""The content of XML text that nobody is trusted to have written."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from edtk.system.errors import UserError

MOST_ELEMENTS = 200_000  # a robot with all its meshes has some thousand
MOST_DEPTH = 100


@dataclass
class Element:
    """An element of XML; its text is left out.

    Attributes:
        tag: Its name, with any prefix.
        attributes: Its attributes, as texts.
        line: The line in which it begins.
        children: The elements in it, in their order.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["Element"]:
        """The children of one name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> "Element | None":
        """The first child of one name, None where there is none."""
        return next(iter(self.all(tag)), None)

    def everything(self) -> Iterator["Element"]:
        """This element and all elements in it."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)


def parse_xml(text: str, where: Path | str | None = None) -> Element:
    """Read the elements and attributes of XML in bounded time, memory and depth.

    A document type is refused: with its entities, few lines can stand for gigabytes or for files.
    Prefixes of names are kept as they are, declared or not.

    Args:
        text: The text.
        where: The file, for messages.

    Returns:
        The root element.

    Raises:
        UserError: The text is not valid XML, or too large; names the line.
    """
    builder = _Builder(where)
    try:
        builder.parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        message = f"not valid XML: {reason} (at line {error.lineno}, column {error.offset + 1})"
        raise UserError(message, where=where) from error
    except ValueError as error:  # a lone half of a surrogate pair is no text that can be parsed
        if isinstance(error, UserError):
            raise
        raise UserError("not valid XML: no text in UTF-8", where=where) from error
    return builder.root.children[0]


class _Builder:
    """Collects the elements while the parser reads."""

    def __init__(self, where: Path | str | None) -> None:
        self.where = where
        self.root = Element("", {}, 0)
        self.open = [self.root]
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MOST_ELEMENTS:
            raise UserError(f"has more than {MOST_ELEMENTS:,} elements", where=self.where)
        if len(self.open) > MOST_DEPTH:
            message = f"elements are nested more than {MOST_DEPTH} deep"
            raise UserError(f"{message} (at line {self._line})", where=self.where)
        element = Element(tag, attributes, self._line)
        self.open[-1].children.append(element)
        self.open.append(element)

    def _end(self, tag: str) -> None:
        self.open.pop()

    def _doctype(self, *declared: object) -> None:
        message = f"has a DOCTYPE (at line {self._line}); expected plain XML without one"
        raise UserError(message, where=self.where)

    @property
    def _line(self) -> int:
        return self.parser.CurrentLineNumber
