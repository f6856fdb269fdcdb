"""The picture of a result that has none."""

from typing import Any, NoReturn

from edtk.system.presented import Presented


def presented(result: Presented, ax: Any = None, **options: Any) -> NoReturn:
    """Say that there is no picture.

    Raises:
        TypeError: Always.
    """
    raise TypeError(f"there is no picture of a {type(result).__name__}")
