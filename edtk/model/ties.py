"""How the variables of all joints of a chain follow those of the joints that are free."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Ties:
    """The affine map ``x = P q + b`` from free joints q (n) to all joints x (N) of a chain.

    Derivatives by q are those by x, folded: ``dy/dq = P' dy/dx``. Arrays are component first.

    Attributes:
        matrix: P (N, n).
        offset: b (N,) [rad or m].
        free: Index of each free joint (n,) among all.
    """

    matrix: Array
    offset: Array
    free: list[int]

    def variables(self, q: Array) -> Array:
        """Variables x (N, ...) of all joints for those of the free ones (n, ...)."""
        lift = (slice(None),) + (None,) * (q.ndim - 1)
        return self.spread(q) + self.offset[lift]

    def spread(self, values: Array) -> Array:
        """P times values (n, ...) of the free joints: values (N, ...) of all."""
        return np.tensordot(self.matrix, values, axes=1)

    def fold(self, values: Array) -> Array:
        """P' times values (N, ...) of all joints: values (n, ...) of the free ones."""
        return np.tensordot(self.matrix.T, values, axes=1)

    def fold_sizes(self, sizes: Array) -> Array:
        """Bounds (n, ...) on folded values, of bounds (N or 1, ...) on the values."""
        every = np.broadcast_to(sizes, (len(self.matrix), *sizes.shape[1:]))
        return np.tensordot(np.abs(self.matrix.T), every, axes=1)
