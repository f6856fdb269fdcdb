"""Candidates as arrays beside a prior: the information of weights, and what each adds to it.

Nothing here knows where the arrays come from: `Problem` makes them of tables, models and others.
"""

import math
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.models import Models
from edtk.design.conditioning import Conditioning, ConditioningOfModels
from edtk.design.information import (
    Known,
    ModelRows,
    PackedInformation,
    Rows,
    pack,
    sensitivity_rows,
)
from edtk.system.errors import ArgumentError, UserError, real_numbers
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

DISTANT = 1e-24  # ratio of squares: of units that are twelve decades apart


class WeightedCandidates(Presented):
    """The information ``M = sum_i w_i (M0 + M_i)`` of weights w on candidates beside a prior M0.

    Attributes:
        kept: The candidates.
        p: Number of parameters.
        prior: Prior information M0 (p, p) per experiment; None for none.
        parameters: Names (p,).
    """

    kept: Rows | PackedInformation
    p: int
    prior: Array | None
    parameters: tuple[str, ...]
    # Entries of arrays are what they are; where a model has computed rows, one far below the others
    # may be the rounding of a zero.
    is_exact: bool = False
    # What the prior is made of: it has the digits that squares may have lost.
    known: Known | None = None

    @classmethod
    def of_kept(
        cls,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | Known | None,
    ) -> Self:
        """Make a problem of candidates that are kept in some form, and are known to be sound."""
        found = cls.__new__(cls)
        found._set(kept, parameters, prior)
        return found

    def _set(
        self,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | Known | None,
    ) -> None:
        self.kept = kept
        self.p = kept.p
        names = (f"k{i + 1}" for i in range(self.p)) if parameters is None else parameters
        self.parameters = tuple(names)
        if len(self.parameters) != self.p:
            message = f"{len(self.parameters)} names for {self.p} parameters"
            raise ArgumentError(message, argument="parameters")
        # None instead of zeros: without a prior nothing is added, and no last digit changes.
        known = prior
        if known is not None and not isinstance(known, Known):
            squares = real_numbers(known, "prior")
            if squares.shape != (self.p, self.p):
                raise UserError(f"the prior must be ({self.p}, {self.p}), not {squares.shape}")
            known = Known.of(squares)
        self.known = known
        self.prior = None if known is None else known.information

    @property
    def n(self) -> int:
        """Number of candidates."""
        return self.kept.n

    @property
    def packed(self) -> Array:
        """Upper triangles (p(p+1)/2, n) of the candidates' information; of rows, made anew."""
        return self.kept.packed()

    def blocks(self, chosen: ArrayLike = slice(None)) -> Array:  # type: ignore[assignment]
        """Information ``A_i' A_i / sigma^2`` (k, p, p) of some candidates, by default of all."""
        return self.kept.blocks(chosen)

    def factors(self, chosen: ArrayLike = slice(None)) -> Array:  # type: ignore[assignment]
        """Factors U (k, r, p) with ``U' U = A' A/sigma^2`` of some candidates, by default of all.

        They are the rows ``A/sigma`` themselves where these are kept. Otherwise their number r is
        the largest rank among all candidates.
        """
        return self.kept.factors(chosen)

    def information(self, weights: ArrayLike) -> Array:
        """Information matrix ``M = sum_i w_i (M0 + A_i' A_i / sigma^2)`` (p, p).

        Args:
            weights: Weights or numbers of repetitions w (n,).
        """
        w = np.asarray(weights, dtype=float)
        support = np.flatnonzero(w != 0)  # ten times as quick as of numbers
        # Columns of the support are worth a copy only where they are few.
        few = 2 * len(support) < self.n
        M = self.kept[support].weighted(w[support]) if few else self.kept.weighted(w)
        return M if self.prior is None else M + w.sum() * self.prior

    def plan_information(self, chosen: Indices, repeats: Array) -> Array:
        """Information matrices of many plans of few candidates.

        Args:
            chosen: Indices (b, k) of the candidates of b plans.
            repeats: Their repetitions (b, k).

        Returns:
            Matrices (b, p, p), the prior included.
        """
        M = self.kept.weighted_plans(chosen, repeats)
        return M if self.prior is None else M + repeats.sum(axis=1)[:, None, None] * self.prior

    @cached_property
    def mean(self) -> Array:
        """Information matrix (p, p) of equal weights ``1/n``."""
        M = self.kept.mean()
        return M if self.prior is None else M + self.prior

    def sensitivities(self, Z: ArrayLike) -> Array:
        """Sensitivities ``<Z, M0 + A_i' A_i / sigma^2>`` of all candidates to multipliers Z.

        A candidate's sensitivity is the rate at which the cost falls with its weight, where Z is
        minus the gradient of the cost.

        Args:
            Z: Symmetric multipliers (..., p, p).

        Returns:
            Array (..., n).
        """
        Z = np.asarray(Z, dtype=float)
        own = self.kept.sensitivities(Z)
        if self.prior is None:
            return own
        return own + (sensitivity_rows(Z) @ pack(self.prior))[..., None]

    def largest_sensitivities(self, Z: Array) -> Array:
        """The largest sensitivity (r,) of a candidate to each of multipliers Z (r, p, p).

        It is that of `sensitivities`, without an array of all of them.
        """
        own = self.kept.largest_sensitivities(Z)
        if self.prior is None:
            return own
        return np.asarray(own + sensitivity_rows(Z) @ pack(self.prior))

    def sensitivities_to_root(self, B: Array) -> Array:
        """Sensitivities (n,) to the multiplier ``Z = B B'`` of a factor B (p, q).

        Of rows they are squared norms ``|A_i B|^2``. So they keep the digits that a Z in nearly
        dependent parameters has lost, and those of low rank take less time.
        """
        own = self.kept.sensitivities_to_root(B)
        if self.prior is None:
            return own
        return np.asarray(own + np.einsum("aq,ab,bq->", B, self.prior, B))

    @cached_property
    def largest(self) -> Array:
        """The largest information (p,) of a candidate about each parameter, with the prior."""
        own = self.kept.largest()
        return own if self.prior is None else own + np.diag(self.prior)

    def diagonals(self) -> Array:
        """The information (n, p) of each candidate about each parameter, with the prior."""
        own = self.kept.diagonals()
        return own if self.prior is None else own + np.diag(self.prior)

    def traces(self, root: Array | None = None) -> Array:
        """Trace (n,) of each candidate's information with the prior, ``<B B', M0 + M_i>``.

        Args:
            root: B (p, q), which makes of the trace one in other parameters; defaults to I.
        """
        if root is None:
            return self.sensitivities(np.eye(self.p))
        return self.sensitivities_to_root(root)

    def __getitem__(self, chosen: Indices) -> Self:
        """The same problem with some of its candidates."""
        return self.of_candidates(self.kept[chosen])

    def __add__(self, others: "WeightedCandidates") -> Self:
        """The same problem with the candidates of another one besides its own."""
        kept: Rows | PackedInformation
        if isinstance(self.kept, Rows) and isinstance(others.kept, Rows):
            kept = self.kept + others.kept
        else:
            kept = PackedInformation(np.concatenate([self.packed, others.packed], axis=1))
        found = self.of_candidates(kept)
        found.is_exact = self.is_exact and others.is_exact
        return found

    def with_prior(self, prior: Array | Known | None) -> Self:
        """The same candidates with other prior information (p, p), or without any."""
        return self._with(self.kept, prior)

    def in_unit(self, power: int) -> Self:
        """The same problem in a unit in which rows are ``2^power`` times as large."""
        known = None if self.known is None else self.known.in_unit(power)
        return self._with(self.kept.in_unit(power), known)

    def of_candidates(self, kept: Rows | PackedInformation) -> Self:
        """The same problem with other candidates in place of its own."""
        return self._with(kept, self.known)

    def _with(self, kept: Rows | PackedInformation, prior: Array | Known | None) -> Self:
        """Other candidates about the same parameters, whose entries are as exact as these."""
        found = self.of_kept(kept, self.parameters, prior)
        found.is_exact = self.is_exact
        return found

    @property
    def has_distant_units(self) -> bool:
        """Whether the parameters' units are so far apart that one looks like rounding.

        Of rows that a model has computed it is taken for that.
        """
        largest = np.diag(self.mean)
        told = largest[largest > 0]
        return bool(self.is_exact and len(told) and told.min() <= DISTANT * told.max())

    @cached_property
    def models(self) -> Models:
        """Where the blocks of the information stand: one, unless there are several models."""
        return self.kept.models

    @property
    def width(self) -> int:
        """The order of a matrix with as many entries as the blocks have: p of a single model."""
        return math.ceil(math.sqrt(sum(size**2 for size in self.models.sizes)))

    @property
    def _is_apart(self) -> bool:
        """Whether the prior mixes no models."""
        return self.prior is None or self.models.are_apart(self.prior)

    @cached_property
    def each(self) -> list[Self]:
        """The problem of each of several models alone."""
        kept = self.kept
        parts = kept.parts if isinstance(kept, ModelRows) else (kept,)
        found = []
        for part, at in zip(parts, self.models.parts, strict=True):
            known = None if self.known is None else self.known.part(at)
            found.append(self.of_kept(part, self.parameters[at], known))
        return found

    @cached_property
    def conditioning(self) -> Conditioning:
        """How well the candidates, and the prior, tell all parameters apart.

        Of rows whose squares have lost too many digits it comes from a QR factorization.
        """
        if isinstance(self.kept, ModelRows) and self._is_apart:
            return ConditioningOfModels.joined(self.models, [one.conditioning for one in self.each])
        found = Conditioning.of_information(self.mean)
        if not isinstance(self.kept, Rows) or found.keeps_digits:
            return found
        parts = [self.kept.flat / np.sqrt(self.n)]
        if self.known is not None:
            parts.append(self.known.root)
        return Conditioning.of_rows(parts, self.mean)

    def in_units(self, T: Array) -> Self:
        """The same candidates for parameters k' with ``k = T k'``; they have default names.

        Args:
            T: Regular matrix (p, p).
        """
        prior = None if self.known is None else self.known.times(T)
        return self.of_kept(self.kept.times(T), None, prior)

    def with_unit_trace(self, root: Array | None = None) -> Self:
        """The same candidates, each scaled to information of trace one.

        A candidate absorbs the prior before it is scaled, so that the result has no prior. One
        without any information stays as it is. The result is computed once and kept.

        Args:
            root: See `traces`.
        """
        return self._unit_trace if root is None else self._scaled_by(self.traces(root))

    @cached_property
    def _unit_trace(self) -> Self:
        return self._scaled_by(self.traces())

    def _scaled_by(self, trace: Array) -> Self:
        """The candidates with the prior, each divided by its trace (n,)."""
        kept = self.kept
        if self.prior is not None:
            kept = PackedInformation(self.packed).plus(self.prior)
        return self.of_kept(
            kept.scaled(1.0 / np.where(trace > 0, trace, 1.0)), self.parameters, None
        )


def rows_of_blocks(blocks: ArrayLike, sigma: ArrayLike) -> Rows:
    """Keep regressors (n, rows, p), each row divided by its sigma.

    Args:
        blocks: Regressors A_i (n, rows, p).
        sigma: Standard deviation of the noise, see `Problem`.

    Raises:
        ValueError: The regressors do not have three axes, there are no candidates, an entry is not
            finite (its candidate is named), or sigma is not positive.
    """
    if isinstance(blocks, np.ndarray) and np.iscomplexobj(blocks):
        raise UserError("blocks must be real numbers; give real and imaginary parts as two rows")
    A = real_numbers(blocks, "blocks")
    if A.ndim != 3 or 0 in A.shape:
        hint = "; X[:, None, :] has one row a candidate" if A.ndim == 2 and A.size else ""
        raise UserError(
            f"blocks must be a non-empty array (n, rows, p), not of shape {A.shape}{hint}"
        )
    n, rows = A.shape[:2]
    scale = real_numbers(sigma, "sigma")
    if scale.shape == (n,) != (rows,):
        scale = scale[:, None]
    if scale.shape not in ((), (1,), (rows,), (n, 1), (n, rows)):
        raise UserError(
            f"sigma must be one number, or one for each of {rows} rows, or of {n} candidates, not "
            f"of shape {scale.shape}"
        )
    if not (np.isfinite(scale) & (scale > 0)).all():
        raise UserError("sigma must be finite and positive")
    # A finite regressor may have a square that is not; it is named below without a warning.
    with np.errstate(over="ignore", invalid="ignore"):
        whitened = A if (scale == 1.0).all() else A / scale[..., None]
        squares = np.einsum("irp,irp->i", whitened, whitened)
    if not np.isfinite(squares).all():
        _require_finite(np.asarray(np.isfinite(A).all(axis=(1, 2))))
        _require_finite(np.isfinite(squares), "an entry that is too large to be squared")
    return Rows.of(A, scale)


def packed_information(packed: Array) -> PackedInformation:
    """Keep the upper triangles (p(p+1)/2, n) of the information of candidates, without a copy.

    Raises:
        ValueError: There are no candidates, or an entry is not finite (its candidate is named).
    """
    packed = real_numbers(packed, "packed")
    if packed.ndim != 2 or 0 in packed.shape:
        raise UserError(
            f"packed information must be a non-empty array (p(p+1)/2, n), not {packed.shape}"
        )
    # A sum is finite only if all its terms are, and needs no mask of the size of the input.
    _require_finite(np.isfinite(packed.sum(axis=0)))
    return PackedInformation(packed)


def _require_finite(finite: Mask, what: str = "an entry that is not finite") -> None:
    """Name the first candidate that has an entry which is not finite, or has no finite square."""
    if not finite.all():
        raise UserError(f"block {np.flatnonzero(~finite)[0]} has {what}")
