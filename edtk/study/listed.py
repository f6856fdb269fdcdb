"""A key that takes one name or several."""


def listed(value: object) -> object:
    """A single name as a list of one."""
    return (value,) if isinstance(value, str) else value
