"""A design problem as arrays: candidate experiments as blocks of regressor rows. It knows no robot."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """Candidate experiments of a linear(ised) model ``y_i = A_i k + noise``.

    Args:
        blocks: Regressors A_i (n, rows, p).
        sigma: Standard deviation of the noise, one number or one per row (rows,).

    Raises:
        ValueError: Not three axes, no candidates, a non-finite entry (its block is named), or sigma <= 0.
    """

    blocks: Array
    sigma: ArrayLike = 1.0

    def __post_init__(self) -> None:
        blocks = np.asarray(self.blocks, dtype=float)
        if blocks.ndim != 3 or 0 in blocks.shape:
            raise ValueError(f"blocks must be a non-empty array (n, rows, p), not of shape {blocks.shape}")
        finite = np.isfinite(blocks).all(axis=(1, 2))
        if not finite.all():
            raise ValueError(f"block {np.flatnonzero(~finite)[0]} has an entry that is not finite")
        sigma = np.broadcast_to(np.asarray(self.sigma, dtype=float), blocks.shape[1:2])
        if not (np.isfinite(sigma) & (sigma > 0)).all():
            raise ValueError("sigma must be finite and positive")
        object.__setattr__(self, "blocks", blocks)
        object.__setattr__(self, "sigma", sigma)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return int(self.blocks.shape[2])

    @cached_property
    def information_blocks(self) -> Array:
        """Information of one experiment each: ``A_i' A_i / sigma^2`` (n, p, p)."""
        W = self.blocks / np.asarray(self.sigma)[:, None]
        return np.swapaxes(W, 1, 2) @ W

    def information(self, weights: ArrayLike) -> Array:
        """Information matrix ``M = sum w_i A_i' A_i / sigma^2`` (p, p) of weights or repetitions (n,)."""
        M: Array = np.tensordot(np.asarray(weights, dtype=float), self.information_blocks, axes=1)
        return M
