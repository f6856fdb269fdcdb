"""A result that has no table of its own, for a notebook."""

from html import escape

from edtk.system.presented import Presented


def presented(result: Presented) -> str:
    """The headline, and the text for terminals in a fixed-width font."""
    return f"<p><b>{escape(result.headline())}</b></p>\n<pre>{escape(result.summary())}</pre>"
