"""Construction of a criterion from its class and what it needs."""

import inspect
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import Criterion
from criteria.errors import CriterionError, MissingTargetError
from criteria.plugins import require_homogeneous, require_slope


def construct(
    cls: type[Criterion],
    target: ArrayLike | None,
    targets: ArrayLike | None,
    parameters: Mapping[str, Any],
) -> Criterion:
    """Construct a criterion; the arguments are those of `criteria.create`.

    Raises:
        MissingTargetError: The criterion needs a target, and there is none.
        CriterionError: A parameter is unknown or wrong, or a required one is missing, or the
            criterion of a third party has another degree than it declares.
    """
    if parameters or cls.needs_parameters:
        return _with_parameters(cls, parameters, known_parameters(cls))
    return _create(cls, target, targets)


def known_parameters(cls: type[Criterion]) -> dict[str, inspect.Parameter]:
    """What the constructor of a class with parameters takes, by name; nothing for the others."""
    return dict(inspect.signature(cls).parameters) if cls.needs_parameters else {}


def _with_parameters(
    cls: type[Criterion], given: Mapping[str, Any], known: Mapping[str, inspect.Parameter]
) -> Criterion:
    """Construct a criterion from its parameters.

    Raises:
        CriterionError: A parameter is unknown or wrong, or a required one is missing.
    """
    expected = ", ".join(known) or "none"
    for key in given:
        if key not in known:
            raise CriterionError(
                f"criterion {cls.name!r} has no parameter {key!r}; expected {expected}"
            )
    for key, parameter in known.items():
        if parameter.default is inspect.Parameter.empty and key not in given:
            raise CriterionError(f"criterion {cls.name!r} needs {key}; its parameters: {expected}")
    try:
        made = cls(**given)
    except (TypeError, ValueError, ArithmeticError) as error:  # of what is no array of numbers
        words = " ".join(str(error).split())
        raise CriterionError(f"criterion {cls.name!r}: wrong parameters: {words}") from error
    return _sound(made, 3)


def _create(cls: type[Criterion], target: ArrayLike | None, targets: ArrayLike | None) -> Criterion:
    """Construct a criterion of all parameters."""
    if not cls.needs_target:
        return _sound(cls(), 3)
    given = targets if cls.per_task and targets is not None else target
    if given is None:
        raise MissingTargetError(
            f"criterion {cls.name!r} needs a target: the regressor A0 of the test pose"
        )
    made = cls(given)  # type: ignore[call-arg]
    return _sound(made, np.shape(given)[-1])


def _sound(criterion: Criterion, p: int) -> Criterion:
    """The criterion of a third party, asked for the degree that it declares, and for its gradient.

    Where its cost of p parameters cannot be computed, whoever uses it finds out; a criterion that
    is only compared needs no gradient.

    Raises:
        CriterionError: Its cost has another degree, or another gradient.
    """
    if type(criterion).__module__.split(".")[0] == "criteria":
        return criterion
    M = np.diag(np.arange(1.0, p + 1)) + 0.5
    try:
        criterion.cost(M)
    except Exception:
        return criterion
    require_homogeneous(criterion, M)
    try:
        criterion.gradient(M)
    except Exception:
        return criterion
    require_slope(criterion, M)
    return criterion
