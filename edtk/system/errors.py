"""Errors that carry what a person needs to mend the cause."""

from functools import partial
from pathlib import Path
from typing import Any


class UserError(ValueError):
    """A file or an argument that is not as it should be; the message is one line.

    `str(error)` is where, which key, and what is wrong or was expected, joined by colons. Callers
    that decide on an error use its attributes, never its text.

    Args:
        message: What is wrong or was expected.
        where: The file, or another name of the place; None where the message says it, or where
            a program built the object.
        key: The key, row or column at that place; None if the error is not about one.

    Attributes:
        message: As given.
        where: As given.
        key: As given.
    """

    def __init__(
        self, message: str, *, where: Path | str | None = None, key: str | None = None
    ) -> None:
        parts = [str(part) for part in (where, key) if part]
        super().__init__(": ".join([*parts, message]))
        self.message = message
        self.where = where
        self.key = key


class ArgumentError(UserError):
    """An argument of a call that asks for something impossible.

    The message names the argument as the call does. A command line, whose arguments are flags, has
    it named by its own name with `naming`.

    Args:
        message: What is wrong or was expected.
        argument: Name of the argument in the call.
        given: Its value; None if the message is not about the value alone.
        where: The file of the study; None where the argument alone is wrong.

    Attributes:
        argument: As given.
        given: As given.
    """

    def __init__(
        self,
        message: str,
        *,
        argument: str,
        given: object = None,
        where: Path | str | None = None,
    ) -> None:
        key = argument if given is None else f"{argument} {given}"
        super().__init__(message, where=where, key=key)
        self.argument = argument
        self.given = given

    def __reduce__(self) -> tuple[Any, ...]:
        # An exception is pickled with its text alone, on its way from a worker.
        again = partial(ArgumentError, argument=self.argument, given=self.given, where=self.where)
        return again, (self.message,)

    def naming(self, name: str) -> "ArgumentError":
        """The same error, whose message gives the argument another name."""
        return ArgumentError(self.message, argument=name, given=self.given, where=self.where)
