"""The error of a search for a plan that cannot be."""


class NoPlanError(ValueError):
    """There is no such plan; the message is the reason."""
