"""How likely it is that so many coordinates are outside their bands."""

OUTSIDE = 0.05  # share of coordinates outside 95 % bands


def chance_of_outside(share: float, number: float) -> float:
    """Probability that of so many independent coordinates such a share or more is outside.

    It is the binomial tail ``I_0.05(x, n - x + 1)``, by the incomplete beta function for numbers
    that are no integers.

    Args:
        share: Share outside their 95 % bands.
        number: Number of independent coordinates.
    """
    from scipy.special import betainc

    count = share * number
    if count <= OUTSIDE * number:
        return 1.0
    return float(betainc(count, number - count + 1, OUTSIDE))
