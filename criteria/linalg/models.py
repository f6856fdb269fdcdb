"""Where the parameters of several models stand in a block diagonal matrix."""

from functools import cache, cached_property

import numpy as np

from criteria.linalg.typing import Array, Indices, Mask


class Models:
    """The places of k models in ``diag(M_1, .., M_k)``.

    A sum over models never needs the zeros beside the blocks: of k blocks of order s there are
    ``k s^2`` entries, and ``k^2 s^2`` of the whole.

    Args:
        sizes: Number of parameters of each model.
    """

    def __init__(self, sizes: tuple[int, ...]) -> None:
        self.sizes = sizes
        ends = np.cumsum(sizes)
        self.parts = tuple(
            slice(int(end) - size, int(end)) for size, end in zip(sizes, ends, strict=True)
        )

    @classmethod
    @cache
    def single(cls, p: int) -> "Models":
        """The places of one model of p parameters."""
        return cls((p,))

    @property
    def p(self) -> int:
        """Number of parameters of all models together."""
        return self.parts[-1].stop

    def __len__(self) -> int:
        """Number of models."""
        return len(self.sizes)

    def places(self, models: Indices) -> Indices:
        """The parameters (g, s) of some models (g,), which have as many each."""
        starts = np.array([self.parts[j].start for j in models])
        return np.asarray(starts[:, None] + np.arange(self.sizes[models[0]]))

    @cached_property
    def entries(self) -> tuple[Indices, Indices]:
        """Rows and columns (q,) of all entries of all blocks, block by block."""
        inside = [np.indices((size, size)).reshape(2, -1) for size in self.sizes]
        found = [part.start + each for part, each in zip(self.parts, inside, strict=True)]
        rows, columns = np.concatenate(found, axis=1)
        return rows, columns

    @cached_property
    def triangles(self) -> tuple[Indices, Indices]:
        """Rows and columns (q,) of the upper triangles of all blocks, block by block."""
        rows, columns = self.entries
        return rows[rows <= columns], columns[rows <= columns]

    @cached_property
    def outside(self) -> Mask:
        """The entries (p, p) of no block."""
        found = np.ones((self.p, self.p), dtype=bool)
        found[self.entries] = False
        return found

    def are_apart(self, M: Array) -> bool:
        """Whether matrices (..., p, p) are block diagonal."""
        return len(self) == 1 or not M[..., self.outside].any()

    def diagonal(self, blocks: list[Array]) -> Array:
        """The matrix (p, q) of blocks (s_j, q_j), with zeros beside them."""
        found = np.zeros((self.p, sum(block.shape[1] for block in blocks)))
        column = 0
        for part, block in zip(self.parts, blocks, strict=True):
            found[part, column : column + block.shape[1]] = block
            column += block.shape[1]
        return found


def taken(M: Array, places: Indices) -> Array:
    """Blocks (..., g, s, s) of matrices (..., p, p) at parameters (g, s)."""
    return np.asarray(M[..., places[:, :, None], places[:, None, :]])


def put(M: Array, places: Indices, blocks: Array) -> None:
    """Write blocks (..., g, s, s) into matrices (..., p, p) at parameters (g, s)."""
    M[..., places[:, :, None], places[:, None, :]] = blocks
