"""Columns of a frame, combined with constant weights."""

from edtk.system.typing import Array

# Entries of a constant rotation that are this close to zero are the rounding of a right angle.
ROUNDING = 1e-15


def combine(columns: list[Array], weights: Array) -> Array | float:
    """Linear combination of frame columns (3, ...) with constant weights (3,), zeros skipped."""
    total: Array | float = 0.0
    for column, weight in zip(columns, weights, strict=True):
        if abs(weight) > ROUNDING:
            total = total + (column if weight == 1.0 else weight * column)
    return total
