"""Problems and regions of nonlinear models: at one theta, or at several of them at once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from edtk.design.information import side_by_side
from edtk.design.nonlinear_model import Model, NonlinearModel, Robust, nonlinear_model
from edtk.design.problem import Problem
from edtk.design.problems import DescribedProblem, several_models
from edtk.design.region import Region, user_functions
from edtk.design.theta_box import INSIDE, MOST_RANGES, EfficiencyBox, RivalBox, ThetaBox
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
    if is_box(theta):
        _require_plain(robust, weights, prior)
        return _problem_of_box(f, theta, points, names, options)
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


def problem_of_rivals(
    f: Model,
    theta: Any,
    rival: Model,
    rival_theta: Any,
    candidates: "ArrayLike | pd.DataFrame",
    variables: Sequence[str] | None,
    parameters: Sequence[str] | None,
    **options: Any,
) -> Problem:
    """Make the problem that `Problem.of_rivals` describes."""
    points, columns = _points(candidates)
    names = columns if variables is None else tuple(variables)
    if callable(options["sigma"]):
        message = "expected numbers, which both models have"
        raise ArgumentError(message, argument="sigma")
    true = nonlinear_model(f, theta, points, parameters=parameters, variables=names, **options)
    free, limits = _ranges(rival_theta, "rival_theta")
    try:
        other = nonlinear_model(
            rival, _inside(free, limits), points, variables=true.variables, **options
        )
    except ArgumentError as error:
        raise _about_rival(error) from error
    mean = true.predicted(points, true.theta)
    if other.predicted(points[:1], other.theta).shape[1] != mean.shape[1]:
        message = f"expected {mean.shape[1]} responses, as many as f has"
        raise ArgumentError(message, argument="rival")

    def rows(at: Array, x: Array) -> Array:
        means = mean if x is points else true.predicted(x, true.theta)
        return replace(other, theta=at).lacking(x, means)[..., None]

    frame = _frame(points, true.variables)
    box = RivalBox(rows, points, frame, limits, tuple(free), ("difference",))
    box.require_apart()
    return _boxed(box)


def _problem_of_box(
    f: Model,
    theta: Mapping[str, Any],
    points: Array,
    variables: Sequence[str] | None,
    options: Mapping[str, Any],
) -> Problem:
    """The problem of a model with ranges of theta."""
    free, limits = _ranges(theta, "theta")
    names = tuple(options.get("parameters") or free)
    own = dict(options) | {"parameters": names}
    model = nonlinear_model(f, _inside(free, limits), points, variables=variables, **own)
    limits = limits[:, [free.index(name) for name in names]]

    def rows(at: Array, x: Array) -> Array:
        return np.asarray(replace(model, theta=at).rows(x))

    frame = _frame(points, model.variables)
    return _boxed(EfficiencyBox(rows, points, frame, limits, names, names))


def _boxed(box: ThetaBox) -> Problem:
    """The problem of one theta within ranges, which knows the ranges."""
    found = box.listed([box.at(np.full(len(box.free), INSIDE))])
    assert found.robust is not None
    found.robust = replace(found.robust, box=box)
    return found


def is_box(theta: Any) -> bool:
    """Whether theta has ranges: a mapping in which some value is a pair."""
    return isinstance(theta, Mapping) and any(np.ndim(value) for value in theta.values())


def _require_plain(robust: str | None, weights: ArrayLike | None, prior: ArrayLike | None) -> None:
    """Check what stands beside ranges of theta.

    Raises:
        ArgumentError: It is not for the worst theta, or has weights or a prior.
    """
    if robust != "maximin":
        message = "ranges are for the worst theta in them; expected robust='maximin' beside them"
        raise ArgumentError(message, argument="theta")
    for name, value in {"weights": weights, "prior": prior}.items():
        if value is not None:
            raise ArgumentError("expected none beside ranges of theta", argument=name)


def _ranges(theta: Any, argument: str) -> tuple[list[str], Array]:
    """Names (p,) and limits (2, p) of parameters, of which some have ranges.

    Raises:
        ArgumentError: They are no numbers and pairs by name, or none is a range.
    """
    message = "expected a number or (low, high), low below high, for each parameter by its name"
    if not isinstance(theta, Mapping):
        raise ArgumentError(message, argument=argument)
    try:
        pairs = np.array([np.broadcast_to(np.asarray(v, float), 2) for v in theta.values()])
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(message, argument=argument) from error
    is_range = np.array([np.ndim(value) > 0 for value in theta.values()], dtype=bool)
    good = is_range.any() and np.isfinite(pairs).all()
    if not good or not (pairs[is_range, 0] < pairs[is_range, 1]).all():
        raise ArgumentError(message, argument=argument)
    if is_range.sum() > MOST_RANGES:
        message = f"has {is_range.sum()} ranges; expected at most {MOST_RANGES}, and numbers"
        raise ArgumentError(message, argument=argument)
    return list(map(str, theta)), pairs.T


def _inside(names: Sequence[str], limits: Array) -> dict[str, float]:
    """Theta within its ranges, at which a model is tried."""
    low, high = limits
    return dict(zip(names, (low + INSIDE * (high - low)).tolist(), strict=True))


def _about_rival(error: ArgumentError) -> ArgumentError:
    """The same error, about the rival and not about f."""
    return ArgumentError(f"the rival: {error}", argument="rival")


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
    if is_box(theta):
        message = "ranges are for candidates, Problem.of_model; expected a list of theta"
        raise ArgumentError(message, argument="theta")
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
    except (TypeError, ValueError, OverflowError) as error:
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
    except (TypeError, ValueError, OverflowError) as error:
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
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(message, argument="weights") from error
    if found.shape != (k,) or not (np.isfinite(found) & (found > 0)).all():
        raise ArgumentError(message, argument="weights")
    return found / found.sum()


def _frame(points: Array, variables: Sequence[str]) -> "pd.DataFrame":
    """Candidates as a table."""
    import pandas as pd

    return pd.DataFrame(points, columns=list(variables))
