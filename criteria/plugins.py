"""Criteria of third parties: loaded with care, and held to what they promise."""

import inspect
import math
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import wraps
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from criteria.convex_criterion import require_expression
from criteria.criterion import Criterion, Sense
from criteria.errors import CriterionError
from criteria.linalg.typing import Array
from criteria.relaxable import Relaxable

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

FACTORS = (0.25, 7.0)  # of information; powers of two alone would hide a cost that rounds
WRONG_DEGREE = 1e-6  # relative difference of costs that no rounding of a sound design makes
TRIAL_STEP = 1e-4  # of a change of M, relative to its size: differences are good to its square
WRONG_SLOPE = 1e-3  # of the sizes of gradient and change: no rounding, and no step, is as wrong
DIRECTIONS = 2
HOOKS = ("expression", "polar", "formulation", "lower_bound", "subproblem")  # of relaxations
TEXTS = ("title", "formula")
FLAGS = (
    "convex",
    "smooth",
    "monotone",
    "unit_free",
    "needs_target",
    "per_task",
    "needs_parameters",
)


def require_homogeneous(criterion: Criterion, M: Array, rounding: float = 0.0) -> None:
    """Check ``cost(c M) = c^-degree cost(M)``, on which every bound rests.

    Bounds of weights are scaled by it to plans of m experiments, and duals are derived from it. A
    criterion whose degree is wrong would get bounds that are wrong, in silence.

    Args:
        criterion: Any criterion.
        M: An information matrix (p, p) at which to check; nothing is checked where its cost is
            not finite.
        rounding: Relative error that rounding may make in costs of M.

    Raises:
        CriterionError: The cost grows otherwise; the message says how.
    """
    cost, *scaled = criterion.cost(np.stack([M, *(factor * M for factor in FACTORS)])).tolist()
    if not np.isfinite(cost) or criterion.precision is not None:
        return
    if not cost > 0:
        raise CriterionError(
            f"criterion {criterion.name!r}: its cost is {cost:g}; expected a positive number"
        )
    allowed = WRONG_DEGREE + 2 * rounding
    for factor, reached in zip(FACTORS, scaled, strict=True):
        found = reached / cost
        expected = factor**-criterion.degree
        if not abs(found - expected) <= allowed * expected:
            raise CriterionError(
                f"criterion {criterion.name!r}: its cost is not homogeneous of degree "
                f"{criterion.degree:g}: {factor:g} times the information has {found:.6g} times the "
                f"cost; expected {expected:.6g}"
            )


def require_slope(criterion: Criterion, M: Array) -> None:
    """Check ``d cost = <G, dM>`` by differences of the cost.

    A wrong gradient makes no bound wrong, which multipliers prove by themselves, but designs poor:
    searches go where it points.

    Args:
        criterion: Any criterion.
        M: A well-conditioned information matrix (p, p). At a kink of the cost a subgradient is
            between the two one-sided slopes.

    Raises:
        CriterionError: Gradient and cost differ; the message says by how much.
    """
    rng = np.random.default_rng(0)
    cost = float(criterion.cost(M))
    G = criterion.gradient(M)
    for _ in range(DIRECTIONS):
        E = rng.normal(size=M.shape)
        E = (E + E.T) * np.linalg.norm(M) / np.linalg.norm(E + E.T)
        slopes = [
            (float(criterion.cost(M + sign * TRIAL_STEP * E)) - cost) / (sign * TRIAL_STEP)
            for sign in (1, -1)
        ]
        stated = float(np.sum(G * E))
        slack = WRONG_SLOPE * (np.linalg.norm(G) * np.linalg.norm(E) + max(map(abs, slopes)))
        if not min(slopes) - slack <= stated <= max(slopes) + slack:
            raise CriterionError(
                f"criterion {criterion.name!r}: its gradient is not that of its cost: along a "
                f"change of M the slope is {np.mean(slopes):.4g}, by the gradient {stated:.4g}"
            )


# What a third party's code may raise: it may end the program instead of raising an error.
FAILURES = (Exception, SystemExit)


def load_plugin(point: "EntryPoint") -> type[Criterion]:
    """Import the class that an entry point names.

    Raises:
        CriterionError: It does not load, or is no Criterion of the entry point's name; one line.
    """
    try:
        with redirect_stdout(sys.stderr):  # what a module prints would spoil the JSON of a command
            cls = point.load()
    except FAILURES as error:
        raise CriterionError(
            f"criterion {point.name!r}: plug-in {point.value!r} does not load: {_in_words(error)}"
        ) from error
    is_criterion = isinstance(cls, type) and issubclass(cls, Criterion)
    if not is_criterion or getattr(cls, "name", None) != point.name:
        raise CriterionError(
            f"criterion {point.name!r}: plug-in {point.value!r} must be a Criterion class "
            f"whose name is {point.name!r}"
        )
    return cls


def guard_plugin(cls: type[Criterion]) -> None:
    """Check what a complete class declares, and let its methods fail in one line.

    From then on a `CriterionError` tells what a method raises, or returns in a wrong shape.

    Raises:
        CriterionError: A declared property is missing, or of a wrong kind.
    """
    for key, is_valid in _PROPERTIES.items():
        if not is_valid(getattr(cls, key, None)):
            raise CriterionError(
                f"criterion {cls.name!r}: {cls.__module__}.{cls.__qualname__} declares no valid "
                f"{key}"
            )
    for method in ("__init__", "_cost", "_gradient", *HOOKS):
        function = getattr(cls, method, None)
        if inspect.isfunction(function) and function.__module__.split(".")[0] != "criteria":
            setattr(cls, method, _guarded(cls.name, method, function))


def _guarded(name: str, method: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A third party's method that raises a CriterionError, or NotImplementedError, only."""

    @wraps(function)
    def guarded(*arguments: Any, **options: Any) -> Any:
        try:
            found = function(*arguments, **options)
            if method in ("_cost", "_gradient"):
                found = np.asarray(found)
        except (CriterionError, NotImplementedError):  # without a convex form, as callers expect
            raise
        except FAILURES as error:
            raise CriterionError(
                f"criterion {name!r}: its {method} fails: {_in_words(error)}"
            ) from error
        place = f"criterion {name!r}: its {method}"
        if method in ("_cost", "_gradient"):
            _require_numbers(found, np.shape(arguments[1]), place)
        elif method in RETURNED:
            RETURNED[method](found, place)
        return found

    return guarded


def _require_numbers(found: Array, shape: tuple[int, ...], place: str) -> None:
    """Costs (...), or gradients (..., p, p), of matrices of a shape (..., p, p)."""
    expected = shape if place.endswith("_gradient") else shape[:-2]
    if found.shape != expected:
        raise CriterionError(
            f"{place} has shape {found.shape} for M of shape {shape}, expected {expected}"
        )
    if found.dtype.kind not in "fiu":
        raise CriterionError(f"{place} is of type {found.dtype}, expected numbers")


def _require(is_one: bool, found: object, place: str, expected: str) -> None:
    """Refuse what a method returns if it is not what was expected."""
    if not is_one:
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected {expected}"
        )


def _require_formulation(found: Any, place: str) -> None:
    """An objective, and a list of constraints."""
    is_one = isinstance(found, tuple) and len(found) == 2 and isinstance(found[1], list)
    _require(is_one, found, place, "a tuple of an expression of cvxpy and a list of constraints")
    require_expression(found[0], place)


def _require_bound(found: Any, place: str) -> None:
    """A real number, which may be nan: such a bound proves nothing."""
    is_one = not np.ndim(found) and np.asarray(found).dtype.kind in "fiu"
    _require(is_one, found, place, "a number")


# What the methods of a relaxation must return.
RETURNED: dict[str, Callable[[object, str], object]] = {
    "expression": require_expression,
    "formulation": _require_formulation,
    "polar": _require_bound,
    "lower_bound": _require_bound,
    "subproblem": lambda found, place: _require(
        isinstance(found, Relaxable), found, place, "a criteria.Relaxable"
    ),
}


def _in_words(error: BaseException) -> str:
    """Kind and text of an error on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def _is_size(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and value > 0


def _is_unit(value: object) -> bool:
    return (
        isinstance(value, tuple)
        and len(value) == 2
        and _is_size(value[0])
        and isinstance(value[1], str)
    )


_PROPERTIES: dict[str, Callable[[object], bool]] = {
    **dict.fromkeys(TEXTS, lambda value: isinstance(value, str) and value != ""),
    # Whether a criterion is smooth or monotone may depend on its arguments.
    **dict.fromkeys(FLAGS, lambda value: isinstance(value, bool | property)),
    "sense": lambda value: value in get_args(Sense),
    "degree": _is_size,
    "shown": _is_unit,
}
