"""A design problem as arrays: the information of candidate experiments. It knows no robot."""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.linalg.models import Models
from criteria.linalg.spectrum import is_semidefinite
from edtk.design.conditioning import Conditioning, ConditioningOfModels
from edtk.design.information import Known, ModelRows, PackedInformation, Rows, nearly_equal
from edtk.design.weighted_candidates import WeightedCandidates
from edtk.system.arguments import checked
from edtk.system.errors import UserError, real_numbers
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.nonlinear_model import Robust

SYMMETRIC = 1e-9  # difference across the diagonal that is rounding
DISTANT = 1e-24  # ratio of squares: of units that are twelve decades apart


class RankDeficientError(ValueError):
    """The candidates cannot identify all parameters; the message names the open directions.

    Attributes:
        of_interest: Whether a criterion asked for some of the parameters only.
    """

    def __init__(self, message: str, of_interest: bool = False) -> None:
        super().__init__(message)
        self.of_interest = of_interest


def is_information(M: Array) -> bool:
    """Whether a matrix (p, p) may be information."""
    if not np.isfinite(M).all() or not nearly_equal(M, M.T, SYMMETRIC):
        return False
    return bool(is_semidefinite(M))


def require_identifiable(problem: "Problem", criterion: Criterion | None) -> None:
    """Check that the candidates and the prior together excite all that has to be known.

    Args:
        problem: The candidates.
        criterion: Tells what that is; None for all directions of the parameters.

    Raises:
        RankDeficientError: Some directions are open, or parameters can hardly be told apart.
    """
    if problem.conditioning.fades:
        how = "" if isinstance(problem.kept, Rows) else ", or give rows instead of information"
        raise RankDeficientError(
            "the candidates together do not identify all parameters to working precision: "
            f"their condition number is {problem.conditioning.number:.1e}; centre or scale the "
            f"regressors{how}"
        )
    if criterion is not None and not criterion.needs_all:
        missing = missing_of(problem, criterion)
        if missing:
            raise RankDeficientError(
                "the candidates together cannot identify what is of interest: no candidate "
                f"tells {' or '.join(missing)}",
                of_interest=True,
            )
        return
    if problem.conditioning.is_open.any():
        directions = problem.conditioning.directions(problem.parameters)
        raise RankDeficientError(
            "the candidates together cannot identify all parameters: no candidate excites "
            f"{' or '.join(directions)}"
        )


def missing_of(problem: "Problem", criterion: Criterion) -> tuple[str, ...]:
    """What the candidates leave open of all that a criterion needs, in words.

    Directions that only squares of rows have lost are not open.
    """
    found = problem.conditioning
    if not problem.has_distant_units:
        M = problem.mean if found.is_well else found.information()
        return criterion.missing(M, problem.parameters)
    # In units of the columns' lengths no parameter is taken for rounding.
    M = found.information() / np.outer(found.scale, found.scale)
    return criterion.in_units(np.diag(1.0 / found.scale)).missing(M, problem.parameters)


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


def require_information(prior: Array | None) -> None:
    """Refuse a prior that no measurements can have.

    Raises:
        ValueError: It is not finite, symmetric and positive semidefinite.
    """
    if prior is not None and not is_information(prior):
        raise UserError("the prior must be finite, symmetric and positive semidefinite")


def _require_finite(finite: Mask, what: str = "an entry that is not finite") -> None:
    """Name the first candidate that has an entry which is not finite, or has no finite square."""
    if not finite.all():
        raise UserError(f"block {np.flatnonzero(~finite)[0]} has {what}")


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
        sigma: Standard deviation of the noise: one number, one per row (rows,), one per candidate
            (n,), or (n, rows). As many as both rows and candidates are those of rows; of candidates
            they are (n, 1) then.
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
    robust: "Robust | None" = None  # several models side by side, and what a design is for
    # Entries of arrays are what they are; where a model has computed rows, one far below the others
    # may be the rounding of a zero.
    is_exact: bool = False
    # What the prior is made of: it has the digits that squares may have lost.
    known: Known | None = None

    @checked
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
            raise UserError(f"several parameters have the name {min(named_twice)!r}")
        require_information(self.prior)

    @classmethod
    @checked
    def from_frame(
        cls,
        frame: "pd.DataFrame",
        formula: str,
        sigma: "ArrayLike | str" = 1.0,
        prior: ArrayLike | None = None,
        experiment: str | None = None,
    ) -> "Problem":
        """Make a problem of the rows of a data frame, each a candidate, and a model of its columns.

        Formulas are those of the package formulaic: `1 + x + I(x**2)`, `x*z`, `C(group)`,
        `np.log(x)`; as ever, squares need `I`, and there is a constant unless `0 +` says no. The
        columns of the model matrix name the parameters.

        Args:
            frame: The candidates.
            formula: The right-hand side of a formula.
            sigma: Standard deviation of the noise, see `Problem`; or the column that has it.
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
        from edtk.design.problems import FrameProblem  # it derives from this class

        return FrameProblem(frame, formula, sigma, prior, experiment)

    @classmethod
    @checked
    def of_model(
        cls,
        f: str | Sequence[str] | Callable[..., ArrayLike],
        theta: Any,
        candidates: "ArrayLike | pd.DataFrame",
        family: str = "normal",
        *,
        link: str | None = None,
        sigma: ArrayLike | Callable[..., ArrayLike] = 1.0,
        covariance: ArrayLike | None = None,
        gradient: Callable[..., ArrayLike] | None = None,
        parameters: str | Sequence[str] | None = None,
        variables: str | Sequence[str] | None = None,
        prior: ArrayLike | None = None,
        robust: str | None = None,
        weights: ArrayLike | None = None,
    ) -> "Problem":
        """Make a problem of a nonlinear model, linearised at theta.

        Derivatives by theta are exact for a formula, and for a function that runs on complex
        numbers, as one of numpy does. Of other functions they are differences. Both are compared
        before any work.

        Args:
            f: The model: a function f(x, theta) of all points or of one, or a formula such as
                "Vmax * x / (Km + x)", or a list of formulas of several responses. With a link it
                is what statisticians call the predictor: the mean is the inverse of the link at f.
            theta: Parameters (p,), as numbers or as a mapping with their names; several (k, p)
                with `robust`. A mapping may then have ranges, such as
                {"Vmax": 2.0, "Km": (0.5, 2.0)}: "maximin" searches for the worst theta in them,
                and "bayes" takes the mean over them, by nodes of Gauss and Legendre.
            candidates: Points (n, d) or (n,), or a data frame with a column a variable.
            family: "normal", "binomial", "Poisson" or "gamma".
            link: Identity, log, inverse, logit, probit or cloglog; defaults to the identity for
                normal, the logit for binomial and the log for Poisson and gamma. Where f is the
                mean itself it is "identity".
            sigma: Standard deviation of the noise: a number, one for each response, one for each
                candidate (n,), see `Problem`, or a function of x, or of x and theta. For other
                families it is a factor of the family's own deviation, such as 1/sqrt(10) for the
                share of ten trials.
            covariance: In its place, the covariance (k, k) of k responses.
            gradient: Derivatives of f by theta, (n, p) or (n, k, p), if you know them.
            parameters: Names (p,); a formula needs them unless theta is a mapping.
            variables: Names (d,); a formula of several variables needs them.
            prior: Prior information (p, p), see `Problem`.
            robust: With several theta: "bayes" for the mean over them, "maximin" for the largest
                least efficiency.
            weights: How much each theta counts in the mean (k,); by default all count alike.

        Raises:
            ArgumentError: The model is not finite or not smooth at a point, does not depend on a
                parameter, or an argument does not fit; one line names what.

        Example:
            >>> import numpy as np, edtk
            >>> dose = np.linspace(0, 4, 401)
            >>> theta = {"Vmax": 2.0, "Km": 1.0}
            >>> enzyme = edtk.Problem.of_model("Vmax * dose / (Km + dose)", theta, dose)
            >>> edtk.relax(enzyme, "D").to_frame().round(2)
                 dose  weight
            67   0.67     0.5
            400  4.00     0.5
        """
        from edtk.design.of_model import of_model  # it makes objects of this class
        from edtk.design.sites import CandidateSites  # likewise

        sites = CandidateSites.of(candidates, variables, sigma)
        return of_model(
            sites,
            f,
            theta,
            robust,
            weights,
            prior,
            family=family,
            link=link,
            sigma=1.0 if sites.has_noise else sigma,
            covariance=covariance,
            gradient=gradient,
            parameters=parameters,
        )

    @classmethod
    @checked
    def of_rivals(
        cls,
        f: str | Sequence[str] | Callable[..., ArrayLike],
        theta: Any,
        rival: str | Sequence[str] | Callable[..., ArrayLike],
        rival_theta: "Mapping[str, Any]",  # read below, in words of its own
        candidates: "ArrayLike | pd.DataFrame",
        family: str = "normal",
        *,
        link: str | None = None,
        sigma: ArrayLike = 1.0,
        covariance: ArrayLike | None = None,
        parameters: str | Sequence[str] | None = None,
        variables: str | Sequence[str] | None = None,
    ) -> "Problem":
        """Make a problem of telling a model from a rival, whatever parameters the rival has.

        Its designs maximise the least deviance ``min over t of sum w_i d(x_i, t)`` of the rival at
        the responses of f, where d is twice the divergence of Kullback and Leibler: T-optimality
        of normal responses, ``d = (f - rival)^2 / sigma^2`` (Atkinson and Fedorov 1975), and
        KL-optimality of other families (Lopez-Fidalgo, Tommasi and Trandafir 2007). Results print
        one over it. For m experiments m times the deviance is the noncentrality of the test.

        Args:
            f: The model that is taken for true, see `of_model`.
            theta: Its parameters.
            rival: The other one, in the same variables and with the same family, link and noise.
            rival_theta: Ranges (low, high) of its parameters by name, or numbers. All numbers are
                a rival without free parameters.
            candidates: See `of_model`.
            family: See `of_model`.
            link: See `of_model`.
            sigma: See `of_model`; no function.
            covariance: See `of_model`.
            parameters: Names of theta.
            variables: See `of_model`.

        Raises:
            ArgumentError: See `of_model`.

        Example:
            >>> import numpy as np, edtk
            >>> x = np.linspace(-1, 1, 201)
            >>> line = "c + d * x"
            >>> rivals = edtk.Problem.of_rivals(
            ...     "a * x^2", {"a": 1.0}, line, {"c": (-2, 2), "d": (-2, 2)}, x
            ... )
            >>> design = edtk.relax(rivals)
            >>> round(design.worst.value, 4)
            0.25
        """
        from edtk.design.of_model import of_rivals  # it makes objects of this class
        from edtk.design.sites import CandidateSites  # likewise

        return of_rivals(
            CandidateSites.of(candidates, variables),
            f,
            theta,
            rival,
            rival_theta,
            parameters,
            family=family,
            link=link,
            sigma=sigma,
            covariance=covariance,
        )

    @classmethod
    @checked
    def of_information(
        cls,
        packed: Array,
        parameters: tuple[str, ...] | None = None,
        prior: ArrayLike | None = None,
    ) -> "Problem":
        """Make a problem from the information of each candidate, without a copy.

        Args:
            packed: Upper triangles (p(p+1)/2, n), see `edtk.design.information`.
            parameters: Names (p,) for messages; they default to k1 .. kp.
            prior: Prior information M0 (p, p), positive semidefinite; by default there is none.

        Raises:
            ValueError: There are no candidates, the number of rows is not that of a triangle, an
                entry is not finite, or names or prior do not fit the number of parameters.
        """
        problem = cls.of_kept(packed_information(packed), parameters, prior)
        require_information(problem.prior)
        problem.is_exact = True
        return problem

    @classmethod
    def of_kept(
        cls,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | Known | None,
    ) -> "Problem":
        """Make a problem of candidates that are kept in some form, and are known to be sound."""
        problem = cls.__new__(cls)
        problem._set(kept, parameters, prior)
        return problem

    def _set(
        self,
        kept: Rows | PackedInformation,
        parameters: tuple[str, ...] | None,
        prior: ArrayLike | Known | None,
    ) -> None:
        self.kept = kept
        self.p = kept.p
        default = tuple(f"k{i + 1}" for i in range(self.p))
        self.parameters = default if parameters is None else tuple(parameters)
        if len(self.parameters) != self.p:
            raise UserError(f"{len(self.parameters)} names for {self.p} parameters")
        # None instead of zeros: without a prior nothing is added, and no last digit changes.
        known = prior
        if known is not None and not isinstance(known, Known):
            squares = real_numbers(known, "prior")
            if squares.shape != (self.p, self.p):
                raise UserError(f"the prior must be ({self.p}, {self.p}), not {squares.shape}")
            known = Known.of(squares)
        self.known = known
        self.prior = None if known is None else known.information

    def headline(self) -> str:
        """Number of candidates and of parameters."""
        candidates = "1 candidate" if self.n == 1 else f"{self.n} candidates"
        parameters = "1 parameter" if self.p == 1 else f"{self.p} parameters"
        return f"{candidates}, {parameters} ({', '.join(self.parameters)})"

    def __getitem__(self, chosen: Indices) -> "Problem":
        """The same problem with some of its candidates."""
        return self.of_candidates(self.kept[chosen])

    def __add__(self, others: "Problem") -> "Problem":
        """The same problem with the candidates of another one besides its own."""
        kept: Rows | PackedInformation
        if isinstance(self.kept, Rows) and isinstance(others.kept, Rows):
            kept = self.kept + others.kept
        else:
            kept = PackedInformation(np.concatenate([self.packed, others.packed], axis=1))
        found = self.of_candidates(kept)
        found.is_exact = self.is_exact and others.is_exact
        return found

    def with_prior(self, prior: Array | Known | None) -> "Problem":
        """The same candidates with other prior information (p, p), or without any."""
        return self._with(self.kept, prior)

    def in_unit(self, power: int) -> "Problem":
        """The same problem in a unit in which rows are ``2^power`` times as large."""
        known = None if self.known is None else self.known.in_unit(power)
        return self._with(self.kept.in_unit(power), known)

    def of_candidates(self, kept: Rows | PackedInformation) -> "Problem":
        """The same problem with other candidates in place of its own."""
        return self._with(kept, self.known)

    def _with(self, kept: Rows | PackedInformation, prior: Array | Known | None) -> "Problem":
        """Other candidates about the same parameters, whose entries are as exact as these."""
        found = Problem.of_kept(kept, self.parameters, prior)
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
        return math.ceil(np.sqrt(np.square(self.models.sizes).sum()))

    @property
    def _is_apart(self) -> bool:
        """Whether the prior mixes no models."""
        return self.prior is None or self.models.are_apart(self.prior)

    @cached_property
    def each(self) -> "list[Problem]":
        """The problem of each of several models alone."""
        kept = self.kept
        parts = kept.parts if isinstance(kept, ModelRows) else (kept,)
        found = []
        for part, at in zip(parts, self.models.parts, strict=True):
            known = None if self.known is None else self.known.part(at)
            found.append(Problem.of_kept(part, self.parameters[at], known))
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

    def in_units(self, T: Array) -> "Problem":
        """The same candidates for parameters k' with ``k = T k'``; they have default names.

        Args:
            T: Regular matrix (p, p).
        """
        prior = None if self.known is None else self.known.times(T)
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


def problem_digest(problem: Problem) -> str:
    """SHA-256 of a problem's candidates and prior information, in hexadecimal digits.

    It is that of a line of text, then of numbers as little-endian doubles. Of rows the line is
    "rows N R P", and the numbers are the rows ``A_i / sigma`` (N, R, P); of information it is
    "triangles Q N", and they are the packed triangles (Q, N). M0 (P, P) follows if there is one.
    """
    kept = problem.kept
    if isinstance(kept, Rows):
        words = ("rows", *kept.A.shape)
        numbers = kept.A
    else:
        words = ("triangles", *problem.packed.shape)
        numbers = problem.packed
    found = hashlib.sha256((" ".join(map(str, words)) + "\n").encode())
    for array in (numbers, problem.prior):
        if array is not None:
            found.update(np.ascontiguousarray(array, dtype="<f8").data)
    return found.hexdigest()
