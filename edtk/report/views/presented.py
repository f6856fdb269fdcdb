"""Results that have no view of their own."""

from html import escape
from typing import Any, NoReturn

from edtk.system.presented import Presented


def presented_text(result: Presented) -> str:
    """The headline alone."""
    return result.headline()


def presented_notebook(result: Presented) -> str:
    """The headline, and what else the text for terminals says in a fixed-width font."""
    head, text = result.headline(), result.summary()
    rest = "" if text == head else f"\n<pre>{escape(text)}</pre>"
    return f"<p><b>{escape(head)}</b></p>{rest}"


def presented_plot(result: Presented, ax: Any = None, **options: Any) -> NoReturn:
    """Refuse: such a result has no picture.

    Raises:
        TypeError: Always.
    """
    raise TypeError(f"a {type(result).__name__} has no picture")


def presented_show(result: Presented, *arguments: Any, **options: Any) -> NoReturn:
    """Refuse: such a result has no poses.

    Raises:
        TypeError: Always.
    """
    raise TypeError(f"a {type(result).__name__} has no poses to show")
