"""Problems and regions of nonlinear models: at one theta, or at several of them at once."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.nonlinear_model import Model, NonlinearModel, nonlinear_model, of_each, takes_theta
from edtk.design.theta_box import (
    MOST_RANGES,
    OFF_MIDDLE,
    ROUNDING_OF_ROOT,
    EfficiencyBox,
    Made,
    RivalBox,
    Robust,
    Sites,
)
from edtk.design.user_model import as_names
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

ROBUST = ("bayes", "maximin")
# Nodes of a rule of quadrature over ranges of theta: of one range, and of all together at most.
NODES = 9
MOST_NODES = 64
EACH_OR_RANGE = "expected a number or (low, high), low below high, for each parameter by its name"


def of_model(
    sites: Sites[Made],
    f: Model,
    theta: Any,
    robust: str | None,
    weights: ArrayLike | None,
    prior: ArrayLike | None,
    **options: Any,
) -> Made:
    """Make what `Problem.of_model` or `Region.of_model` describes, at its sites."""
    if is_box(theta):
        if robust != "bayes":
            _require_plain(robust, weights, prior)
            return _of_ranges(sites, f, theta, options)
        theta, weights = _uniform(theta, weights)
    models = _models(f, _thetas(theta, robust, weights), sites, options)
    sites = _told(sites, models[0])
    each = [sites.alone(model.rows, model.parameters, prior) for model in models]
    if robust is None:
        sites.scaled(each[0], models[0].scale)
        return each[0]
    found = sites.together(each, lambda x: of_each(models, x, NonlinearModel.rows))
    found.robust = Robust(robust, tuple(each), _shares(weights, len(each)))
    return found


def of_rivals(
    sites: Sites[Made],
    f: Model,
    theta: Any,
    rival: Model,
    rival_theta: Any,
    parameters: str | Sequence[str] | None,
    **options: Any,
) -> Made:
    """Make what `Problem.of_rivals` or `Region.of_rivals` describes, at its sites."""
    if callable(options["sigma"]) and takes_theta(options["sigma"]):
        message = "expected numbers or a function of x alone, which both models have"
        raise ArgumentError(message, argument="sigma")
    points = sites.trial
    true = nonlinear_model(
        f, theta, points, parameters=parameters, variables=sites.variables, **options
    )
    free, limits = _limits(rival_theta, "rival_theta")
    try:
        other = nonlinear_model(
            rival, _inside(free, limits), points, variables=true.variables, **options
        )
    except ArgumentError as error:
        raise ArgumentError(f"the rival: {error}", argument="rival") from error
    responses = true.predicted(points[:1]).shape[1]
    if other.predicted(points[:1]).shape[1] != responses:
        message = f"expected {responses} responses, as many as f has"
        raise ArgumentError(message, argument="rival")

    def rows(thetas: Array, x: Any) -> Sequence[Any]:
        means = true.predicted(x)
        rivals = [replace(other, theta=theta) for theta in thetas]
        return of_each(rivals, x, lambda one, x: one.lacking(x, means)[..., None])

    sites = _told(sites, true)
    box = RivalBox(rows, sites, limits, tuple(free), ("difference",))
    box.require_apart()
    return box.first() if len(box.free) else box.listed([box.inside()])


def _of_ranges(
    sites: Sites[Made], f: Model, theta: Mapping[str, Any], options: Mapping[str, Any]
) -> Made:
    """The problem or the region of a model with ranges of theta."""
    free, limits = _ranges(theta, "theta")
    names = as_names(options.get("parameters")) or tuple(free)
    own = dict(options) | {"parameters": names}
    inside = _inside(free, limits)
    model = nonlinear_model(f, inside, sites.trial, variables=sites.variables, **own)
    limits = limits[:, [free.index(name) for name in names]]

    def rows(thetas: Array, x: Any) -> Sequence[Any]:
        models = [replace(model, theta=theta) for theta in thetas]
        return of_each(models, x, NonlinearModel.rows)

    sites = _told(sites, model)
    return EfficiencyBox(rows, sites, limits, names, names).first()


def _told(sites: Sites[Made], model: NonlinearModel) -> Sites[Made]:
    """Sites with the variables of a model, and noise of which it is known what it is of.

    One number for each of as many candidates as responses is of these, as in `Problem`.
    """
    noise = sites.noise
    if noise is not None and noise.ndim == 1:
        n, k = len(noise), model.predicted(sites.trial[:1]).shape[1]
        noise = np.tile(noise, (n, 1)) if n == k else noise[:, None]
    return replace(sites, variables=model.variables, noise=noise)


def is_box(theta: Any) -> bool:
    """Whether theta has ranges: a mapping in which some value is a pair."""
    return isinstance(theta, Mapping) and any(np.ndim(value) for value in theta.values())


def _uniform(theta: Mapping[str, Any], weights: ArrayLike | None) -> tuple[list[Any], Array]:
    """Theta that stand for a uniform prior over its ranges, and their weights, by name.

    They are the nodes of a product of Gauss and Legendre's rules, of n nodes a range, which is
    exact for polynomials of degree 2n - 1 in each parameter.

    Raises:
        ArgumentError: There are weights besides, or too many ranges.
    """
    if weights is not None:
        message = "expected none beside ranges of theta, which count alike"
        raise ArgumentError(message, argument="weights")
    names, limits = _ranges(theta, "theta")
    number = int((limits[0] < limits[1]).sum())
    each = min(NODES, int(MOST_NODES ** (1 / number) + ROUNDING_OF_ROOT))
    if each < 2:
        message = f"has {number} ranges, too many for a mean; expected a list of theta"
        raise ArgumentError(message, argument="theta")
    x, w = np.polynomial.legendre.leggauss(each)
    rules = [
        (0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * w) if low < high else ([low], [1.0])
        for low, high in limits.T
    ]
    nodes = [
        dict(zip(names, map(float, node), strict=True)) for node in product(*(r[0] for r in rules))
    ]
    return nodes, np.array([np.prod(shares) for shares in product(*(r[1] for r in rules))])


def _require_plain(robust: str | None, weights: ArrayLike | None, prior: ArrayLike | None) -> None:
    """Check what stands beside ranges of theta for the worst of them.

    Raises:
        ArgumentError: It is for something else, or has weights or a prior.
    """
    if robust != "maximin":
        message = "has ranges; expected robust='maximin' beside them, or 'bayes'"
        raise ArgumentError(message, argument="theta")
    for name, value in {"weights": weights, "prior": prior}.items():
        if value is not None:
            raise ArgumentError("expected none beside ranges of theta", argument=name)


def _ranges(theta: Any, argument: str) -> tuple[list[str], Array]:
    """Names (p,) and limits (2, p) of parameters, of which some have ranges.

    Raises:
        ArgumentError: They are no numbers and pairs by name, or none is a range.
    """
    names, limits = _limits(theta, argument)
    if not is_box(theta):
        raise ArgumentError(EACH_OR_RANGE, argument=argument)
    return names, limits


def _limits(theta: Any, argument: str) -> tuple[list[str], Array]:
    """The same of parameters that may all be numbers.

    Raises:
        ArgumentError: They are no numbers and pairs by name.
    """
    if not isinstance(theta, Mapping) or not theta:
        raise ArgumentError(EACH_OR_RANGE, argument=argument)
    try:
        pairs = np.array([np.broadcast_to(np.asarray(v, float), 2) for v in theta.values()])
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(EACH_OR_RANGE, argument=argument) from error
    is_range = np.array([np.ndim(value) > 0 for value in theta.values()], dtype=bool)
    if not np.isfinite(pairs).all() or not (pairs[is_range, 0] < pairs[is_range, 1]).all():
        raise ArgumentError(EACH_OR_RANGE, argument=argument)
    if is_range.sum() > MOST_RANGES:
        message = f"has {is_range.sum()} ranges; expected at most {MOST_RANGES}, and numbers"
        raise ArgumentError(message, argument=argument)
    return list(map(str, theta)), pairs.T


def _inside(names: Sequence[str], limits: Array) -> dict[str, float]:
    """Theta within its ranges, at which a model is tried."""
    low, high = limits
    return dict(zip(names, (low + OFF_MIDDLE * (high - low)).tolist(), strict=True))


def _models(
    f: Model,
    thetas: Sequence[Any],
    sites: Sites[Any],
    options: Mapping[str, Any],
) -> list[NonlinearModel]:
    """The model at each theta; where they have names, all are in the order of the first."""
    options = dict(options)
    if isinstance(thetas[0], Mapping) and options.get("parameters") is None:
        options["parameters"] = tuple(thetas[0])
    return [
        nonlinear_model(f, theta, sites.trial, variables=sites.variables, **options)
        for theta in thetas
    ]


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
