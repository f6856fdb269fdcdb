"""Errors and remarks that carry what a person needs to mend the cause, on one line."""

import re
import sys
import warnings
from functools import partial
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from edtk.system.typing import Array

LONGEST = 300  # characters of a line on standard error
PROGRAM = 10  # of them for the program's name, which an error does not know
WHERE = 90  # characters of a path, in a line that is too long
KEY = 60  # characters of a key
QUOTATION = 60  # characters of a quoted value
NO_NUMBERS = "SUMmc"  # kinds of arrays that are texts, dates, times and complex numbers
LARGEST_NUMBER = 1e150  # of numbers that a call may be given: their squares are numbers, too
MOST_SEARCHED = 4000  # a longer text is cut before the search for quotations, which takes time


QUOTED = re.compile(r"""(?<!\w)(['"]).*?\1(?!\w)""")  # an apostrophe in a word is no quote


def shortened(text: str, most: int = LONGEST) -> str:
    """Make one line of limited length of a text that may repeat anything that a file holds.

    Control characters and line breaks are shown escaped. A text that is too long loses the middle
    of its quotations and, where that is not enough, its own middle: it begins with what is wrong,
    and often ends with what was expected.

    Args:
        text: The text.
        most: Characters that the line may have.
    """
    text = _without_middle(_escaped(_without_middle(text, MOST_SEARCHED)), MOST_SEARCHED)
    if len(text) > most:
        text = QUOTED.sub(lambda found: _without_middle(found[0], QUOTATION), text)
    return _without_middle(text, most)


def _without_middle(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    kept = most - len("...")
    end = kept // 2
    return f"{text[: kept - end]}...{text[-end:]}"


def _without_beginning(text: str, most: int) -> str:
    """A path that is too long differs from others at its end."""
    return text if len(text) <= most else f"...{text[len('...') - most :]}"


def _escaped(text: str) -> str:
    """A text with escapes in place of control characters, line breaks and invisible signs."""
    if text.isprintable():
        return text
    signs = (s if s.isprintable() else s.encode("unicode_escape").decode() for s in text)
    return "".join(signs)


def _line(where: object, key: object, message: str) -> str:
    """Where, key and message, joined by colons on one line."""
    most = LONGEST - PROGRAM
    place = "" if not where else _escaped(str(where))
    name = "" if not key else _escaped(_without_middle(str(key), MOST_SEARCHED))
    whole = ": ".join(filter(None, (place, name, _escaped(message[: most + 1]))))
    if len(whole) > most:
        place = _without_beginning(place, WHERE)
        name = _without_middle(name, KEY)
    before = "".join(f"{part}: " for part in (place, name) if part)
    return before + shortened(message, most - len(before))


class UserError(ValueError):
    """A file or an argument that is not as it should be; the message is one line.

    `str(error)` is where, which key, and what is wrong or was expected, joined by colons. It is
    one line of at most 290 characters, whatever it repeats: this is the one place that shortens.
    Callers that decide on an error use its attributes, never its text.

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
        super().__init__(_line(where, key, message))
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


class Note(UserWarning):
    """A remark to the user; its text is one line. Programs filter it like any warning."""


def note(message: str, where: Path | str) -> None:
    """Tell the user.

    Args:
        message: What was assumed.
        where: The file that it was assumed of.
    """
    # As an error would say it: where first, of limited length.
    warnings.warn(Note(str(UserError(message, where=where))), stacklevel=2)


def whole_number(given: object, argument: str, least: int) -> int:
    """The argument as a whole number that is not too small.

    Args:
        given: What the caller gave.
        argument: Name of the argument.
        least: The least number that makes sense.

    Raises:
        ArgumentError: It is not such a number.
    """
    message = f"expected a whole number, {least} or more"
    try:
        number = index(given)  # type: ignore[arg-type]
    except TypeError as error:
        raise ArgumentError(message, argument=argument, given=given) from error
    if number < least:
        raise ArgumentError(message, argument=argument, given=given)
    if number > sys.float_info.max:
        raise ArgumentError("expected a smaller number", argument=argument, given=given)
    return number


def real_numbers(given: object, argument: str) -> "Array":
    """The argument as an array of numbers of any shape, finite or not.

    Texts, dates and a single switch are none, though numpy can make numbers of them.

    Raises:
        ArgumentError: It is none.
    """
    import numpy as np  # commands that read no numbers start without it

    try:
        found = np.asarray(given)
        is_text = found.dtype.kind == "O" and any(isinstance(one, str) for one in found.flat)
        is_switch = found.dtype.kind == "b" and not found.ndim
        if found.dtype.kind in NO_NUMBERS or is_text or is_switch:
            raise TypeError(f"{found.dtype} is no kind of numbers")
        return found.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError("expected numbers", argument=argument) from error


def finite_numbers(given: object, argument: str) -> "Array":
    """The argument as an array of finite numbers of any shape, whose squares are finite, too.

    Raises:
        ArgumentError: It is none.
    """
    import numpy as np

    found = real_numbers(given, argument)
    if not (np.abs(found) <= LARGEST_NUMBER).all():
        message = f"expected finite numbers, at most {LARGEST_NUMBER:g}"
        raise ArgumentError(message, argument=argument)
    return found
