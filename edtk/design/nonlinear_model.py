"""A nonlinear model of experiments, linearised at parameters: its rows, by exact derivatives."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.families import Response
from edtk.design.formula import Formula
from edtk.design.user_model import (
    Slopes,
    as_called,
    as_names,
    point_text,
    slopes_of,
    variable_names,
)
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

Model = str | Sequence[str] | Callable[..., ArrayLike]

BY_PLACE = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
MOST_COMPARED = 256  # points at which derivatives are compared with differences


@dataclass(frozen=True, eq=False)
class NonlinearModel:
    """Responses ``y = mu(f(x, theta)) + noise`` of a family, at one theta.

    The rows of an experiment are the root of its Fisher information about theta,
    ``mu'/sqrt(V(mu)) df/dtheta / sigma``, one for each response. Where sigma depends on theta, as
    ``sigma(x, theta)`` of a normal response, its own rows ``sqrt(2) d log sigma / dtheta`` are
    information, too (for example Atkinson and Cook, JASA 90, 1995). Where it depends on x alone, it
    is a factor of any family's own deviation.

    Attributes:
        predictor: Points and theta to predictors (n, k), with derivatives by theta.
        theta: The parameters (p,).
        response: Family and link.
        whitener: Inverse (k, k) of a root of the covariance of the responses.
        deviation: Points and theta to log sigma (n, k), with its derivatives; or None.
        parameters: Names (p,).
        variables: Names (d,).
    """

    predictor: Slopes
    theta: Array
    response: Response
    whitener: Array
    deviation: Slopes | None
    parameters: tuple[str, ...]
    variables: tuple[str, ...]

    def rows(self, x: Any) -> Any:
        """Whitened rows (n, rows, p) at points x (n, d)."""
        J = self.predictor.slope(x, self.theta)
        if not self.response.is_plain:
            eta = self.predicted(x)
            with np.errstate(invalid="ignore"):  # means that a family cannot have are told below
                J = J * self.response.root_weights(eta)[..., None]
        if self.deviation is None:
            return J if self._is_unit else np.einsum("jk,...kp->...jp", self.whitener, J)
        own = np.exp(self.deviation.value(x, self.theta))
        of_mean = J / own[..., None]
        of_noise = np.sqrt(2.0) * self.deviation.slope(x, self.theta)
        return np.concatenate([of_mean, of_noise], axis=1) if of_noise.any() else of_mean

    def scale(self, x: Array) -> Array | None:
        """By what the derivatives of predictors at points x (n, d) are divided in rows, (n, k).

        It is infinite where a predictor tells nothing. None where errors of responses hang
        together, or noise tells about theta: then rows are no multiples of derivatives.
        """
        own = np.diag(self.whitener)
        if not np.array_equal(self.whitener, np.diag(own)):
            return None
        factor = np.broadcast_to(own, (len(x), len(own)))
        if not self.response.is_plain:
            factor = factor * self.response.root_weights(self.predicted(x))
        with np.errstate(divide="ignore"):
            scale = 1.0 / np.abs(factor)
        if self.deviation is None:
            return scale
        if self.deviation.slope(x, self.theta).any():
            return None
        return np.asarray(scale * np.exp(self.deviation.value(x, self.theta)))

    def predicted(self, x: Any) -> Any:
        """Predictors (n, k) at points x (n, d)."""
        return self.predictor.value(x, self.theta)

    def lacking(self, x: Array, mean: Array) -> Array:
        """Roots (n, k) of the deviance of this model where others are the means.

        With the sign of what it lacks, so that they are smooth where it lacks nothing.

        Args:
            x: Points (n, d).
            mean: Predictors (n, k) of another model, which is the true one.
        """
        own = self.predicted(x)
        plain = self.response.is_plain
        roots = (mean - own if plain else self.response.deviance_roots(mean, own)) @ self.whitener.T
        if self.deviation is None:
            return roots
        return roots / np.exp(self.deviation.value(x, self.theta))

    @cached_property
    def _is_unit(self) -> bool:
        return bool(np.array_equal(self.whitener, np.eye(len(self.whitener))))

    def require_told(self, x: Array) -> None:
        """Check the rows at points (n, d).

        Raises:
            ArgumentError: One is not finite, or a parameter has no effect anywhere.
        """
        rows = self.rows(x)
        lost = np.argwhere(~np.isfinite(rows))
        if len(lost):
            i, _, j = lost[0]
            raise ArgumentError(self._why_lost(x[i : i + 1], self.parameters[j]), argument="f")
        silent = np.flatnonzero(~rows.any(axis=(0, 1)))
        if len(silent):
            message = f"the model does not depend on {self.parameters[silent[0]]!r} at any point"
            raise ArgumentError(message, argument="f")

    def _why_lost(self, x: Array, parameter: str) -> str:
        """Why a row is not finite at a point (1, d): by its value, its derivative or its mean."""
        point = point_text(self.variables, x[0])
        if not np.isfinite(self.predicted(x)).all():
            return f"the value is not finite at {point}"
        if not np.isfinite(self.predictor.slope(x, self.theta)).all():
            return f"the derivative by {parameter!r} is not finite at {point}"
        family = self.response.family
        return f"{family.name} means are {family.range}, and not at {point}"


def of_each(
    models: Sequence[NonlinearModel], x: Any, told: Callable[[NonlinearModel, Any], Any]
) -> Sequence[Any]:
    """What is told of points x (n, d) by each of t models that differ in theta: t of (n, ...).

    A formula is followed once for all of them.
    """
    first = models[0]
    if first.predictor.takes_several and first.deviation is None and x.dtype != object:
        thetas = np.stack([model.theta for model in models], axis=1)
        return cast(Sequence[Any], told(replace(first, theta=thetas[..., None]), x))
    return [told(model, x) for model in models]


def nonlinear_model(
    f: Model,
    theta: ArrayLike | Mapping[str, float],
    trial: Array,
    family: str = "normal",
    link: str | None = None,
    sigma: ArrayLike | Callable[..., ArrayLike] = 1.0,
    covariance: ArrayLike | None = None,
    gradient: Callable[..., ArrayLike] | None = None,
    parameters: str | Sequence[str] | None = None,
    variables: str | Sequence[str] | None = None,
) -> NonlinearModel:
    """Make a model of a function or a formula, and try it.

    Args:
        f: See `Problem.of_model`.
        theta: Parameters (p,).
        trial: Points (n, d) at which it is tried.
        family: See `Problem.of_model`.
        link: See `Problem.of_model`.
        sigma: See `Problem.of_model`.
        covariance: See `Problem.of_model`.
        gradient: See `Problem.of_model`.
        parameters: Names (p,).
        variables: Names (d,).

    Raises:
        ArgumentError: An argument does not fit, or the model is not as described; one line.
    """
    names, at = _named_theta(theta, parameters)
    response = Response.of(family, link)
    spread = trial[np.linspace(0, len(trial) - 1, min(len(trial), MOST_COMPARED)).astype(int)]
    if not callable(f):
        told, variables = _of_formulas(f, gradient, names, variables, trial.shape[1])
    variables = variable_names(variables, trial.shape[1])
    if callable(f):
        told = slopes_of(f, gradient, at, spread, "f", names, variables)
    k = told.value(spread[:1], at).shape[1]
    deviation = None
    if callable(sigma):
        both = sigma if takes_theta(sigma) else lambda x, theta: sigma(x)
        if covariance is not None or (both is sigma and family.lower() != "normal"):
            message = "a function is for responses without a covariance, of theta for normal ones"
            raise ArgumentError(message, argument="sigma")
        deviation = _log_deviation(both, at, spread, names, variables)
        columns = deviation.value(spread[:1], at).shape[1]
        if columns not in (1, k):
            message = (
                f"has {columns} values at a point; expected one, or one for each of {k} responses"
            )
            raise ArgumentError(message, argument="sigma")
    whitener = np.eye(k) if deviation is not None else _whitener(sigma, covariance, k)
    model = NonlinearModel(told, at, response, whitener, deviation, names, variables)
    model.require_told(trial)
    return model


def _named_theta(
    theta: ArrayLike | Mapping[str, float], parameters: str | Sequence[str] | None
) -> tuple[tuple[str, ...], Array]:
    """Names (p,) and values (p,) of the parameters.

    Raises:
        ArgumentError: They are not numbers, or not as many as names.
    """
    parameters = as_names(parameters)
    if isinstance(theta, Mapping):
        parameters = parameters or tuple(theta)
        if len(parameters) != len(theta) or set(parameters) != set(theta):
            given = ", ".join(map(str, theta))
            message = (
                f"has {given}; expected a number for each of {', '.join(map(str, parameters))}"
            )
            raise ArgumentError(message, argument="theta")
        theta = [theta[name] for name in parameters]
    try:
        at = np.atleast_1d(np.asarray(theta, dtype=float))
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError("expected a number for each parameter", argument="theta") from error
    if at.ndim != 1 or not at.size or not np.isfinite(at).all():
        message = "expected a finite number for each parameter, of which there is one at least"
        raise ArgumentError(message, argument="theta")
    names = parameters or tuple(f"k{i + 1}" for i in range(len(at)))
    if len(names) != len(at) or len(set(names)) != len(names):
        message = f"{', '.join(names)}; expected {len(at)} different names, as many as in theta"
        raise ArgumentError(message, argument="parameters")
    return names, at


def _of_formulas(
    given: str | Sequence[str],
    gradient: object,
    names: Sequence[str],
    variables: str | Sequence[str] | None,
    d: int,
) -> tuple[Slopes, Sequence[str] | None]:
    """A formula, or one of each response, with derivatives, and the names of the variables.

    These are None where formulas have none.

    Raises:
        ArgumentError: It is none, a gradient stands beside it, or points have other columns.
    """
    if gradient is not None:
        raise ArgumentError("a formula has its own", argument="gradient")
    texts = [given] if isinstance(given, str) or not isinstance(given, Sequence) else given
    formulas = Formula.of_each(texts, names, as_names(variables))
    found = formulas[0].variables
    if found and len(found) != d:
        message = f"points have {d} columns; expected {len(found)}: {', '.join(found)}"
        raise ArgumentError(message, argument="candidates")
    told = Slopes(
        lambda x, t: np.stack([one(x, t) for one in formulas], axis=-1),
        lambda x, t: np.stack([np.stack(one.gradient(x, t), -1) for one in formulas], axis=-2),
        takes_several=True,
    )
    return told, found or variables


def _whitener(sigma: Any, covariance: ArrayLike | None, k: int) -> Array:
    """The inverse (k, k) of a root of the covariance of k responses.

    Raises:
        ArgumentError: A number is not positive, or there are not as many as responses.
    """
    if covariance is None:
        try:
            given = np.asarray(sigma, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError("expected numbers or a function", argument="sigma") from error
        if given.shape not in ((), (k,)) or not (np.isfinite(given) & (given > 0)).all():
            message = (
                f"expected a positive number, or one for each of {k} responses; noise of points is "
                "a function of x, or of x and theta"
            )
            raise ArgumentError(message, argument="sigma")
        return np.diag(np.broadcast_to(1 / given, k))
    try:
        C = np.asarray(covariance, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError("expected a matrix of numbers", argument="covariance") from error
    if C.shape != (k, k) or not np.allclose(C, C.T, rtol=1e-12, atol=0.0):
        message = f"expected a symmetric matrix of {k} responses, not of shape {C.shape}"
        raise ArgumentError(message, argument="covariance")
    try:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(C)))
    except np.linalg.LinAlgError as error:
        raise ArgumentError("is not positive definite", argument="covariance") from error


def takes_theta(sigma: Callable[..., ArrayLike]) -> bool:
    """Whether a function of noise needs more than x."""
    try:
        # What numpy has vectorised tells nothing itself.
        asked = inspect.signature(getattr(sigma, "pyfunc", sigma)).parameters.values()
    except ValueError:  # some functions of libraries do not tell
        return True
    # Numpy's own have places for other things after x.
    needed = [one for one in asked if one.kind in BY_PLACE and one.default is one.empty]
    return len(needed) != 1


def _log_deviation(
    sigma: Callable[..., ArrayLike],
    theta: Array,
    x: Array,
    names: Sequence[str],
    variables: Sequence[str],
) -> Slopes:
    """The logarithm of a user's sigma(x, theta) with its derivatives.

    Raises:
        ArgumentError: It is not positive, or has no derivative.
    """
    value = as_called(sigma, theta, x, "sigma", variables)
    values = value(x, theta)
    lost = np.flatnonzero(~(np.isfinite(values) & (np.real(values) > 0)).all(axis=1))
    if len(lost):
        i = int(lost[0])
        raise ArgumentError(f"is not positive at {point_text(variables, x[i])}", argument="sigma")
    return slopes_of(
        lambda points, t: np.log(value(np.reshape(points, (-1, x.shape[1])), t)),
        None,
        theta,
        x,
        "sigma",
        names,
        variables,
    )
