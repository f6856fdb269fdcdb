"""Numbers with as many digits as their uncertainty leaves meaningful."""

import math


def digits(value: float, std: float) -> str:
    """The value down to the second digit of its standard deviation, and to three digits at least: 4.0005e-07."""
    ratio = abs(value) / std if std > 0 else 1.0
    places = (
        2 if not math.isfinite(ratio) or ratio <= 0 else max(2, math.floor(math.log10(ratio)) + 2)
    )
    return f"{value:.{min(places, 15)}e}"
