"""Candidates and a prior: the information of weights on them, and what each adds to it."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.information import PackedInformation, Rows, pack, sensitivity_rows
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices


class WeightedCandidates(Presented):
    """The information ``M = sum_i w_i (M0 + M_i)`` of weights w on candidates beside a prior M0.

    Attributes:
        kept: The candidates.
        p: Number of parameters.
        prior: Prior information M0 (p, p) per experiment; None for none.
    """

    kept: Rows | PackedInformation
    p: int
    prior: Array | None

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
