"""Columns of a frame, combined with constant weights."""

from collections.abc import Sequence

from edtk.system.typing import Array

# Entries of a constant rotation that are this close to zero are the rounding of a right angle.
ROUNDING = 1e-15

Terms = tuple[tuple[int, float], ...]  # numbers of columns, and the weights that are not zero


def combine(columns: Sequence[Array], weights: Array) -> Array | float:
    """Linear combination of frame columns (3, ...) with constant weights (3,), zeros skipped."""
    terms = terms_of(weights)
    return 0.0 + combine_terms(columns, terms) if terms else 0.0


def terms_of(weights: Array) -> Terms:
    """What of constant weights (3,) counts in a linear combination."""
    return tuple((k, float(w)) for k, w in enumerate(weights) if abs(w) > ROUNDING)


def combine_terms(columns: Sequence[Array], terms: Terms) -> Array:
    """Linear combination of frame columns (3, ...), of one term at least.

    A single column of weight one is returned as it is, and not as a copy.
    """
    total: Array | None = None
    for k, weight in terms:
        term = columns[k] if weight == 1.0 else weight * columns[k]
        total = term if total is None else total + term
    assert total is not None
    return total
