"""Which parameters measurements tell apart, found by a rank-revealing factorisation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.system.typing import Array, Indices

# A column, of which the others leave less than this share, moves no marker in a way of its own.
# Rounding leaves 1e-14, and the weakest ways of real sheets 1e-5 and more.
NEGLIGIBLE = 1e-8

# Shares of other parameters below this are left out of the words, not of the arithmetic.
SMALL_SHARE = 0.02
MOST_NAMED = 3  # other parameters that a sentence names


@dataclass(frozen=True, eq=False)
class Identifiable:
    """A minimal set of parameters, and how the others hang on them.

    Attributes:
        kept: Indices (rank,) of the parameters that are kept, in their order.
        left: Indices of the others, in their order.
        shares: How much of each kept parameter moves the markers as one unit of each other does
            (rank, others), both in units of the parameters.
        words: One sentence for each of the others.
    """

    kept: Indices
    left: Indices
    shares: Array
    words: tuple[str, ...]

    @property
    def rank(self) -> int:
        """Number of parameters that can be told apart."""
        return len(self.kept)


def identifiable(
    scaled: Array,
    parameters: Sequence[GeometricParameter],
    stages: Sequence[Sequence[int]] = (),
    least: float | Array = 0.0,
) -> Identifiable:
    """Choose a minimal set of parameters by QR with column pivots.

    Columns are scaled to the parameters' units and then to unit length, so that neither a metre nor
    the number of rows decides. They are taken by stages: a column of a later stage is kept only if
    no combination of earlier ones does what it does. Within a stage that with the largest part
    orthogonal to those already kept comes first (Businger and Golub 1965).

    Args:
        scaled: Regressor (rows, p) in units of the parameters.
        parameters: What the columns are (p,).
        stages: Indices by stage; the rest are the last stage.
        least: A column is kept only if what earlier ones leave of it is longer than this (or than
            its own, (p,)), in the units of the rows: shorter ones are known worse than noise /
            least units.
    """
    order = _ordered(len(parameters), stages)
    length = np.linalg.norm(scaled, axis=0)
    largest = length.max(initial=0.0)
    unit = np.divide(scaled, length, out=np.zeros_like(scaled), where=length > NEGLIGIBLE * largest)
    # The rows are compressed first: what follows is of p rows, however long the sheet is.
    remaining: Array = np.array(np.linalg.qr(unit, mode="r"))
    floor = np.maximum(NEGLIGIBLE, least / np.where(length > 0, length, 1.0))
    kept: list[int] = []
    for stage in order:
        waiting = list(stage)
        while waiting:
            sizes = np.linalg.norm(remaining[:, waiting], axis=0)
            sizes = np.where(sizes > floor[waiting], sizes, 0.0)
            best = int(np.argmax(sizes))
            if not sizes[best]:
                break
            pivot = waiting.pop(best)
            kept.append(pivot)
            direction = remaining[:, pivot] / sizes[best]
            # Twice is enough: one pass leaves rounding of the size of what it removes.
            for _ in range(2):
                remaining = remaining - np.outer(direction, direction @ remaining)
            remaining[:, pivot] = 0.0
    chosen = np.array(sorted(kept), dtype=int)
    left = np.array([i for i in range(len(parameters)) if i not in set(kept)], dtype=int)
    shares = _shares(unit, length, chosen, left)
    words = tuple(
        _words(parameters, chosen, int(one), shares[:, i], length[one] > NEGLIGIBLE * largest)
        for i, one in enumerate(left)
    )
    return Identifiable(chosen, left, shares, words)


def _ordered(p: int, stages: Sequence[Sequence[int]]) -> list[list[int]]:
    """The stages, and what is in none of them."""
    named = {i for stage in stages for i in stage}
    return [*(list(stage) for stage in stages), [i for i in range(p) if i not in named]]


def _shares(unit: Array, length: Array, kept: Indices, left: Indices) -> Array:
    """How the left columns combine the kept ones, in units of the parameters."""
    if not len(left) or not len(kept):
        return np.zeros((len(kept), len(left)))
    found = np.linalg.lstsq(unit[:, kept], unit[:, left], rcond=None)[0]
    return found * length[left] / length[kept, None]


def _words(
    parameters: Sequence[GeometricParameter],
    kept: Indices,
    left: int,
    shares: Array,
    moves: bool,
) -> str:
    """One sentence on a parameter that is not kept."""
    own = parameters[left].words
    if not moves:
        return f"{own} moves no marker in these poses"
    large = np.flatnonzero(np.abs(shares) > SMALL_SHARE * np.abs(shares).max())
    ordered = large[np.argsort(-np.abs(shares[large]), kind="stable")]
    names = [parameters[kept[i]].words for i in ordered[:MOST_NAMED]]
    more = len(ordered) - len(names)
    listed = ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]
    rest = f" (with {more} more)" if more else ""
    return f"{own} cannot be told from {listed}{rest}"
