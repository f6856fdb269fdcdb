"""The value of an expression in a xacro file. Python parses it, and nothing of it is run.

The grammar: numbers, texts in quotes, names, arithmetic, comparisons, `and`, `or`, `not`,
`a if b else c`, and calls of the functions below. Whatever else a syntax tree holds is refused.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable
from typing import Any

Value = int | float | str  # truth values are numbers
MOST_CHARACTERS = 300  # of an expression
MOST_TEXT = 2000  # characters of a value
LARGEST = 1e15  # size of a number, up to which whole numbers are exact
LETTERS = re.compile(r"[\w\s.+\-*/%()<>=!,'\"]*", re.ASCII)
NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*", re.ASCII | re.IGNORECASE)
MODULES = ("math", "python")  # which newer files name before a function
CONSTANTS: dict[str, Value] = {"pi": math.pi, "e": math.e}
OF_NUMBERS = "sin cos tan asin acos atan atan2 sqrt hypot exp log radians degrees floor ceil fabs"
FUNCTIONS: dict[str, Callable[..., Value]] = {
    **{name: getattr(math, name) for name in OF_NUMBERS.split()},
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
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
