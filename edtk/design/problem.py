"""A design problem as arrays: candidate experiments as blocks of regressor rows. It knows no robot."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.linalg.null_space import open_directions
from edtk.design.packed import order, pack_gram, sensitivity_rows, unpack

Array = NDArray[np.float64]


class RankDeficientError(ValueError):
    """Candidates that cannot identify all parameters; the message names the directions that none excites."""


class Problem:
    """Candidate experiments of a linear(ised) model ``y_i = A_i k + noise``.

    Only the information of each candidate is kept, ``A_i' A_i / sigma^2`` packed as its upper triangle.

    Args:
        blocks: Regressors A_i (n, rows, p).
        sigma: Standard deviation of the noise, one number or one per row (rows,).
        parameters: Names (p,) for messages; k1 .. kp where None.

    Raises:
        ValueError: Not three axes, no candidates, a non-finite entry (its block is named), sigma <= 0, or not as
            many names as parameters.
    """

    def __init__(
        self, blocks: ArrayLike, sigma: ArrayLike = 1.0, parameters: tuple[str, ...] | None = None
    ) -> None:
        A = np.asarray(blocks, dtype=float)
        if A.ndim != 3 or 0 in A.shape:
            raise ValueError(
                f"blocks must be a non-empty array (n, rows, p), not of shape {A.shape}"
            )
        scale = np.broadcast_to(np.asarray(sigma, dtype=float), A.shape[1:2])
        if not (np.isfinite(scale) & (scale > 0)).all():
            raise ValueError("sigma must be finite and positive")
        _refuse_non_finite(np.isfinite(A).all(axis=(1, 2)))
        with np.errstate(over="ignore", invalid="ignore"):
            packed = pack_gram(np.moveaxis(A / scale[:, None], 0, -1).swapaxes(0, 1))
            _refuse_non_finite(np.isfinite(packed.sum(axis=0)))
        self._set(packed, parameters)

    @classmethod
    def of_information(cls, packed: Array, parameters: tuple[str, ...] | None = None) -> "Problem":
        """A problem from the information of each candidate, packed (p(p+1)/2, n), without a copy.

        Raises:
            ValueError: No candidates, not so many entries as a triangle has, or one of them not finite.
        """
        if packed.ndim != 2 or 0 in packed.shape:
            raise ValueError(
                f"packed information must be a non-empty array (p(p+1)/2, n), not {packed.shape}"
            )
        _refuse_non_finite(np.isfinite(packed.sum(axis=0)))
        problem = cls.__new__(cls)
        problem._set(packed, parameters)
        return problem

    def _set(self, packed: Array, parameters: tuple[str, ...] | None) -> None:
        self.packed, self.p = packed, order(len(packed))
        self.parameters = (
            tuple(f"k{i + 1}" for i in range(self.p)) if parameters is None else tuple(parameters)
        )
        if len(self.parameters) != self.p:
            raise ValueError(f"{len(self.parameters)} names for {self.p} parameters")

    @property
    def n(self) -> int:
        """Number of candidates."""
        return int(self.packed.shape[1])

    def blocks(self, chosen: ArrayLike = slice(None)) -> Array:  # type: ignore[assignment]
        """Information ``A_i' A_i / sigma^2`` (k, p, p) of some candidates, by default of all."""
        return unpack(self.packed[:, chosen])  # type: ignore[index]

    @cached_property
    def _factors(self) -> Array:
        """U (n, r, p) with ``U' U`` the information of each candidate, r the largest rank; made when first asked.

        A Cholesky factorization with pivots, of all candidates at once: each step takes away what goes with the
        largest entry that is left on a diagonal, until nothing but rounding is left of any.
        """
        scale = np.sqrt(np.maximum(np.diag(self.mean), np.finfo(float).tiny))
        S = self.blocks() / np.outer(scale, scale)
        d, each = np.diagonal(S, axis1=1, axis2=2), np.arange(self.n)
        least = 1e-13 * d.max(axis=1)
        rows: list[Array] = []
        while len(rows) < self.p and ((top := d.max(axis=1)) > least).any():
            row = S[each, d.argmax(axis=1)] / np.sqrt(np.where(top > least, top, np.inf))[:, None]
            S -= row[:, :, None] * row[:, None]
            rows.append(row)
        return np.stack(rows or [np.zeros((self.n, self.p))], axis=1) * scale

    def factors(self, chosen: ArrayLike = slice(None)) -> Array:  # type: ignore[assignment]
        """U (k, r, p) with ``U' U = A' A/sigma^2`` of some candidates, r the largest rank of all."""
        return self._factors[chosen]  # type: ignore[index]

    def information(self, weights: ArrayLike) -> Array:
        """Information matrix ``M = sum w_i A_i' A_i / sigma^2`` (p, p) of weights or repetitions (n,)."""
        w = np.asarray(weights, dtype=float)
        support = np.flatnonzero(w)
        return unpack(
            self.packed[:, support] @ w[support] if 2 * len(support) < self.n else self.packed @ w
        )

    @cached_property
    def mean(self) -> Array:
        """Mean information (p, p) of all candidates."""
        return unpack(self.packed.mean(axis=1))

    def require_identifiable(self) -> None:
        """Check that the candidates together excite every direction of the parameters.

        Raises:
            RankDeficientError: They do not; names the directions.
        """
        if directions := open_directions(self.mean, self.parameters):
            raise RankDeficientError(
                "the candidates together cannot identify all parameters: no candidate excites "
                f"{' or '.join(directions)}"
            )

    def sensitivities(self, Z: ArrayLike) -> Array:
        """``<Z, A_i' A_i / sigma^2>`` (..., n) of multipliers Z (..., p, p)."""
        return np.asarray(sensitivity_rows(Z) @ self.packed)

    def with_unit_trace(self) -> "Problem":
        """The same candidates, each scaled to information of trace one (those of none are left); kept once made."""
        return self._unit_trace

    @cached_property
    def _unit_trace(self) -> "Problem":
        trace = self.sensitivities(np.eye(self.p))
        return Problem.of_information(
            self.packed / np.where(trace > 0, trace, 1.0), self.parameters
        )


def _refuse_non_finite(finite: NDArray[np.bool_]) -> None:
    """Name the first candidate that has an entry which is not finite."""
    if not finite.all():
        raise ValueError(f"block {np.flatnonzero(~finite)[0]} has an entry that is not finite")
