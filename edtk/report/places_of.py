"""Digits behind the point that an uncertainty leaves meaningful."""

import math

UNKNOWN = 3  # where nothing is said of the uncertainty
MOST = 6


def places_of(std: float) -> int:
    """Digits behind the point, down to the second digit of a standard deviation."""
    if not (std > 0 and math.isfinite(std)):
        return UNKNOWN
    return min(max(1 - math.floor(math.log10(std)), 0), MOST)
