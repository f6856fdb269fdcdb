"""Problems that are made of others or of data frames: formulas, several models, other units."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from criteria import Criterion
from edtk.design.information import Known, ModelRows, Rows
from edtk.design.problem import Problem
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


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


PARENTHESES = re.compile(r"\([^()]*\)")
POWER = re.compile(r"\b[^\W\d]\w*\s*(\*\*|\^)\s*\d+")


class DescribedProblem(Problem):
    """A `Problem` whose candidates are the rows of a data frame.

    Attributes:
        frame: The data frame.
        rows_of: Whitened rows (k, r, p) of other frames with the same columns; None where they are
            not known.
    """

    frame: "pd.DataFrame"
    rows_of: "Callable[[pd.DataFrame], Array] | None" = None

    def __init__(
        self,
        blocks: ArrayLike,
        parameters: tuple[str, ...],
        prior: ArrayLike | None,
        frame: "pd.DataFrame",
        sigma: ArrayLike = 1.0,
    ) -> None:
        super().__init__(blocks, sigma, parameters, prior)
        self.frame = frame

    @classmethod
    def of(cls, problem: Problem, frame: "pd.DataFrame") -> "DescribedProblem":
        """A problem whose candidates are the rows of a frame."""
        found = cls.__new__(cls)
        found._set(problem.kept, problem.parameters, problem.known)
        found.is_exact = problem.is_exact
        found.frame = frame
        return found

    def to_frame(self, design: ArrayLike, name: str = "weight") -> "pd.DataFrame":
        """The rows of a design, with a column for their weights or numbers of repetitions.

        Args:
            design: Weights or counts of the candidates (n,).
            name: What the column is called; where the frame has such a column, an underscore is
                added.
        """
        found = np.asarray(design)
        while name in self.frame.columns:
            name += "_"
        return self.frame.assign(**{name: found})[found > 0]


class FrameProblem(DescribedProblem):
    """A problem of a data frame and a formula of its columns, see `Problem.from_frame`.

    Attributes:
        frame: A copy of the data frame, or of its first row of each experiment.
        formula: The formula, as it was given.
    """

    formula: str

    def __init__(
        self,
        frame: "pd.DataFrame",
        formula: str,
        sigma: ArrayLike | str = 1.0,
        prior: ArrayLike | None = None,
        experiment: str | None = None,
    ) -> None:
        _require_frame(frame)
        matrix = _model_matrix(formula, frame)
        rows = _numbers(matrix)
        if experiment is None:
            blocks = rows[:, None, :]
            told = frame.copy()
        else:
            blocks, firsts = _stacked(rows, frame, experiment)
            told = frame.iloc[firsts].copy()
        own = _noise(told, sigma)
        super().__init__(blocks, tuple(map(str, matrix.columns)), prior, told, own)
        self.formula = formula
        self._spec = matrix.model_spec
        if experiment is None and (isinstance(sigma, str) or np.size(sigma) == 1):
            self.rows_of = lambda other: (
                self.regressors(other)[:, None, :] / np.asarray(_noise(other, sigma))[..., None]
            )

    def regressors(self, frame: "pd.DataFrame") -> Array:
        """The model's regressors (k, p) at the rows of another data frame.

        They are what `criteria.create("I", points=...)` takes: the places to predict at.

        Args:
            frame: A data frame with the columns of the formula.

        Raises:
            ArgumentError: A column is missing, or a value is.
        """
        _require_frame(frame)
        return _numbers(_by_formulaic(self._spec.get_model_matrix, frame))


def _noise(frame: "pd.DataFrame", sigma: ArrayLike | str) -> ArrayLike:
    """The noise of candidates: as it is given, or of a column (n, 1).

    Raises:
        ArgumentError: The frame has no such column.
    """
    if not isinstance(sigma, str):
        return sigma
    if sigma not in frame.columns:
        message = f"{sigma!r} is no column; expected numbers, or one of {', '.join(frame.columns)}"
        raise ArgumentError(message, argument="sigma")
    return frame[sigma].to_numpy()[:, None]


def _require_frame(frame: object) -> None:
    """Reject what is no data frame, or has no rows."""
    import pandas as pd

    if not isinstance(frame, pd.DataFrame) or not len(frame):
        what = "an empty one" if isinstance(frame, pd.DataFrame) else type(frame).__name__
        raise ArgumentError(f"expected a data frame with rows, not {what}", argument="frame")
    twice = frame.columns[frame.columns.duplicated()]
    if len(twice):
        message = f"column {twice[0]!r} is there twice; expected each once"
        raise ArgumentError(message, argument="frame")


def _model_matrix(formula: str, frame: "pd.DataFrame") -> Any:
    """The model matrix of a formula.

    Raises:
        UserError: The package formulaic is not there, or the formula does not fit the frame.
    """
    try:
        import formulaic
    except ImportError as error:
        raise UserError(
            "a formula needs the package formulaic; install it with: pip install 'edtk[frames]'"
        ) from error
    if not isinstance(formula, str) or "~" in formula or not formula.strip():
        raise ArgumentError(
            "expected the right-hand side of a formula alone, such as '1 + x + I(x**2)'",
            argument="formula",
            given=repr(formula),
        )
    power = _lost_power(formula)
    if power:
        raise ArgumentError(
            f"{power} is crossing in a formula, and leaves the column as it is; a power is "
            f"I({power.replace('^', '**')})",
            argument="formula",
            given=repr(formula),
        )
    # Names in a formula are columns; those of the calling code would change what it means.
    return _by_formulaic(
        lambda data: formulaic.model_matrix(formula, data, context={}, na_action="raise"), frame
    )


def _lost_power(formula: str) -> str | None:
    """The first power of a single name that a formula crosses with itself, such as x^2.

    Outside of parentheses `x^2` and `x**2` mean x alone, as in R; nobody wants that.
    """
    outside = formula
    nested = 1
    while nested:
        outside, nested = PARENTHESES.subn("", outside)
    found = POWER.search(outside)
    return None if found is None else found[0].replace(" ", "")


def _by_formulaic(make: Any, frame: "pd.DataFrame") -> Any:
    """What a function of formulaic makes of a frame; its errors become one line."""
    try:
        return make(frame)
    except Exception as error:  # a formula is Python, which may raise anything
        first = next(iter(str(error).splitlines()), type(error).__name__)
        columns = ", ".join(map(str, frame.columns))
        raise ArgumentError(f"{first} The frame has {columns}", argument="formula") from error


def _numbers(matrix: "pd.DataFrame") -> Array:
    """The entries (n, p) of a model matrix.

    Raises:
        ArgumentError: The matrix has no columns, or an entry is not finite.
    """
    if not matrix.shape[1]:
        raise ArgumentError(
            "the formula has no terms; expected one, such as '1'", argument="formula"
        )
    found = matrix.to_numpy(dtype=float)
    wrong = np.argwhere(~np.isfinite(found))
    if len(wrong):
        row, column = wrong[0]
        raise ArgumentError(
            f"{matrix.columns[column]} is not finite in row {matrix.index[row]}", argument="frame"
        )
    return found


def _stacked(rows: Array, frame: "pd.DataFrame", experiment: str) -> tuple[Array, list[int]]:
    """Rows (n, p) as blocks (e, r, p) of experiments, filled with zeros, and each one's first row.

    Raises:
        ArgumentError: There is no such column, or it has no value in some row.
    """
    try:
        hash(experiment)
    except TypeError as error:
        message = f"expected the name of a column, not {type(experiment).__name__}"
        raise ArgumentError(message, argument="experiment") from error
    if experiment not in frame.columns or frame[experiment].isna().any():
        raise ArgumentError(
            f"expected a column without gaps; the frame has {', '.join(map(str, frame.columns))}",
            argument="experiment",
            given=repr(experiment),
        )
    numbers = frame.groupby(experiment, sort=False).ngroup().to_numpy()
    places = frame.groupby(experiment, sort=False).cumcount().to_numpy()
    blocks = np.zeros((numbers.max() + 1, places.max() + 1, rows.shape[1]))
    blocks[numbers, places] = rows
    return blocks, np.flatnonzero(places == 0).tolist()


@dataclass(frozen=True, eq=False)
class Whitened:
    """A problem for parameters k' with ``k = T k'``.

    Rows of a model such as a polynomial far from the origin are nearly dependent. Their information
    has the square of their condition number, and no digits left. So k' replaces k before any
    information is formed; its squares lose nothing.

    Attributes:
        problem: The candidates, for k'.
        T: Regular matrix (p, p), from a QR factorization of the rows.
        rounding: Bounds (n,) on the rounding ``|E_i|`` of the candidates' rows ``A_i T``; where
            there are no rows, on that of their information ``T' M_i T``.
    """

    problem: Problem
    T: Array
    rounding: Array

    @classmethod
    def of(cls, problem: Problem, needed: bool = False, as_rows: bool = False) -> "Whitened | None":
        """Whiten a problem, once; None where its squares are good enough as they are.

        Args:
            problem: The candidates.
            needed: Whether a criterion asks for it, however good they are.
            as_rows: Whether rows are to stay rows, however many they are; they are not shared then.
        """
        good = problem.conditioning.is_well and not problem.has_distant_units
        if good and not needed:
            return None
        if as_rows:
            return cls.by(problem, problem.conditioning.whitener, as_rows)
        if problem not in _known:
            _known[problem] = cls.by(problem, problem.conditioning.whitener)
        return _known[problem]

    @classmethod
    def by(cls, problem: Problem, T: Array, as_rows: bool = False) -> "Whitened":
        """The problem for parameters k' with ``k = T k'``, whatever T (p, p) is."""
        rounding = problem.kept.rounding_of_times(T)
        if not isinstance(problem.kept, Rows):
            return cls(problem.in_units(T), T, rounding)
        kept = problem.kept.whitened(T, problem.conditioning.open_columns, as_rows)
        prior = None if problem.known is None else problem.known.times(T)
        return cls(Problem.of_kept(kept, None, prior), T, rounding)


# Several criteria of one problem share the work; it is forgotten with the problem.
_known: WeakKeyDictionary[Problem, Whitened] = WeakKeyDictionary()


def absorb_prior(
    problem: Problem, criterion: Criterion, size: float = 1.0
) -> tuple[Problem, Criterion]:
    """Put the prior precision of a Bayesian criterion into the problem.

    ``phi(M + R)`` of a plan of m experiments is phi of their information where each of them has
    ``R/m`` besides its own; so every algorithm sees a homogeneous criterion. Of other criteria
    nothing changes.

    Args:
        problem: The candidates.
        criterion: Any criterion.
        size: Number m of experiments that share the prior; one where weights of sum one are sought.

    Returns:
        The problem with more prior information, and phi; or both as they were given.
    """
    criterion.require_order(problem.p)
    if criterion.precision is None:
        return problem, criterion
    own = criterion.precision / size
    prior = Known.of(own) if problem.known is None else problem.known.plus(own)
    return problem.with_prior(prior), criterion.without_prior
