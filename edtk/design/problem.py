"""A design problem as arrays: the information of candidate experiments. It knows no robot."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.linalg.root import root
from edtk.design.conditioning import WELL, Conditioning
from edtk.design.is_information import is_information
from edtk.design.packed import pack, sensitivity_rows
from edtk.design.packed_information import PackedInformation
from edtk.design.rank_deficient_error import RankDeficientError as RankDeficientError
from edtk.design.require_identifiable import require_identifiable
from edtk.design.rows import Rows
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.frame_problem import FrameProblem


class Problem(Presented):
    """Candidate experiments of a linear (or linearised) model ``y_i = A_i k + noise``.

    The information matrix of weights w is ``M = sum_i w_i (M0 + A_i' A_i / sigma^2)``. The rows
    ``A_i / sigma`` are kept, so that sensitivities are sums of squares and lose no digits; a
    problem made by `of_information` keeps packed upper triangles instead.
    M0 is the prior information: what other measurements tell about the parameters anyhow, per
    single experiment of the plan. It enters `information`, `mean` and `sensitivities`; `packed`,
    `blocks` and `factors` are of the candidates alone.

    Args:
        blocks: Regressors A_i (n, rows, p).
        sigma: Standard deviation of the noise, one number or one per row (rows,).
        parameters: Names (p,) for messages; they default to k1 .. kp.
        prior: Prior information M0 (p, p), positive semidefinite; by default there is none.

    Raises:
        ValueError: The regressors do not have three axes, there are no candidates, an entry is not
            finite (its candidate is named), sigma is not positive, the number of names or the shape
            of the prior does not fit the number of parameters, or the prior is no information.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.array([-1.0, 0.0, 1.0])
        >>> line = edtk.Problem(np.column_stack([np.ones(3), x])[:, None, :], sigma=0.5)
        >>> line.information([1, 0, 1])
        array([[8., 0.],
               [0., 8.]])
    """

    kept: Rows | PackedInformation
    p: int
    parameters: tuple[str, ...]
    prior: Array | None

    def __init__(
        self,
        blocks: ArrayLike,
        sigma: ArrayLike = 1.0,
        parameters: tuple[str, ...] | None = None,
        prior: ArrayLike | None = None,
    ) -> None:
        A = np.asarray(blocks, dtype=float)
        if A.ndim != 3 or 0 in A.shape:
            raise ValueError(
                f"blocks must be a non-empty array (n, rows, p), not of shape {A.shape}"
            )
        scale = np.broadcast_to(np.asarray(sigma, dtype=float), A.shape[1:2])
        if not (np.isfinite(scale) & (scale > 0)).all():
            raise ValueError("sigma must be finite and positive")
        _require_finite(np.isfinite(A).all(axis=(1, 2)))
        # A finite regressor may have a square that is not; it is named below without a warning.
        with np.errstate(over="ignore", invalid="ignore"):
            whitened = A / scale[:, None]
            _require_finite(np.isfinite(np.einsum("irp,irp->i", whitened, whitened)))
        self._set(Rows.of(whitened), parameters, prior)
        _require_information(self.prior)

    @classmethod
    def from_frame(
        cls,
        frame: "pd.DataFrame",
        formula: str,
        sigma: ArrayLike = 1.0,
        prior: ArrayLike | None = None,
        experiment: str | None = None,
    ) -> "FrameProblem":
        """Make a problem of the rows of a data frame, each a candidate, and a model of its columns.

        Formulas are those of the package formulaic: `1 + x + I(x**2)`, `x*z`, `C(group)`,
        `np.log(x)`; as ever, squares need `I`, and there is a constant unless `0 +` says no. The
        columns of the model matrix name the parameters.

        Args:
            frame: The candidates.
            formula: The right-hand side of a formula.
            sigma: Standard deviation of the noise, see `Problem`.
            prior: Prior information (p, p), see `Problem`.
            experiment: Column whose equal values join rows to one experiment of several
                measurements; by default each row is an experiment.

        Raises:
            UserError: One line: formulaic is not installed, or formula and frame do not fit.

        Example:
            >>> import pandas as pd, edtk
            >>> frame = pd.DataFrame({"x": [-1.0, -0.5, 0.0, 0.5, 1.0]})
            >>> problem = edtk.Problem.from_frame(frame, "1 + x + I(x**2)")
            >>> problem.parameters
            ('Intercept', 'x', 'I(x ** 2)')
            >>> edtk.relax(problem, "D").to_frame().round(4)
                 x  weight
            0 -1.0  0.3333
            2  0.0  0.3333
            4  1.0  0.3333
        """
        from edtk.design.frame_problem import FrameProblem  # it derives from this class

        return FrameProblem(frame, formula, sigma, prior, experiment)

    @classmethod
    def of_information(
        cls,
        packed: Array,
        parameters: tuple[str, ...] | None = None,
        prior: ArrayLike | None = None,
    ) -> "Problem":
        """Make a problem from the information of each candidate, without a copy.

        Args:
            packed: Upper triangles (p(p+1)/2, n), see `edtk.design.packed`.
            parameters: Names (p,) for messages; they default to k1 .. kp.
            prior: Prior information M0 (p, p), positive semidefinite; by default there is none.

        Raises:
            ValueError: There are no candidates, the number of rows is not that of a triangle, an
                entry is not finite, or names or prior do not fit the number of parameters.
        """
        if packed.ndim != 2 or 0 in packed.shape:
            raise ValueError(
                f"packed information must be a non-empty array (p(p+1)/2, n), not {packed.shape}"
            )
        # A sum is finite only if all its terms are, and needs no mask of the size of the input.
        _require_finite(np.isfinite(packed.sum(axis=0)))
        problem = cls.of_kept(PackedInformation(packed), parameters, prior)
        _require_information(problem.prior)
        return problem

    @classmethod
    def of_kept(
        cls,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | None,
    ) -> "Problem":
        """Make a problem of candidates that are kept in some form, and are known to be sound."""
        problem = cls.__new__(cls)
        problem._set(kept, parameters, prior)
        return problem

    def _set(
        self,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | None,
    ) -> None:
        self.kept = kept
        self.p = kept.p
        default = tuple(f"k{i + 1}" for i in range(self.p))
        self.parameters = default if parameters is None else tuple(parameters)
        if len(self.parameters) != self.p:
            raise ValueError(f"{len(self.parameters)} names for {self.p} parameters")
        # None instead of zeros: without a prior nothing is added, and no last digit changes.
        self.prior = None if prior is None else np.asarray(prior, dtype=float)
        if self.prior is not None and self.prior.shape != (self.p, self.p):
            raise ValueError(f"the prior must be ({self.p}, {self.p}), not {self.prior.shape}")

    def headline(self) -> str:
        """Number of candidates and of parameters."""
        return f"{self.n} candidates, {self.p} parameters ({', '.join(self.parameters)})"

    @property
    def n(self) -> int:
        """Number of candidates."""
        return self.kept.n

    @property
    def packed(self) -> Array:
        """Upper triangles (p(p+1)/2, n) of the candidates' information; of rows, made anew."""
        return self.kept.packed()

    def __getitem__(self, chosen: Indices) -> "Problem":
        """The same problem with some of its candidates."""
        return Problem.of_kept(self.kept[chosen], self.parameters, self.prior)

    def __add__(self, others: "Problem") -> "Problem":
        """The same problem with the candidates of another one besides its own."""
        kept: Rows | PackedInformation
        if isinstance(self.kept, Rows) and isinstance(others.kept, Rows):
            kept = self.kept + others.kept
        else:
            kept = PackedInformation(np.concatenate([self.packed, others.packed], axis=1))
        return Problem.of_kept(kept, self.parameters, self.prior)

    def with_prior(self, prior: Array | None) -> "Problem":
        """The same candidates with other prior information (p, p), or without any."""
        return Problem.of_kept(self.kept, self.parameters, prior)

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
        support = np.flatnonzero(w)
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

    @cached_property
    def conditioning(self) -> Conditioning:
        """How well the candidates, and the prior, tell all parameters apart.

        Of rows whose squares have lost too many digits it comes from a QR factorization.
        """
        found = Conditioning.of_information(self.mean)
        if not isinstance(self.kept, Rows) or found.s[0] * WELL > found.s[-1]:
            return found
        parts = [self.kept.flat / np.sqrt(self.n)]
        if self.prior is not None:
            parts.append(root(self.prior))
        return Conditioning.of_rows(parts, self.mean)

    def in_units(self, T: Array) -> "Problem":
        """The same candidates for parameters k' with ``k = T k'``; they have default names.

        Args:
            T: Regular matrix (p, p).
        """
        prior = self.prior
        if prior is not None:
            F = root(prior) @ T
            prior = F.T @ F
        return Problem.of_kept(self.kept.times(T), None, prior)

    def require_identifiable(self, criterion: Criterion | None = None) -> None:
        """Check that the candidates and the prior together excite all that has to be known.

        Args:
            criterion: Tells what that is; defaults to all directions of the parameters.

        Raises:
            RankDeficientError: Some directions are open; the message names them. Or the parameters
                can hardly be told apart; the message has the condition number.
            CriterionError: The criterion is about another number of parameters.
        """
        if criterion is not None:
            criterion.require_order(self.p)
        require_identifiable(self, criterion)

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

    def traces(self, root: Array | None = None) -> Array:
        """Trace (n,) of each candidate's information with the prior, ``<B B', M0 + M_i>``.

        Args:
            root: B (p, q), which makes of the trace one in other parameters; defaults to I.
        """
        if root is None:
            return self.sensitivities(np.eye(self.p))
        return self.sensitivities_to_root(root)

    def with_unit_trace(self, root: Array | None = None) -> "Problem":
        """The same candidates, each scaled to information of trace one.

        A candidate absorbs the prior before it is scaled, so that the result has no prior. One
        without any information stays as it is. The result is computed once and kept.

        Args:
            root: See `traces`.
        """
        return self._unit_trace if root is None else self._scaled_by(self.traces(root))

    @cached_property
    def _unit_trace(self) -> "Problem":
        return self._scaled_by(self.traces())

    def _scaled_by(self, trace: Array) -> "Problem":
        """The candidates with the prior, each divided by its trace (n,)."""
        kept = self.kept
        if self.prior is not None:
            kept = PackedInformation(self.packed).plus(self.prior)
        return Problem.of_kept(
            kept.scaled(1.0 / np.where(trace > 0, trace, 1.0)), self.parameters, None
        )


def _require_information(prior: Array | None) -> None:
    """Refuse a prior that no measurements can have."""
    if prior is not None and not is_information(prior):
        raise ValueError("the prior must be finite, symmetric and positive semidefinite")


def _require_finite(finite: Mask) -> None:
    """Name the first candidate that has an entry which is not finite."""
    if not finite.all():
        raise ValueError(f"block {np.flatnonzero(~finite)[0]} has an entry that is not finite")
