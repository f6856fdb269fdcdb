"""Text of a result that has no text of its own."""

from edtk.system.presented import Presented


def presented(result: Presented) -> str:
    """The headline alone."""
    return result.headline()
