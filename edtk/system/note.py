"""Something that was assumed, which a person should know although nothing is wrong."""

import warnings
from pathlib import Path

from edtk.system.errors import UserError


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
