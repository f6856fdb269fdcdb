"""Criteria of third parties: loaded with care, and held to what they promise."""

import inspect
import math
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import wraps
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from criteria.criterion import Criterion, Sense
from criteria.criterion_error import CriterionError
from criteria.linalg.typing import Array
from criteria.relaxable import Relaxable
from criteria.require_expression import require_expression

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

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


def _require_formulation(found: object, place: str) -> None:
    """An objective, and a list of constraints."""
    if not isinstance(found, tuple) or len(found) != 2 or not isinstance(found[1], list):
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected a tuple of an "
            "expression of cvxpy and a list of constraints"
        )
    require_expression(found[0], place)


def _require_bound(found: object, place: str) -> None:
    """A real number, which may be nan: such a bound proves nothing."""
    if np.ndim(found) or np.asarray(found).dtype.kind not in "fiu":  # type: ignore[arg-type]
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected a number"
        )


def _require_relaxable(found: object, place: str) -> None:
    """A criterion that can be relaxed."""
    if not isinstance(found, Relaxable):
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected a "
            "criteria.Relaxable"
        )


# What the methods of a relaxation must return.
RETURNED: dict[str, Callable[[object, str], object]] = {
    "expression": require_expression,
    "formulation": _require_formulation,
    "polar": _require_bound,
    "lower_bound": _require_bound,
    "subproblem": _require_relaxable,
}


def _in_words(error: BaseException) -> str:
    """Kind and text of an error on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def _is_text(value: object) -> bool:
    return isinstance(value, str) and value != ""


def _is_flag(value: object) -> bool:
    # Whether a criterion is smooth or monotone may depend on its arguments.
    return isinstance(value, bool | property)


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
    **dict.fromkeys(TEXTS, _is_text),
    **dict.fromkeys(FLAGS, _is_flag),
    "sense": lambda value: value in get_args(Sense),
    "degree": _is_size,
    "shown": _is_unit,
}
