"""Errors that carry what a person needs to mend the cause."""

from pathlib import Path


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
