"""A design problem as arrays: the information of candidate experiments. It knows no robot."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.linalg.root import root
from edtk.design.candidate_arrays import packed_information, require_information, rows_of_blocks
from edtk.design.conditioning import Conditioning
from edtk.design.packed_information import PackedInformation
from edtk.design.rank_deficient_error import RankDeficientError as RankDeficientError
from edtk.design.require_identifiable import require_identifiable
from edtk.design.rows import Rows
from edtk.design.weighted_candidates import WeightedCandidates
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.frame_problem import FrameProblem

DISTANT = 1e-24  # ratio of squares: of units that are twelve decades apart


class Problem(WeightedCandidates):
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

    parameters: tuple[str, ...]
    # Entries of arrays are what they are; where a model has computed rows, one far below the others
    # may be the rounding of a zero.
    is_exact: bool = False

    def __init__(
        self,
        blocks: ArrayLike,
        sigma: ArrayLike = 1.0,
        parameters: tuple[str, ...] | None = None,
        prior: ArrayLike | None = None,
    ) -> None:
        self._set(rows_of_blocks(blocks, sigma), parameters, prior)
        self.is_exact = True
        named_twice = {name for name in self.parameters if self.parameters.count(name) > 1}
        if named_twice:
            raise ValueError(f"several parameters have the name {min(named_twice)!r}")
        require_information(self.prior)

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
        problem = cls.of_kept(packed_information(packed), parameters, prior)
        require_information(problem.prior)
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
        candidates = "1 candidate" if self.n == 1 else f"{self.n} candidates"
        parameters = "1 parameter" if self.p == 1 else f"{self.p} parameters"
        return f"{candidates}, {parameters} ({', '.join(self.parameters)})"

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
        problem = Problem.of_kept(self.kept, self.parameters, prior)
        problem.is_exact = self.is_exact
        return problem

    @property
    def has_distant_units(self) -> bool:
        """Whether the parameters' units are so far apart that one looks like rounding.

        Of rows that a model has computed it is taken for that.
        """
        largest = np.diag(self.mean)
        told = largest[largest > 0]
        return bool(self.is_exact and len(told) and told.min() <= DISTANT * told.max())

    @cached_property
    def conditioning(self) -> Conditioning:
        """How well the candidates, and the prior, tell all parameters apart.

        Of rows whose squares have lost too many digits it comes from a QR factorization.
        """
        found = Conditioning.of_information(self.mean)
        if not isinstance(self.kept, Rows) or found.keeps_digits:
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
