"""The robot that a xacro file describes: its macros are expanded, and nothing of it is run.

Properties, macros, conditions, arguments at their defaults, and files from the same folder or
package are understood, in amounts that no robot exceeds. Whatever else there is, is refused.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from edtk.model.robot_from_dict import RobotFileError
from edtk.model.urdf.xacro_expression import Value, bounded, literal, value_of
from edtk.system.errors import UserError
from edtk.system.parse_xml import Element, parse_xml
from edtk.system.read_text import read_text

PACKAGE = "package.xml"  # names a folder as a package
PREFIX = "xacro:"
# What a robot is read from. Other elements are left empty: whatever they hold need not be known.
LINK = ("link", "inertial", "mass", "origin")
READ = (*LINK, "joint", "parent", "child", "axis", "limit", "mimic")
# The attributes of each element of xacro; the first one is needed.
KNOWN = {
    "if": ("value",),
    "unless": ("value",),
    "include": ("filename",),
    "insert_block": ("name",),
    "property": ("name", "value"),
    "macro": ("name", "params"),
    "arg": ("name", "default"),
}
MOST_WORK = 2_000_000  # characters that are expanded, all repetitions counted: seconds
MOST_FILES = 100
MOST_DEPTH = 40  # of macros, elements and files in each other
SUBSTITUTION = re.compile(
    r"(?P<dollars>\$\$+)(?=[{(])|\$\{(?P<expression>(?:[^}$]|\$(?!\{))*)\}|\$\((?P<word>[^)$]*)\)"
)
DEFAULT = r"\$\{[^}]*\}|\$\([^)]*\)|(?:'[^']*'|\"[^\"]*\"|[^\s'\"^])*"
PARAMETER = re.compile(rf"\s*([^\s:=]+)(?:\s*:?=\s*({DEFAULT}))?(?:\s+|$)")


@dataclass(frozen=True)
class _Macro:
    """A macro: its elements, and its parameters with their defaults; None for one without."""

    body: list[Element]
    defaults: dict[str, str | None]


@dataclass
class _Scope:
    """What names mean in the file, or in one call of a macro."""

    above: "_Scope | None" = None
    values: dict[str, Value] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)  # of properties that nobody has used yet
    blocks: dict[str, list[Element]] = field(default_factory=dict)
    macros: dict[str, _Macro] = field(default_factory=dict)

    def all(self) -> Iterator["_Scope"]:
        """This scope, and those above it."""
        scope: _Scope | None = self
        while scope is not None:
            yield scope
            scope = scope.above


def expand_xacro(path: Path, where: str) -> Element:
    """Expand a xacro file.

    Args:
        path: The file.
        where: How messages name it.

    Returns:
        The element `<robot>`, with all that a robot is read from.

    Raises:
        RobotFileError: One line: what is not understood, and in which line of which file.
    """
    expander = _Expander(path.resolve())
    try:
        return expander.robot()
    except UserError as error:
        raise RobotFileError(error.message, where=where, key=expander.place) from error
    except (ValueError, RecursionError) as error:
        message = "is nested too deeply" if isinstance(error, RecursionError) else str(error)
        message += f"; if you trust the file, expand it by ROS: `xacro {path.name} > robot.urdf`"
        raise RobotFileError(message, where=where, key=expander.place) from error


class _Expander:
    """Expands one file, and counts what has been done."""

    def __init__(self, path: Path) -> None:
        self.path = path
        packages = (folder for folder in path.parents if (folder / PACKAGE).is_file())
        self.package = next(packages, None)
        self.roots = [self.package or path.parent]
        self.files: list[Path] = []  # those that are being read, each included by the one before
        self.line = 0
        self.work = 0
        self.depth = 0
        self.included = 0
        self.arguments: dict[str, str] = {}

    @property
    def place(self) -> str | None:
        """File and line of what is being expanded."""
        name = f"{self.files[-1].name}, " if len(self.files) > 1 else ""
        return f"{name}line {self.line}" if self.line else None

    def robot(self) -> Element:
        """The whole file."""
        root = self._parsed(self.path)
        self.line = root.line
        return self._plain(root, _Scope())

    def _parsed(self, path: Path) -> Element:
        text = read_text(path)
        self._spend(len(text))
        root = parse_xml(text)
        self.files.append(path)
        return root

    def _spend(self, characters: int) -> None:
        self.work += characters
        if self.work > MOST_WORK:
            raise ValueError(f"expanding takes more than {MOST_WORK:,} characters")

    @contextmanager
    def _deeper(self) -> Iterator[None]:
        self.depth += 1
        if self.depth > MOST_DEPTH:
            raise ValueError(f"macros and elements are more than {MOST_DEPTH} deep in each other")
        yield
        self.depth -= 1

    def _all(self, elements: list[Element], scope: _Scope) -> list[Element]:
        """What elements become, one after the other."""
        found: list[Element] = []
        with self._deeper():
            for element in elements:
                self.line = element.line
                self._spend(10 + len(element.tag))
                if element.tag.startswith(PREFIX):
                    found += self._special(element, element.tag.removeprefix(PREFIX), scope)
                elif element.tag in READ:
                    found.append(self._plain(element, scope))
                else:
                    found.append(Element(element.tag, {}, element.line))
        return found

    def _plain(self, element: Element, scope: _Scope) -> Element:
        """An element with its attributes, and all in it, expanded."""
        attributes = {
            name: str(self._text(text, scope))
            for name, text in element.attributes.items()
            if not name.startswith("xmlns")
        }
        return Element(element.tag, attributes, element.line, self._all(element.children, scope))

    def _special(self, element: Element, kind: str, scope: _Scope) -> list[Element]:
        """What an element of xacro becomes."""
        if kind not in KNOWN:
            return self._call(element, kind, scope)
        given = element.attributes
        for name in given:
            if name not in KNOWN[kind]:
                raise ValueError(f"<{element.tag}> with {name[:40]!r} is not understood here")
        if KNOWN[kind][0] not in given:
            raise ValueError(f"<{element.tag}> has no {KNOWN[kind][0]}")
        if kind == "macro":
            parameters = _parameters(given.get("params", ""))
            scope.macros[given["name"]] = _Macro(element.children, parameters)
            return []
        first = self._value(given[KNOWN[kind][0]], scope)
        if kind in ("if", "unless"):
            if isinstance(first, str):
                raise ValueError(f"the condition {first[:40]!r} is neither true nor false")
            return self._all(element.children, scope) if bool(first) == (kind == "if") else []
        if kind == "include":
            return self._include(str(first), scope)
        if kind == "insert_block":
            return self._all(_block(str(first), scope), scope)
        if kind == "arg" and first not in self.arguments:
            self.arguments[str(first)] = str(self._text(given.get("default", ""), scope))
        elif kind == "property" and "value" in given:
            scope.texts[str(first)] = given["value"]
        elif kind == "property":
            scope.blocks[f"**{first}"] = element.children
        return []

    def _call(self, element: Element, name: str, scope: _Scope) -> list[Element]:
        """What a call of a macro becomes."""
        macro = next((one.macros[name] for one in scope.all() if name in one.macros), None)
        if macro is None:
            raise ValueError(f"there is no macro {name[:40]!r} before this line")
        inner = _Scope(scope)
        for key, text in element.attributes.items():
            if key not in macro.defaults:
                raise ValueError(f"the macro {name[:40]!r} has no parameter {key[:40]!r}")
            inner.values[key] = self._value(text, scope)
        # A block may have any name: a macro may ask for what it holds.
        blocks = [self._plain(block, scope) for block in element.children]
        for key, default in macro.defaults.items():
            if key.startswith("*") and blocks:
                block = blocks.pop(0)
                inner.blocks[key] = block.children if key.startswith("**") else [block]
            elif key not in inner.values:
                if default is None:
                    raise ValueError(f"the macro {name[:40]!r} needs {key[:40]!r}")
                inner.values[key] = self._value(default, scope)
        if blocks:
            raise ValueError(f"the macro {name[:40]!r} does not take all blocks of this call")
        return self._all(macro.body, inner)

    def _include(self, name: str, scope: _Scope) -> list[Element]:
        """What a file becomes, which must be below the folder of the first file or its package."""
        path = (self.files[-1].parent / name).resolve()
        if not any(path.is_relative_to(root) for root in self.roots):
            raise ValueError(f"the file {name[:100]!r} is not below the folder of this file")
        if not path.is_file():
            raise ValueError(f"there is no file {name[:100]!r} to include")
        self.included += 1
        if self.included > MOST_FILES:
            raise ValueError(f"more than {MOST_FILES} files are included")
        root = self._parsed(path)
        found = self._all(root.children, scope)
        self.files.pop()
        return found

    def _text(self, text: str, scope: _Scope) -> Value:
        """A text with its expressions evaluated; a value where it is a single one."""
        self._spend(1 + len(text))
        parts: list[Value] = []
        end = 0
        for match in SUBSTITUTION.finditer(text):
            parts += [text[end : match.start()]] if match.start() > end else []
            end = match.end()
            if match["dollars"] is not None:
                parts.append(match["dollars"][1:])
            elif match["word"] is not None:
                parts.append(self._word(match["word"].split()))
            else:
                expression = str(self._text(match["expression"], scope))
                parts.append(value_of(expression, lambda name: self._lookup(name, scope)))
        parts += [text[end:]] if end < len(text) else []
        return bounded(parts[0] if len(parts) == 1 else "".join(map(str, parts)))

    def _value(self, text: str, scope: _Scope) -> Value:
        """The value of a text, which is a number if it looks like one."""
        found = self._text(text, scope)
        return literal(found) if isinstance(found, str) else found

    def _lookup(self, name: str, scope: _Scope) -> Value:
        """The value of a property, which is evaluated when it is first used.

        Raises:
            KeyError: There is none of this name.
        """
        for one in scope.all():
            if name in one.texts:
                with self._deeper():
                    one.values[name] = self._value(one.texts[name], one)
                del one.texts[name]
            if name in one.values:
                return one.values[name]
        raise KeyError(name)

    def _word(self, words: list[str]) -> str:
        """The text of `$(arg NAME)`, `$(find NAME)` or `$(dirname)`."""
        match words:
            case ["arg", name] if name in self.arguments:
                return self.arguments[name]
            case ["find", name]:
                return str(self._package(name))
            case ["dirname"]:
                return str(self.files[-1].parent)
        raise ValueError(f"$({' '.join(words)[:60]}) is not understood, or has no default")

    def _package(self, name: str) -> Path:
        """The folder of the package that holds the file, or of one beside it."""
        if self.package is not None and re.fullmatch(r"[\w-]+", name):
            folder = self.package if name == self.package.name else self.package.parent / name
            if (folder / PACKAGE).is_file():
                self.roots.append(folder.resolve())
                return folder
        raise ValueError(f"no package {name[:40]!r} holds the file, or is beside the one that does")


def _block(name: str, scope: _Scope) -> list[Element]:
    """The elements of a block."""
    for key in (f"**{name}", f"*{name}"):
        for one in scope.all():
            if key in one.blocks:
                return one.blocks[key]
    raise ValueError(f"there is no block {name[:40]!r}")


def _parameters(text: str) -> dict[str, str | None]:
    """Names of a macro's parameters, and the text of each default."""
    found: dict[str, str | None] = {}
    end = 0
    text = str(bounded(text.rstrip()))
    while end < len(text):
        match = PARAMETER.match(text, end)
        if match is None:
            raise ValueError(f"the parameters {text[end : end + 40]!r} are not understood here")
        found[match[1]] = match[2]
        end = match.end()
    return found
