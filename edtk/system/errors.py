"""The one error that a user's mistake ends in."""


class UserError(ValueError):
    """A mistake in a file or an argument; its message is one line: where, what, and what was expected."""
