"""A text that a person writes on one line, as pydantic checks it."""

from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError


def _on_one_line(text: str) -> str:
    if not text.isprintable():
        raise PydanticCustomError("line", "expected one line, without control characters")
    return text


Line = Annotated[str, Field(max_length=200), AfterValidator(_on_one_line)]
