"""Xacro files, expanded by a small grammar of numbers, names and macros that runs no code.

The grammar: numbers, texts in quotes, names, arithmetic, comparisons, `and`, `or`, `not`,
`a if b else c`, and calls of the functions below. Whatever else a syntax tree holds is refused.

Properties, macros, conditions, arguments at their defaults, and files from the same folder or
package are understood, in amounts that no robot exceeds. Whatever else there is, is refused.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from edtk.robots.robot_file import RobotFileError
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.parsing import Element, parse_xml

MOST_CHARACTERS = 300  # of an expression
MOST_TEXT = 2000  # characters of a value
LARGEST = 1e15  # size of a number, up to which whole numbers are exact
DIGITS = 16  # before the point, where any number rounds to zero; Python computes 10 to their power
MODULES = ("math", "python")  # which newer files name before a function
OF_NUMBERS = "sin cos tan asin acos atan atan2 sqrt hypot exp log radians degrees floor ceil fabs"
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
DEFAULT = r"\$\{[^}]*\}|\$\([^)]*\)|(?:'[^']*'|\"[^\"]*\"|[^\s'\"^])*"


Value = int | float | str  # truth values are numbers
LETTERS = re.compile(r"[\w\s.+\-*/%()<>=!,'\"]*", re.ASCII)
NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*", re.ASCII | re.IGNORECASE)
CONSTANTS: dict[str, Value] = {"pi": math.pi, "e": math.e}
FUNCTIONS: dict[str, Callable[..., Value]] = {
    **{name: getattr(math, name) for name in OF_NUMBERS.split()},
    "abs": abs,
    "min": min,
    "max": max,
    "round": lambda value, digits=None: round(
        value, None if digits is None else max(digits, -DIGITS)
    ),
    "int": int,
    "float": float,
    "str": str,
    "bool": bool,
}


def _power(base: float, exponent: float) -> Value:
    """A power by floating point: one of whole numbers would have any number of digits."""
    power = math.pow(base, exponent)
    is_whole = isinstance(base, int) and isinstance(exponent, int) and exponent >= 0
    return round(power) if is_whole and abs(power) <= LARGEST else power


OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: _power,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
OF_TEXTS = (ast.Add, ast.Eq, ast.NotEq, ast.Not)  # `%` and `*` of texts may make huge ones


def value_of(expression: str, lookup: Callable[[str], Value]) -> Value:
    """The value of an expression.

    Args:
        expression: Its text, without the brackets.
        lookup: The value of a property; raises KeyError where there is none.

    Raises:
        ValueError: The expression is none of this grammar, or has no value; one line.
    """
    shown = f"${{{expression.strip()[:60]}}}"
    if len(expression) > MOST_CHARACTERS or not LETTERS.fullmatch(expression):
        raise ValueError(f"{shown} is longer, or has other signs, than is understood here")
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(" ".join(expression.split()), mode="eval")
        return _value(tree.body, lookup)
    except KeyError as error:
        raise ValueError(f"{str(error.args[0])[:60]!r} is not defined, in {shown}") from error
    except (SyntaxError, TypeError, ArithmeticError, ValueError, MemoryError) as error:
        words = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ValueError(f"{shown} cannot be evaluated: {words[:100]}") from error


def bounded(value: Value) -> Value:
    """A value of a size that no file of a robot exceeds.

    Raises:
        ValueError: It is larger, or no finite number.
    """
    if isinstance(value, str) and len(value) > MOST_TEXT:
        raise ValueError(f"a text is longer than {MOST_TEXT} characters")
    if not isinstance(value, str) and not abs(value) <= LARGEST:
        raise ValueError(f"a number is not finite, or larger than {LARGEST:g}")
    return value


def literal(text: str) -> Value:
    """What a text stands for: a number, a truth value, a text in quotes, or itself."""
    if len(text) >= 2 and text[0] == text[-1] == "'":
        return text[1:-1]
    if NUMBER.fullmatch(text):
        return bounded(int(text) if text.strip().lstrip("+-").isdigit() else float(text))
    return {"true": True, "True": True, "false": False, "False": False}.get(text, text)


def _value(node: ast.expr, lookup: Callable[[str], Value]) -> Value:
    """The value of a part of a syntax tree; only what is listed here has one."""

    def of(part: ast.expr) -> Value:
        return _value(part, lookup)

    match node:
        case ast.Constant(value=int() | float() | str() as constant):
            return bounded(constant)
        case ast.Name(id=name):
            try:
                return lookup(name)
            except KeyError:
                return CONSTANTS[name]
        case ast.Attribute(value=ast.Name(id=module), attr=name) if module in MODULES:
            return CONSTANTS[name]
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]):
            return bounded(FUNCTIONS[name](*map(of, given)))
        case ast.Call(
            func=ast.Attribute(value=ast.Name(id=module), attr=name), args=given, keywords=[]
        ) if module in MODULES:
            return bounded(FUNCTIONS[name](*map(of, given)))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return of(body) if of(test) else of(orelse)
        case ast.BoolOp(op=sign, values=[*first, last]):
            for part in first:
                value = of(part)
                if bool(value) == isinstance(sign, ast.Or):
                    return value
            return of(last)
        case ast.UnaryOp(op=sign, operand=operand):
            return _operated(sign, of(operand))
        case ast.BinOp(left=left, op=sign, right=right):
            return _operated(sign, of(left), of(right))
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            return _operated(sign, of(left), of(right))
    raise ValueError(f"{type(node).__name__} is not understood here")


def _operated(sign: ast.AST, *given: Value) -> Value:
    """An operation on numbers, or one of those on texts."""
    kinds = {isinstance(value, str) for value in given}
    if type(sign) not in OPERATIONS or (kinds != {False} and not isinstance(sign, OF_TEXTS)):
        raise ValueError(f"{type(sign).__name__} of these values is not understood here")
    return bounded(OPERATIONS[type(sign)](*given))


SUBSTITUTION = re.compile(
    r"(?P<dollars>(?<!\$)\$\$++)(?=[{(])|\$\{(?P<expression>(?:[^}$]|\$(?!\{))*)\}|\$\((?P<word>[^)$]*)\)"
)
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
