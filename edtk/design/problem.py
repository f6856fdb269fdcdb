"""A design problem: candidate experiments, of arrays, tables or models. It knows no robot."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.linalg.spectrum import is_semidefinite
from edtk.design.formula import LinearFormula, free_name, noise_of_frame
from edtk.design.information import Known, ModelRows, Rows, nearly_equal
from edtk.design.theta_box import Robust, RowsAt, RowsOfEach, Scale, Sites, told_names
from edtk.design.weighted_candidates import (
    WeightedCandidates,
    packed_information,
    rows_of_blocks,
)
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError, real_numbers
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

SYMMETRIC = 1e-9  # difference across the diagonal that is rounding


class RankDeficientError(ValueError):
    """The candidates cannot identify all parameters; the message names the open directions.

    Attributes:
        of_interest: Whether a criterion asked for some of the parameters only.
    """

    def __init__(self, message: str, of_interest: bool = False) -> None:
        super().__init__(message)
        self.of_interest = of_interest


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


def require_information(prior: Array | None) -> None:
    """Refuse a prior that no measurements can have.

    Raises:
        ValueError: It is not finite, symmetric and positive semidefinite.
    """
    if prior is None:
        return
    is_even = np.isfinite(prior).all() and nearly_equal(prior, prior.T, SYMMETRIC)
    if not is_even or not is_semidefinite(prior):
        raise UserError("the prior must be finite, symmetric and positive semidefinite")


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

    robust: Robust | None = None  # several models side by side, and what a design is for
    frame: "pd.DataFrame | None" = None  # whose rows are the candidates
    # Whitened rows (k, r, p) of other frames with the same columns; None where they are not known.
    rows_of: "Callable[[pd.DataFrame], Array] | None" = None
    _linear: LinearFormula | None = None
    # By what rows were divided, (n, rows) or one number; None where terms have no rows like theirs.
    noise: Array | float | None = 1.0

    @checked
    def __init__(
        self,
        blocks: ArrayLike,
        sigma: ArrayLike = 1.0,
        parameters: tuple[str, ...] | None = None,
        prior: ArrayLike | None = None,
    ) -> None:
        rows = rows_of_blocks(blocks, sigma)
        self._set(rows, parameters, prior)
        shape = rows.A.shape[:2]
        told = np.asarray(sigma, dtype=float)
        each = told[:, None] if told.shape == shape[:1] != shape[1:] else told
        self.noise = np.broadcast_to(each, shape)
        self.is_exact = True
        named_twice = {name for name in self.parameters if self.parameters.count(name) > 1}
        if named_twice:
            raise UserError(f"several parameters have the name {min(named_twice)!r}")
        require_information(self.prior)

    def with_prior(self, prior: Array | Known | None) -> Self:
        """The same candidates with other prior information (p, p), or without any."""
        found = super().with_prior(prior)
        found.noise = self.noise
        return found

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
        linear = LinearFormula.of(frame, formula, experiment)
        own = noise_of_frame(linear.frame, sigma)
        found = cls(linear.blocks, own, linear.parameters, prior)
        found.frame = linear.frame
        found._linear = linear
        if experiment is None and (isinstance(sigma, str) or np.size(sigma) == 1):
            found.rows_of = lambda other: (
                linear.regressors(other)[:, None, :]
                / np.asarray(noise_of_frame(other, sigma))[..., None]
            )
        return found

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
                candidate (n,) or (n, k), the column of a data frame that has it, or a function of
                x, or of x and theta. For other
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
        from edtk.design.of_model import of_model  # it loads scipy

        sites, own = CandidateSites.of(candidates, variables, sigma)
        return of_model(
            sites,
            f,
            theta,
            robust,
            weights,
            prior,
            family=family,
            link=link,
            sigma=own,
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
        sigma: ArrayLike | Callable[..., ArrayLike] = 1.0,
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
            sigma: See `of_model`; a function is one of x alone.
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
        from edtk.design.of_model import of_rivals  # it loads scipy

        sites, own = CandidateSites.of(candidates, variables, sigma)
        return of_rivals(
            sites,
            f,
            theta,
            rival,
            rival_theta,
            parameters,
            family=family,
            link=link,
            sigma=own,
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

    def headline(self) -> str:
        """Number of candidates and of parameters."""
        candidates = "1 candidate" if self.n == 1 else f"{self.n} candidates"
        parameters = "1 parameter" if self.p == 1 else f"{self.p} parameters"
        return f"{candidates}, {parameters} ({', '.join(self.parameters)})"

    @property
    def formula(self) -> str | None:
        """The formula of a data frame's columns, as it was given; None where there is none."""
        return None if self._linear is None else self._linear.text

    @property
    def needed(self) -> "pd.DataFrame | None":
        """The columns of the frame that the model is made of."""
        if self.frame is None or self._linear is None:
            return self.frame
        return self.frame[[name for name in self.frame if name in self._linear.variables]]

    @property
    def coded(self) -> frozenset[str]:
        """Names of the columns that a formula knows at their levels alone, such as k of C(k)."""
        return frozenset() if self._linear is None else self._linear.coded

    def regressors(self, frame: "pd.DataFrame") -> Array:
        """The regressors (k, p) of a formula at the rows of another data frame.

        They are what `criteria.create("I", points=...)` takes: the places to predict at.

        Args:
            frame: A data frame with the columns of the formula.

        Raises:
            ArgumentError: A column is missing, or a value is.
            UserError: The problem is none of `from_frame`.
        """
        if self._linear is None:
            raise UserError("a problem without a formula has no regressors at other places")
        return self._linear.regressors(frame)

    def settings(self, chosen: Indices) -> "pd.DataFrame":
        """A table with a row for each of chosen candidates (k,): that of the frame, or a number."""
        import pandas as pd

        if self.frame is None:
            return pd.DataFrame({"candidate": chosen})
        return self.frame.iloc[chosen].reset_index(drop=True)

    def to_frame(self, design: ArrayLike, name: str = "weight") -> "pd.DataFrame":
        """The candidates of a design, with a column for their weights or numbers of repetitions.

        Args:
            design: Weights or counts of the candidates (n,).
            name: What the column is called; where the frame has such a column, an underscore is
                added.
        """
        import pandas as pd

        found = np.asarray(design)
        if self.frame is None:
            index = pd.Index(np.flatnonzero(found), name="candidate")
            return pd.DataFrame({name: found[index]}, index=index)
        return self.frame.assign(**{free_name(name, self.frame): found})[found > 0]

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
        found = self.conditioning
        if found.fades:
            how = "" if isinstance(self.kept, Rows) else ", or give rows instead of information"
            raise RankDeficientError(
                "the candidates together do not identify all parameters to working precision: "
                f"their condition number is {found.number:.1e}; centre or scale the "
                f"regressors{how}"
            )
        if criterion is not None and not criterion.needs_all:
            missing = missing_of(self, criterion)
            if missing:
                raise RankDeficientError(
                    "the candidates together cannot identify what is of interest: no candidate "
                    f"tells {' or '.join(missing)}",
                    of_interest=True,
                )
        elif found.is_open.any():
            raise RankDeficientError(
                "the candidates together cannot identify all parameters: no candidate excites "
                f"{' or '.join(found.directions(self.parameters))}"
            )


@checked
def several_models(problems: Sequence[Problem]) -> Problem:
    """Put the models of the same candidates side by side.

    The information matrix is block diagonal, ``diag(M_1, .., M_k)`` with a block a model. Criteria
    with `sizes`, such as `criteria.create("minimax", criteria=["D", "D"], sizes=[2, 3])`, are about
    one block each.

    Args:
        problems: The same n candidates under each model, in the same order.

    Returns:
        A problem of ``p_1 + .. + p_k`` parameters, named as in the models; a name that several
        models use is followed by the number of its model, as in "k1 (2)".

    Raises:
        ArgumentError: There is no model, or the numbers of candidates differ.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1, 1, 41)
        >>> line, parabola = (np.vander(x, p, increasing=True)[:, None, :] for p in (2, 3))
        >>> both = edtk.several_models([edtk.Problem(line), edtk.Problem(parabola)])
        >>> worst = edtk.criteria.create("minimax", criteria=["D", "D"], sizes=[2, 3])
        >>> x[edtk.relax(both, worst).weights > 0.1].tolist()
        [-1.0, 0.0, 1.0]
    """
    from scipy.linalg import block_diag

    if not len(problems):
        raise ArgumentError("expected at least one model", argument="problems")
    counts = [problem.n for problem in problems]
    if len(set(counts)) > 1:
        raise ArgumentError(
            f"the models have {', '.join(map(str, counts))} candidates; expected as many of each",
            argument="problems",
        )
    has_prior = any(problem.prior is not None for problem in problems)
    prior = block_diag(*(_prior_of(problem) for problem in problems)) if has_prior else None
    kept = ModelRows([_rows_of(problem) for problem in problems])
    found = Problem.of_kept(kept, _names(problems), prior)
    if not all(problem.noise is not None and np.all(problem.noise == 1.0) for problem in problems):
        found.noise = None
    found.is_exact = all(problem.is_exact for problem in problems)
    return found


def _rows_of(problem: Problem) -> Rows:
    """The rows of a problem, or factors of its information."""
    return problem.kept if isinstance(problem.kept, Rows) else Rows(problem.factors())


def _prior_of(problem: Problem) -> Array:
    """Prior information (p, p), zeros where there is none."""
    return np.zeros((problem.p, problem.p)) if problem.prior is None else problem.prior


def _names(problems: Sequence[Problem]) -> tuple[str, ...]:
    """The parameters' names, made different."""
    every = [name for problem in problems for name in problem.parameters]
    return tuple(
        f"{name} ({i})" if every.count(name) > 1 else name
        for i, problem in enumerate(problems, start=1)
        for name in problem.parameters
    )


@dataclass(frozen=True, eq=False)
class CandidateSites(Sites[Problem]):
    """Candidates, at all of which a model is tried."""

    @classmethod
    def of(
        cls,
        candidates: Any,
        variables: str | Sequence[str] | None,
        sigma: Any,
    ) -> tuple["CandidateSites", Any]:
        """Points (n, d) or (n,), or a data frame whose columns are the variables.

        Args:
            candidates: The points.
            variables: Names (d,).
            sigma: Noise; the name of a column that has it is none of a variable.

        Returns:
            The sites, with the noise if there is one for each candidate, and that of the model.

        Raises:
            ArgumentError: They are no finite numbers, or there is no such column.
        """
        if isinstance(sigma, str) and hasattr(candidates, "columns"):
            column, sigma = sigma, noise_of_frame(candidates, sigma)
            candidates = candidates.drop(columns=column)
        names = tuple(map(str, candidates.columns)) if hasattr(candidates, "columns") else None
        try:
            points = np.asarray(candidates, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            message = "expected numbers, a row for each candidate, or a data frame"
            if names is not None:
                texts = candidates.select_dtypes(exclude=["number", "bool"]).columns
                message = f"column {texts[0]!r} has no numbers; leave it out"
            raise ArgumentError(message, argument="candidates") from error
        points = points[:, None] if points.ndim == 1 else points
        if points.ndim != 2 or 0 in points.shape:
            message = f"expected points (n, d) or (n,), not of shape {points.shape}"
            raise ArgumentError(message, argument="candidates")
        lost = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(lost):
            raise ArgumentError(f"point {lost[0]} is not finite", argument="candidates")
        is_array = sigma is not None and not callable(sigma) and not isinstance(sigma, str)
        noise = real_numbers(sigma, "sigma") if is_array else np.empty(())
        named = told_names(names, variables)
        if noise.shape[:1] != (len(points),) or noise.shape == (1,):
            return cls(points, named, None), sigma
        return cls(points, named, noise), 1.0

    @property
    def frame(self) -> "pd.DataFrame":
        """The candidates as a table."""
        import pandas as pd

        assert self.variables is not None
        return pd.DataFrame(self.trial, columns=list(self.variables))

    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> Problem:
        """The candidates under one model."""
        sigma = 1.0 if self.noise is None else self.noise
        found = Problem(rows(self.trial), sigma, tuple(parameters), prior)
        found.frame = self.frame
        if self.noise is None:
            found.rows_of = lambda other: np.asarray(rows(other.to_numpy(dtype=float)))
        return found

    def scaled(self, found: Problem, scale: Scale) -> None:
        """Tell a problem by what its rows were divided."""
        factor = scale(self.trial)
        assert found.noise is not None
        found.noise = None if factor is None else found.noise * factor

    def together(self, models: Sequence[Problem], rows_of_each: RowsOfEach) -> Problem:
        """The candidates under several models."""
        found = several_models(models)
        found.frame = self.frame
        return found

    def allowed(self, x: Array) -> Mask:
        """All are."""
        return np.ones(len(x), dtype=bool)


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
