"""Numbers with as many digits as their uncertainty leaves meaningful."""

import math

LEAST_PLACES = 2  # behind the point: three digits
MOST_PLACES = 15  # a double has no more


def digits(value: float, std: float) -> str:
    """Write a value down to the second digit of its standard deviation: 4.0005e-07.

    It has three digits at least.
    """
    ratio = abs(value) / std if std > 0 else 1.0
    places = LEAST_PLACES
    if math.isfinite(ratio) and ratio > 0:
        places = max(LEAST_PLACES, math.floor(math.log10(ratio)) + 2)
    return f"{value:.{min(places, MOST_PLACES)}e}"
