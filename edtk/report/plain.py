"""Text of a user, as a picture shows it."""


def plain(text: str) -> str:
    """A name or title in which matplotlib finds no formula: between two dollars it looks for one.

    Every text that a study, a file's name or a plug-in may hold goes through here on its way into
    a picture.
    """
    return text.replace("$", r"\$")
