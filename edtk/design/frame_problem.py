"""Candidates from a data frame, by a formula of its columns."""

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.problem import Problem
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


PARENTHESES = re.compile(r"\([^()]*\)")
POWER = re.compile(r"\b[^\W\d]\w*\s*(\*\*|\^)\s*\d+")


class FrameProblem(Problem):
    """A `Problem` whose candidates are the rows of a data frame, see `Problem.from_frame`.

    Attributes:
        frame: A copy of the data frame, or of its first row of each experiment.
        formula: The formula, as it was given.
    """

    frame: "pd.DataFrame"
    formula: str

    def __init__(
        self,
        frame: "pd.DataFrame",
        formula: str,
        sigma: ArrayLike = 1.0,
        prior: ArrayLike | None = None,
        experiment: str | None = None,
    ) -> None:
        _require_frame(frame)
        matrix = _model_matrix(formula, frame)
        rows = _numbers(matrix)
        if experiment is None:
            blocks = rows[:, None, :]
            self.frame = frame.copy()
        else:
            blocks, firsts = _stacked(rows, frame, experiment)
            self.frame = frame.iloc[firsts].copy()
        super().__init__(blocks, sigma, tuple(map(str, matrix.columns)), prior)
        self.formula = formula
        self._spec = matrix.model_spec

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
