"""A look at all candidates of a problem, for all places of a plan at once."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from edtk.design.packed import pack, sensitivity_rows
from edtk.system.typing import Array, Indices, Mask

SingleArray = NDArray[np.float32]

AT_ONCE = 2000  # candidates whose matrices are formed together
KEPT = 1_000_000_000  # bytes of packed matrices that are kept from one look to the next
PLACES = 64  # of a plan, whose sensitivities are there together
UNIT = 2.0**-24  # rounding of a number of single precision


class FullLook:
    """Sensitivities ``<Z, U'U>`` of all candidates in single precision, with what that may cost.

    A product of matrices ``U'U``, packed, with many Z costs about as much as one pass over the rows
    for a single Z in doubles. Of K terms, each rounded twice before they are multiplied and summed
    in any order, it errs by at most ``g |U'U| |Z|`` (Frobenius) with ``g = (K + 2) u / (1 - (K + 2)
    u)`` (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).

    Args:
        rows: Rows (n, r, p) of the candidates.
    """

    def __init__(self, rows: Array) -> None:
        self.rows = rows
        n, _, p = rows.shape
        terms = p * (p + 1) // 2
        self.gamma = (terms + 2) * UNIT / (1.0 - (terms + 2) * UNIT)
        self.sizes = np.empty(n)
        self._kept: list[SingleArray] | None = [] if 4 * n * terms <= KEPT else None
        for part, packed in self._formed():
            self.sizes[part] = np.sqrt(np.einsum("ij,ij->j", packed, packed, dtype=float))
            if self._kept is not None:
                self._kept.append(packed)

    def _formed(self) -> Iterator[tuple[slice, SingleArray]]:
        """Candidates, and their matrices ``U'U`` packed (p(p+1)/2, k) with norms as they were."""
        scale = self._scale
        for first in range(0, len(self.rows), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            U = self.rows[part]
            packed = scale[:, None] * pack(np.swapaxes(U, 1, 2) @ U)
            yield part, packed.astype(np.float32)

    def _parts(self) -> Iterator[tuple[slice, SingleArray]]:
        """The same, kept or formed anew."""
        if self._kept is None:
            yield from self._formed()
            return
        for first, packed in zip(range(0, len(self.rows), AT_ONCE), self._kept, strict=True):
            yield slice(first, first + AT_ONCE), packed

    @property
    def _scale(self) -> Array:
        """Factors of the entries, roots of two off the diagonal: products are then those of <,>."""
        return np.sqrt(sensitivity_rows(np.ones((self.rows.shape[2],) * 2)))

    def sensitivities(self, Z: Array) -> Iterator[tuple[int, SingleArray, float]]:
        """Sensitivities to symmetric Z (m, p, p), a few Z at a time.

        Yields:
            The number of a Z, the sensitivities (n,), and by how much one of a candidate with
            ``|U'U| = 1`` may be wrong: see `sizes`.
        """
        slopes = (sensitivity_rows(Z) / self._scale).astype(np.float32)
        for first in range(0, len(Z), PLACES):
            some = slopes[first : first + PLACES]
            found = np.empty((len(some), len(self.rows)), dtype=np.float32)
            for part, packed in self._parts():
                np.matmul(some, packed, out=found[:, part])
            for i, own in enumerate(found, start=first):
                yield i, own, self.gamma * float(np.linalg.norm(Z[i]))

    def largest(self, Z: Array, number: int, allowed: list[Mask] | None = None) -> Indices:
        """Candidates of the largest sensitivities to any of Z (m, p, p), so many for each of them.

        Args:
            Z: Multipliers.
            number: How many.
            allowed: Which candidates count (n,), for each Z; None for all.
        """
        chosen = []
        for i, found, _ in self.sensitivities(Z):
            if allowed is not None:
                found[~allowed[i]] = -np.inf
            best = np.argpartition(-found, number)[:number] if number < len(found) else None
            chosen.append(np.arange(len(found)) if best is None else best)
        return np.unique(np.concatenate(chosen))
