"""Cells of the report's tables."""

import math


def number(x: float) -> str:
    """Four digits; a dash for NaN."""
    return "-" if math.isnan(x) else f"{x:.4g}"


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:.1f} %" if share >= 0.001 else f"{100 * share:.1g} %"
