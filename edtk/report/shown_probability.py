"""Probabilities as a person reads them."""

LEAST = 1e-300  # below it a double has no digits left


def shown_probability(p: float, digits: int = 2) -> str:
    """Write "= 0.015", or "< 1e-300" where a double would show a zero."""
    return f"= {p:.{digits}g}" if p > LEAST else f"< {LEAST:g}"
