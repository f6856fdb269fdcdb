"""A model as a text: a nonlinear one of numbers, or a linear one of a data frame's columns.

The first, such as "Vmax * x / (Km + x)", has a small grammar that runs no code. The second, such as
"1 + x + C(group)", is that of the package formulaic.
"""

import ast
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

MOST_CHARACTERS = 2000
CONSTANTS = {"pi": np.pi}
# Functions of numpy with their derivatives, from the argument u and the value f(u).
DERIVATIVES: dict[str, Callable[[Any, Any], Any]] = {
    "exp": lambda u, f: f,
    "expm1": lambda u, f: f + 1,
    "log": lambda u, f: 1 / u,
    "log1p": lambda u, f: 1 / (1 + u),
    "log2": lambda u, f: 1 / (np.log(2.0) * u),
    "log10": lambda u, f: 1 / (np.log(10.0) * u),
    "sqrt": lambda u, f: 0.5 / f,
    "sin": lambda u, f: np.cos(u),
    "cos": lambda u, f: -np.sin(u),
    "tan": lambda u, f: 1 + f**2,
    "sinh": lambda u, f: np.cosh(u),
    "cosh": lambda u, f: np.sinh(u),
    "tanh": lambda u, f: 1 - f**2,
    "arcsin": lambda u, f: 1 / np.sqrt(1 - u**2),
    "arccos": lambda u, f: -1 / np.sqrt(1 - u**2),
    "arctan": lambda u, f: 1 / (1 + u**2),
}
PARENTHESES = re.compile(r"\([^()]*\)")
POWER = re.compile(r"\b[^\W\d]\w*\s*(\*\*|\^)\s*\d+")
SIGNS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.UAdd, ast.USub)


@dataclass(frozen=True, eq=False)
class Formula:
    """A model of variables x and parameters theta.

    Attributes:
        text: As it was given.
        variables: Names (d,) of the variables.
        parameters: Names (p,) of the parameters.
    """

    text: str
    variables: tuple[str, ...]
    parameters: tuple[str, ...]

    @classmethod
    def of_each(
        cls, texts: Sequence[str], parameters: Sequence[str], variables: Sequence[str] | None = None
    ) -> "list[Formula]":
        """Read a formula for each of several responses, which share parameters and variables.

        Powers are ``**`` or ``^``. Functions are those of numpy: exp, log, sqrt, sin and so on.

        Args:
            texts: The formulas.
            parameters: Names of the parameters, in the order of theta.
            variables: Names of the variables, in the order of the columns of the points. They are
                needed only where there are several: all other names are variables.

        Raises:
            ArgumentError: A text is no such formula, or a name is missing or unknown.
        """
        if not texts or not all(isinstance(text, str) for text in texts):
            message = "expected a function, a formula, or a list of formulas"
            raise ArgumentError(message, argument="f")
        found = sorted({name for text in texts for name in _names(_tree(text))})
        shown = ", ".join(map(repr, texts))
        unused = [name for name in parameters if name not in found]
        if unused:
            message = f"{shown} has no parameter {unused[0]!r}; it has {', '.join(found) or 'none'}"
            raise ArgumentError(message, argument="parameters")
        others = [name for name in found if name not in parameters and name not in CONSTANTS]
        if variables is None and len(others) > 1:
            known = ", ".join(others)
            message = (
                f"{shown} has {known} beside the parameters; expected one variable, or all of them "
                "in the order of the points' columns"
            )
            raise ArgumentError(message, argument="variables")
        columns = tuple(others) if variables is None else tuple(variables)
        unknown = [name for name in others if name not in columns]
        if unknown:
            known = f"expected parameters ({', '.join(parameters)}) and variables"
            message = f"{shown} has {unknown[0]!r}; {known} ({', '.join(columns)})"
            raise ArgumentError(message, argument="f")
        return [cls(text, columns, tuple(parameters)) for text in texts]

    def __call__(self, x: Array, theta: Array) -> Array:
        """Values (..., n) at points x (n, d) for theta (p,), or for k of them at once (p, k, 1)."""
        value = self._followed(x, theta, ()).value
        return np.broadcast_to(value, (*np.shape(theta)[1:-1], len(x)))

    def gradient(self, x: Array, theta: Array) -> list[Any]:
        """Derivatives by each parameter, (..., n) each, at points x (n, d), see `__call__`.

        They are exact: those of sums, products, powers and functions are put together as the
        formula is. Points may be whatever has arithmetic, such as polynomials or intervals.
        """
        slopes = self._followed(x, theta, self.parameters).slopes
        zero = 0.0 * x[:, 0] + 0.0 * theta[0]
        return [zero + slopes[name] if name in slopes else zero for name in self.parameters]

    def _followed(self, x: Array, theta: Array, by: Sequence[str]) -> "_Dual":
        """The value with its derivatives by some of the parameters."""
        known = {name: _Dual(value, {}) for name, value in CONSTANTS.items()}
        known |= {name: _Dual(x[:, i], {}) for i, name in enumerate(self.variables)}
        known |= {
            name: _Dual(value, {name: 1.0} if name in by else {})
            for name, value in zip(self.parameters, theta, strict=True)
        }
        # Values that are not finite are told by their points, and not as warnings.
        with np.errstate(all="ignore"):
            return _evaluated(_tree(self.text), known)


@dataclass(frozen=True, eq=False)
class _Dual:
    """A value, and its derivatives by those parameters on which it depends."""

    value: Any
    slopes: Mapping[str, Any]

    def scaled(self, factor: Any) -> dict[str, Any]:
        """The derivatives times a factor."""
        return {name: factor * slope for name, slope in self.slopes.items()}


def _sum(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """The sum of two sets of derivatives."""
    both = {name: first[name] + second[name] for name in first if name in second}
    return {**first, **second, **both}


@lru_cache(maxsize=64)
def _tree(text: str) -> ast.AST:
    """The syntax tree of a formula.

    Raises:
        ArgumentError: The text is no formula of this grammar.
    """
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    if len(text) > MOST_CHARACTERS:
        message = f"{shown!r} is longer than {MOST_CHARACTERS} characters"
        raise ArgumentError(message, argument="f")
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(re.sub(r"\^", "**", text).strip(), mode="eval").body
        _check(tree)
    except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        words = error.msg if isinstance(error, SyntaxError) else str(error)
        message = f"{shown!r} is no formula: {words}"
        raise ArgumentError(message, argument="f") from error
    return tree


def _check(node: ast.AST) -> None:
    """Refuse whatever is not of the grammar.

    Raises:
        ValueError: A part of the tree is not.
    """
    match node:
        case ast.Name():
            return
        case ast.Constant(value=int() | float() as number):
            float(number)  # an integer may have more digits than a number of the machine
        case ast.UnaryOp(op=sign, operand=given) if isinstance(sign, SIGNS):
            _check(given)
        case ast.BinOp(left=left, op=sign, right=right) if isinstance(sign, SIGNS):
            _check(left)
            _check(right)
        case ast.Call(func=ast.Name(id=name), args=[given], keywords=[]):
            if name not in DERIVATIVES:
                raise ValueError(
                    f"there is no function {name!r}; expected {', '.join(DERIVATIVES)}"
                )
            _check(given)
        case _:
            part = ast.unparse(node)[:40] if isinstance(node, ast.expr) else "a part"
            raise ValueError(f"expected numbers, names, + - * / ** and functions, not {part!r}")


def _names(node: ast.AST) -> set[str]:
    """Names of variables and parameters in a tree."""
    called = {id(part.func) for part in ast.walk(node) if isinstance(part, ast.Call)}
    return {
        part.id for part in ast.walk(node) if isinstance(part, ast.Name) and id(part) not in called
    }


def _evaluated(node: ast.AST, known: Mapping[str, _Dual]) -> _Dual:
    """The value of a checked tree with its derivatives."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return _Dual(np.float64(number), {})
        case ast.Name(id=name):
            return known[name]
        case ast.UnaryOp(op=ast.USub(), operand=given):
            u = _evaluated(given, known)
            return _Dual(-u.value, u.scaled(-1.0))
        case ast.UnaryOp(operand=given):
            return _evaluated(given, known)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _power(_evaluated(left, known), right, known)
        case ast.BinOp(left=left, op=sign, right=right):
            return _combined(_evaluated(left, known), sign, _evaluated(right, known))
        case ast.Call(func=ast.Name(id=name), args=[given]):
            u = _evaluated(given, known)
            f = getattr(np, name)(u.value)
            return _Dual(f, u.scaled(DERIVATIVES[name](u.value, f)) if u.slopes else {})
    raise AssertionError("the tree was checked")


def _combined(u: _Dual, sign: ast.AST, v: _Dual) -> _Dual:
    """The sum, difference, product or quotient of two."""
    match sign:
        case ast.Add():
            return _Dual(u.value + v.value, _sum(u.slopes, v.slopes))
        case ast.Sub():
            return _Dual(u.value - v.value, _sum(u.slopes, v.scaled(-1.0)))
        case ast.Mult():
            return _Dual(u.value * v.value, _sum(u.scaled(v.value), v.scaled(u.value)))
    quotient = u.value / v.value
    return _Dual(quotient, _sum(u.scaled(1 / v.value), v.scaled(-quotient / v.value)))


def _power(u: _Dual, exponent: ast.AST, known: Mapping[str, _Dual]) -> _Dual:
    """``u^v``; the logarithm of u is taken only where v depends on parameters."""
    v = _evaluated(exponent, known)
    if not v.slopes:
        power = v.value
        if isinstance(power, float) and power.is_integer():
            power = int(power)
        slopes = u.scaled(v.value * u.value ** (power - 1)) if u.slopes else {}
        return _Dual(u.value**power, slopes)
    value = u.value**v.value
    slopes = u.scaled(v.value * u.value ** (v.value - 1)) if u.slopes else {}
    return _Dual(value, _sum(slopes, v.scaled(_by_exponent(u.value, v.value, value))))


def _by_exponent(u: Any, v: Any, power: Any) -> Any:
    """``u^v log u``, which goes to zero with u where v is positive."""
    found = power * np.log(u)
    if isinstance(u, np.ndarray) and u.dtype.kind == "f":
        return np.where((u == 0) & (v > 0), 0.0, found)
    return found


@dataclass(frozen=True, eq=False)
class LinearFormula:
    """A linear model of a data frame's columns, by formulaic, at the rows of the frame.

    Attributes:
        text: As it was given.
        blocks: Regressors (n, r, p) of experiments.
        parameters: Names (p,) of the columns of the model matrix.
        frame: A copy of the data frame, or of its first row of each experiment.
        spec: What makes the model matrix of other frames.
    """

    text: str
    blocks: Array
    parameters: tuple[str, ...]
    frame: "pd.DataFrame"
    spec: Any

    @classmethod
    def of(cls, frame: "pd.DataFrame", text: str, experiment: str | None) -> "LinearFormula":
        """Read a formula, see `Problem.from_frame`.

        Raises:
            UserError: The package formulaic is not there, or formula and frame do not fit.
        """
        _require_frame(frame)
        matrix = _model_matrix(text, frame)
        blocks = _numbers(matrix)[:, None, :]
        told = frame.copy()
        if experiment is not None:
            blocks, firsts = _stacked(blocks[:, 0], frame, experiment)
            told = frame.iloc[firsts].copy()
        return cls(text, blocks, tuple(map(str, matrix.columns)), told, matrix.model_spec)

    def regressors(self, frame: "pd.DataFrame") -> Array:
        """Regressors (k, p) at the rows of another data frame.

        Raises:
            ArgumentError: A column is missing, or a value is, or a factor has a level of its own.
        """
        from formulaic.errors import DataMismatchWarning

        _require_frame(frame)
        # A level that no candidate has is a warning of formulaic's, which takes it for the first.
        with warnings.catch_warnings():
            warnings.simplefilter("error", DataMismatchWarning)
            try:
                return _numbers(_by_formulaic(self.spec.get_model_matrix, frame))
            except ArgumentError as error:
                if isinstance(error.__cause__, DataMismatchWarning):
                    raise self._of_other_level(frame) from error
                raise

    @property
    def variables(self) -> frozenset[str]:
        """Names of the columns that the formula needs."""
        return frozenset(map(str, self.spec.required_variables))

    @property
    def coded(self) -> frozenset[str]:
        """Names of those that it knows at their levels alone: k of C(k), not x of C(x > 0)."""
        return frozenset(
            name
            for names, levels in self._coded_factors()
            for name in names
            if set(self.frame[name]) <= set(levels)
        )

    def _coded_factors(self) -> list[tuple[list[str], list[Any]]]:
        """Columns of which each factor with levels is made, and its levels."""
        of = {str(factor): names for factor, names in self.spec.factor_variables.items()}
        return [
            ([name for name in map(str, of[factor]) if name in self.variables], state["categories"])
            for factor, (_, state) in self.spec.encoder_state.items()
            if "categories" in state
        ]

    def _of_other_level(self, frame: "pd.DataFrame") -> ArgumentError:
        """The error of a row with a level that no candidate has."""
        message = "a row has a level that no candidate has"
        for names, levels in self._coded_factors():
            for name in names:
                known = set(self.frame[name])
                other = [value for value in frame[name] if value not in known]
                if other:
                    expected = ", ".join(map(str, levels))
                    message = f"{name} is {other[0]} in a row; expected {expected}"
        return ArgumentError(message, argument="frame")


def noise_of_frame(frame: "pd.DataFrame", sigma: ArrayLike | str) -> ArrayLike:
    """The noise of candidates: as it is given, or of a column (n, 1).

    Raises:
        ArgumentError: The frame has no such column.
    """
    if not isinstance(sigma, str):
        return sigma
    if sigma not in frame.columns:
        columns = ", ".join(map(str, frame.columns))
        message = f"{sigma!r} is no column; expected numbers, or one of {columns}"
        raise ArgumentError(message, argument="sigma")
    return frame[sigma].to_numpy()[:, None]


def free_name(name: str, frame: "pd.DataFrame") -> str:
    """A name of a new column: with underscores behind it, where the frame has such a column."""
    while name in frame.columns:
        name += "_"
    return name


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
