"""The information of plans in blocks, where each block has an effect of its own."""

from dataclasses import dataclass

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Scatter:
    """Information about the parameters beside the effects of blocks, which are nuisance.

    The rows X of a block of n experiments tell ``X'X - a (1'X)'(1'X)`` about the parameters, with a
    from `Limits.shares`: with a = 1/n the scatter around the mean of the block. An experiment of
    several rows has an effect of the block for each of them.

    Attributes:
        rows: Rows (n, r, p) of the candidates; not any rows of the same information, since their
            signs matter.
        limits: The blocks, and what every plan has.
    """

    rows: Array
    limits: Limits

    def information(self, places: Indices) -> Array:
        """Information (b, p, p) of plans (b, m), that of every plan included."""
        U = self.rows[places]
        M = np.einsum("bmri,bmrj->bij", U, U, optimize=True) + self.limits.base
        if not self.limits.blocks:
            return np.asarray(M)
        sums = self.sums(places)
        return np.asarray(
            M - np.einsum("k,bkri,bkrj->bij", self.limits.shares, sums, sums, optimize=True)
        )

    def sums(self, places: Indices) -> Array:
        """Sums (b, blocks, r, p) of the rows of each block."""
        starts = np.cumsum((0, *self.limits.blocks[:-1]))
        return np.asarray(np.add.reduceat(self.rows[places], starts, axis=1))

    def without(self, M: Array, places: Indices, place: int) -> tuple[Array, Array, float]:
        """Take the experiment at one place out of plans (b, m) of information M (b, p, p).

        Of a block with sum s of its other rows, and share a, a candidate U then adds
        ``(1 - a) (U - c s)' (U - c s)`` with ``c = a/(1 - a)``: its distance to the block's mean.

        Returns:
            Information (b, p, p) of the rest; the center ``c s`` (b, r, p); and ``1 - a``.
        """
        U = self.rows[places[:, place]]
        rest = M - np.swapaxes(U, -1, -2) @ U
        if not self.limits.blocks:
            return rest, np.zeros_like(U), 1.0
        block = self.limits.block_of[place]
        share = float(self.limits.shares[block])
        inside = np.flatnonzero(self.limits.block_of == block)
        whole = self.rows[places[:, inside]].sum(axis=1)
        others = whole - U
        factor = share / (1.0 - share) if share < 1.0 else 0.0
        rest = rest + share * np.swapaxes(whole, -1, -2) @ whole
        rest = rest - factor * np.swapaxes(others, -1, -2) @ others
        return rest, factor * others, 1.0 - share
