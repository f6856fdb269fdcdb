"""Vector products of a few vectors, many times."""

import numpy as np

from edtk.system.typing import Array


def vector_product(a: Array, b: Array) -> Array:
    """``a x b`` of vectors (..., 3) that broadcast, bit for bit as `np.cross`.

    Of few vectors `np.cross` spends most of its time on the order of axes.
    """
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j] * b[..., k], a[..., k] * b[..., j], out=out[..., i])
    return out
