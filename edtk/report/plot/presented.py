"""The picture of a result that has none."""

from typing import Any, NoReturn

from edtk.system.presented import Presented


def presented(result: Presented, ax: Any = None, **options: Any) -> NoReturn:
    """Refuse: such a result has no picture.

    Raises:
        TypeError: Always.
    """
    raise TypeError(f"a {type(result).__name__} has no picture")
