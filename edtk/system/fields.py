"""Tables and values of a file as pydantic checks them, and what it found wrong, in words."""

import difflib
import reprlib
from typing import Annotated, Any, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
)
from pydantic_core import PydanticCustomError, PydanticKnownError

# A kilometre in millimetres, a hundred tonnes in newtons. Fourth powers of such numbers over the
# least sigma, and their products over all parameters, are still far from an overflow.
LARGEST = 1e6
BOUNDS = (
    ("greater_than_equal", "ge", "at least"),
    ("less_than_equal", "le", "at most"),
)
LONGEST_LIST = 150  # characters of a list of keys, which would lose its middle in a longer line
NEAREST = 3  # keys that are told instead
GENERAL = "Input should"  # beginning of pydantic's own sentences
UNKNOWN = "extra_forbidden"
LIST = "Input should be a valid tuple"  # a word of Python, which no file has


# Neither texts nor `true`, which is 1 to Python.
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Vector3 = tuple[Finite, Finite, Finite]
ZERO: Vector3 = (0.0, 0.0, 0.0)

# Squares of smaller numbers underflow.
Positive = Annotated[Finite, Field(ge=1e-12)]

NotNegative = Annotated[Finite, Field(ge=0)]

# No instrument measures better than a picometre, and squares of smaller numbers underflow.
Sigma = Annotated[Finite, Field(ge=1e-9)]

# Compliances beyond these bounds [rad/(N m)] are slips of the pen.
Compliance = Annotated[Finite, Field(ge=1e-15, le=1e3)]


def _no_switch(value: object) -> object:
    """Neither texts nor `true`; 1e4 is a whole number."""
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return value


Whole = Annotated[int, BeforeValidator(_no_switch)]

# Each one takes memory, and some of them time.
Count = Annotated[Whole, Field(ge=1, le=int(LARGEST))]


def _on_one_line(text: str) -> str:
    if not text.isprintable():
        raise PydanticCustomError("line", "expected one line, without control characters")
    return text


Line = Annotated[str, Field(max_length=200), AfterValidator(_on_one_line)]


class Table(BaseModel):
    """A table of keys: unknown keys are rejected, and values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def listed(value: object) -> object:
    """A single name as a list of one."""
    return (value,) if isinstance(value, str) else value


def first_error(error: ValidationError, model: type[BaseModel]) -> tuple[str, str]:
    """The key of the first error, and what was expected there.

    Args:
        error: Of the validation of a model.
        model: The model, whose fields are described.

    All keys that are missing are said at once, which is an error of no single key.

    Returns:
        The key, as `joints.0.axis`, and one sentence: the rule, the value that breaks it, and what
        the key means.
    """
    first = error.errors()[0]
    location = first["loc"]
    key = _key(location)
    meaning, table = _described(model, location)
    if first["type"] == UNKNOWN:
        return key, _unknown(str(location[-1]), list(table.model_fields))
    if first["type"] == "missing":
        if isinstance(location[-1], int):  # the next entry of a list that is too short
            whole = key.rpartition(".")[0]
            number = f"{location[-1]} entr{'y' if location[-1] == 1 else 'ies'}"
            beside = (one["loc"] for one in error.errors() if one["loc"][:-1] == location[:-1])
            expected = 1 + max(int(place[-1]) for place in beside)
            also = meaning and f"; it is: {meaning}"
            return whole, f"has {number}; expected {expected}{also}"
        all_missing = (one["loc"] for one in error.errors() if one["type"] == "missing")
        missing = [_key(place) for place in all_missing if isinstance(place[-1], str)]
        unknown = [_key(one["loc"]) for one in error.errors() if one["type"] == UNKNOWN]
        also = f"; there is no key {', '.join(unknown)}" if unknown else ""
        if len(missing) > 1:
            return "", f"these keys are required: {', '.join(missing)}{also}"
        return key, f"this key is required{meaning and f': {meaning}'}{also}"
    if first["type"] == "too_long":
        number = first["ctx"]["max_length"]
        return key, f"has {first['ctx']['actual_length']} entries; expected {number} at most"
    is_table = isinstance(first["input"], dict | BaseModel)
    given = "" if is_table else f" (got {_shown(first['input'])})"
    rule = first["msg"].replace(LIST, "expected a list")
    if not first["msg"].startswith(GENERAL):  # a rule of the model's own says all
        return key, f"{rule}{given}"
    for kind, sign, words in BOUNDS:
        if first["type"] == kind:
            rule = f"expected {words} {first['ctx'][sign]:g}"  # pydantic writes 0.000000000001
    return key, f"{rule}{given}{meaning and f'; it is: {meaning}'}"


def _key(location: tuple[int | str, ...]) -> str:
    """A location as a file's keys name it."""
    # A part that begins with a colon tells which form of a value was tried; no key does.
    return ".".join(str(part) for part in location if not str(part).startswith(":"))


def _unknown(key: str, known: list[str]) -> str:
    """What keys there are, or where they are many, the ones that may have been meant."""
    listed = ", ".join(known)
    if len(listed) <= LONGEST_LIST:
        return f"unknown key; known are {listed}"
    near = difflib.get_close_matches(key, known, NEAREST, cutoff=0.0)
    return f"unknown key; of {len(known)} keys the nearest are {', '.join(near)}"


def _described(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> tuple[str, type[BaseModel]]:
    """The description of the field at a location, and the innermost table there."""
    meaning = ""
    for part in location:
        field = model.model_fields.get(str(part))
        if field is None:  # an entry of a list, or a name that the user chose
            continue
        meaning = field.description or ""
        model = _table_in(field.annotation) or model
    return meaning, model


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table that a field holds, by itself or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_table_in, get_args(annotation))), None)


def _shown(value: object) -> str:
    """A value as it was given; one of millions of entries or digits only in part."""
    return reprlib.repr(value) if isinstance(value, list | tuple | int) else repr(value)
