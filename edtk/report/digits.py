"""Numbers with as many digits as their uncertainty leaves meaningful."""

import math

LEAST_PLACES = 2  # behind the point: three digits
MOST_PLACES = 15  # a double has no more


def digits(value: float, std: float, like: float | None = None) -> str:
    """Write a value down to the second digit of its standard deviation: 4.0005e-07.

    It has three digits at least.

    Args:
        value: The value.
        std: Its standard deviation.
        like: A value that it is compared with; it then has the digits of that one, if both are of
            the same decade.
    """
    other = value if like is None or _decade(like) != _decade(value) else like
    ratio = abs(other) / std if std > 0 else 1.0
    places = LEAST_PLACES
    if math.isfinite(ratio) and ratio > 0:
        places = max(LEAST_PLACES, math.floor(math.log10(ratio)) + 2)
    return f"{value:.{min(places, MOST_PLACES)}e}"


def _decade(value: float) -> int | None:
    """The power of ten with which a value is written."""
    return math.floor(math.log10(abs(value))) if value and math.isfinite(value) else None
