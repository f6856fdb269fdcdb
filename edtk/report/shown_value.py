"""A criterion's value as a person reads it."""

import criteria


def shown_value(name: str, value: float, digits: int = 4) -> str:
    """A value in the criterion's unit: "0.006588 mm".

    Args:
        name: Name of the criterion.
        value: Its value, SI.
        digits: Number of digits.
    """
    factor, unit = criteria.get(name).shown
    return f"{factor * value:.{digits}g} {unit}".rstrip()
