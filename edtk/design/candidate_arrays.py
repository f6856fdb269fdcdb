"""Arrays from which a problem is made: checked, and in the form in which it keeps them."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.is_information import is_information
from edtk.design.packed_information import PackedInformation
from edtk.design.rows import Rows
from edtk.system.typing import Array, Mask


def rows_of_blocks(blocks: ArrayLike, sigma: ArrayLike) -> Rows:
    """Keep regressors (n, rows, p), each row divided by its sigma.

    Args:
        blocks: Regressors A_i (n, rows, p).
        sigma: Standard deviation of the noise, one number or one per row (rows,).

    Raises:
        ValueError: The regressors do not have three axes, there are no candidates, an entry is not
            finite (its candidate is named), or sigma is not positive.
    """
    if np.iscomplexobj(blocks):
        raise ValueError("blocks must be real numbers; give real and imaginary parts as two rows")
    A = np.asarray(blocks, dtype=float)
    if A.ndim != 3 or 0 in A.shape:
        hint = "; X[:, None, :] has one row a candidate" if A.ndim == 2 and A.size else ""
        raise ValueError(
            f"blocks must be a non-empty array (n, rows, p), not of shape {A.shape}{hint}"
        )
    given = np.asarray(sigma, dtype=float)
    if given.shape not in ((), (1,), A.shape[1:2]):
        raise ValueError(
            f"sigma must be one number, or one for each of {A.shape[1]} rows, not of shape "
            f"{given.shape}"
        )
    scale = np.broadcast_to(given, A.shape[1:2])
    if not (np.isfinite(scale) & (scale > 0)).all():
        raise ValueError("sigma must be finite and positive")
    _require_finite(np.isfinite(A).all(axis=(1, 2)))
    # A finite regressor may have a square that is not; it is named below without a warning.
    with np.errstate(over="ignore", invalid="ignore"):
        whitened = A / scale[:, None]
        squares = np.einsum("irp,irp->i", whitened, whitened)
    _require_finite(np.isfinite(squares), "an entry that is too large to be squared")
    return Rows.of(whitened)


def packed_information(packed: Array) -> PackedInformation:
    """Keep the upper triangles (p(p+1)/2, n) of the information of candidates, without a copy.

    Raises:
        ValueError: There are no candidates, or an entry is not finite (its candidate is named).
    """
    if packed.ndim != 2 or 0 in packed.shape:
        raise ValueError(
            f"packed information must be a non-empty array (p(p+1)/2, n), not {packed.shape}"
        )
    # A sum is finite only if all its terms are, and needs no mask of the size of the input.
    _require_finite(np.isfinite(packed.sum(axis=0)))
    return PackedInformation(packed)


def require_information(prior: Array | None) -> None:
    """Refuse a prior that no measurements can have.

    Raises:
        ValueError: It is not finite, symmetric and positive semidefinite.
    """
    if prior is not None and not is_information(prior):
        raise ValueError("the prior must be finite, symmetric and positive semidefinite")


def _require_finite(finite: Mask, what: str = "an entry that is not finite") -> None:
    """Name the first candidate that has an entry which is not finite, or has no finite square."""
    if not finite.all():
        raise ValueError(f"block {np.flatnonzero(~finite)[0]} has {what}")
