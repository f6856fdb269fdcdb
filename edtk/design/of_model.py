"""Problems and regions of nonlinear models: at one theta, or at several of them at once."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from edtk.design.information import side_by_side
from edtk.design.nonlinear_model import Model, NonlinearModel, Robust, nonlinear_model
from edtk.design.problem import Problem
from edtk.design.problems import DescribedProblem, several_models
from edtk.design.region import Region, user_functions
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

ROBUST = ("bayes", "maximin")
TRIED = 128  # points of a box at which a model is tried


def problem_of_model(
    f: Model,
    theta: Any,
    candidates: "ArrayLike | pd.DataFrame",
    robust: str | None,
    weights: ArrayLike | None,
    prior: ArrayLike | None,
    variables: Sequence[str] | None,
    **options: Any,
) -> Problem:
    """Make the problem that `Problem.of_model` describes."""
    points, columns = _points(candidates)
    names = columns if variables is None else tuple(variables)
    models = _models(f, _thetas(theta, robust, weights), points, names, options)
    frame = _frame(points, models[0].variables)
    each = [
        DescribedProblem(model.rows(points), model.parameters, prior, frame) for model in models
    ]
    if robust is None:
        each[0].rows_of = lambda other: models[0].rows(other.to_numpy(dtype=float))
        return each[0]
    found = DescribedProblem.of(several_models(each), frame)
    found.robust = Robust(robust, tuple(each), _shares(weights, len(each)))
    return found


def region_of_model(
    f: Model,
    theta: Any,
    box: Any,
    robust: str | None,
    weights: ArrayLike | None,
    prior: ArrayLike | None,
    variables: Sequence[str] | None,
    constraints: Any,
    **options: Any,
) -> Region:
    """Make the region that `Region.of_model` describes."""
    low, high, columns = _limits(box)
    names = columns if variables is None else tuple(variables)
    halton = qmc.Halton(len(low), scramble=False).random(TRIED)
    points = low + (high - low) * halton
    for constraint in user_functions(constraints, "constraints"):
        kept = constraint(points).reshape(len(points), -1).min(axis=1) >= 0
        points = points[kept] if kept.any() else points
    models = _models(f, _thetas(theta, robust, weights), points, names, options)

    def region(rows: Callable[[Any], Any], parameters: Sequence[str], known: Any) -> Region:
        return Region(
            rows,
            low,
            high,
            constraints=constraints,
            parameters=parameters,
            prior=known,
            variables=models[0].variables,
        )

    each = [region(model.rows, model.parameters, prior) for model in models]
    if robust is None:
        return each[0]
    one = several_models([alone.problem(points[:1]) for alone in each])

    def rows(x: Array) -> Array:
        return side_by_side([model.rows(x) for model in models])

    found = region(rows, one.parameters, one.prior)
    found.robust = Robust(robust, tuple(each), _shares(weights, len(each)))
    return found


def _models(
    f: Model,
    thetas: Sequence[Any],
    points: Array,
    variables: Sequence[str] | None,
    options: Mapping[str, Any],
) -> list[NonlinearModel]:
    """The model at each theta; where they have names, all are in the order of the first."""
    options = dict(options)
    if isinstance(thetas[0], Mapping):
        options["parameters"] = options.get("parameters") or tuple(thetas[0])
    return [nonlinear_model(f, theta, points, variables=variables, **options) for theta in thetas]


def _points(candidates: "ArrayLike | pd.DataFrame") -> tuple[Array, tuple[str, ...] | None]:
    """Points (n, d), and the names of their variables where they are told.

    Raises:
        ArgumentError: They are no numbers.
    """
    names = None
    if hasattr(candidates, "columns"):
        names = tuple(map(str, candidates.columns))
    try:
        points = np.asarray(candidates, dtype=float)
    except (TypeError, ValueError) as error:
        raise ArgumentError("expected numbers", argument="candidates") from error
    points = points[:, None] if points.ndim == 1 else points
    if points.ndim != 2 or 0 in points.shape or not np.isfinite(points).all():
        message = f"expected finite points (n, d) or (n,), not of shape {points.shape}"
        raise ArgumentError(message, argument="candidates")
    return points, names


def _limits(box: Any) -> tuple[Array, Array, tuple[str, ...] | None]:
    """Lower and upper bounds (d,) of variables, and their names where they are told.

    Raises:
        ArgumentError: It is not one pair, or a pair for each variable.
    """
    names = None
    if isinstance(box, Mapping):
        names = tuple(box)
        box = list(box.values())
    try:
        pairs = np.atleast_2d(np.asarray(box, dtype=float))
    except (TypeError, ValueError) as error:
        raise ArgumentError("expected (low, high) of each variable", argument="box") from error
    fits = pairs.ndim == 2 and pairs.shape[1] == 2 and np.isfinite(pairs).all()
    if not fits or not (pairs[:, 0] < pairs[:, 1]).all():
        message = "expected finite (low, high) of each variable, low below high"
        raise ArgumentError(message, argument="box")
    return pairs[:, 0], pairs[:, 1], names


def _thetas(theta: Any, robust: str | None, weights: ArrayLike | None) -> list[Any]:
    """The parameters of each model.

    Raises:
        ArgumentError: There are several, and nothing says for what; or one, where several are
            expected.
    """
    is_list = isinstance(theta, Sequence) and len(theta) and isinstance(theta[0], Mapping)
    try:
        several = is_list or (not isinstance(theta, Mapping) and np.ndim(theta) == 2)
    except ValueError as error:
        message = "expected as many numbers for each model"
        raise ArgumentError(message, argument="theta") from error
    if robust is None:
        if several:
            message = f"several of them; expected robust beside it, {' or '.join(ROBUST)}"
            raise ArgumentError(message, argument="theta")
        if weights is not None:
            raise ArgumentError("expected robust='bayes' beside it", argument="weights")
        return [theta]
    if robust not in ROBUST:
        message = f"expected {' or '.join(ROBUST)}"
        raise ArgumentError(message, argument="robust", given=robust)
    if not several or not len(theta):
        raise ArgumentError(f"expected a list of them for robust={robust!r}", argument="theta")
    if robust == "maximin" and weights is not None:
        message = "the worst of several models has no weights; expected robust='bayes'"
        raise ArgumentError(message, argument="weights")
    return list(theta)


def _shares(weights: ArrayLike | None, k: int) -> Array:
    """Weights (k,) of sum one.

    Raises:
        ArgumentError: They are not positive, or not as many as models.
    """
    message = f"expected a positive number for each of {k} theta"
    try:
        found = np.ones(k) if weights is None else np.asarray(weights, dtype=float)
    except (TypeError, ValueError) as error:
        raise ArgumentError(message, argument="weights") from error
    if found.shape != (k,) or not (np.isfinite(found) & (found > 0)).all():
        raise ArgumentError(message, argument="weights")
    return found / found.sum()


def _frame(points: Array, variables: Sequence[str]) -> "pd.DataFrame":
    """Candidates as a table."""
    import pandas as pd

    return pd.DataFrame(points, columns=list(variables))
