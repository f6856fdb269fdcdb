"""Criteria by name, built-ins and plug-ins, and their construction from what a user has given."""

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from reprlib import repr as shortened
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import Criterion
from criteria.errors import (
    CriterionError,
    DuplicateCriterionError,
    MissingTargetError,
    UnknownCriterionError,
)
from criteria.interest import Interest
from criteria.named_interest import named_parameters
from criteria.plugins import HOOKS, guard_plugin, load_plugin, require_homogeneous, require_slope
from criteria.relaxable import Relaxable

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints


GROUP = "edtk.criteria"
# The order of Table 1, then those that it does not have.
BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")
FAMILIES = (
    "I",
    "c",
    "Ds",
    "phi",
    "prediction_G",
    "bayes_D",
    "bayes_A",
    "compound",
    "minimax",
)  # the order in which they are listed


_registered: dict[str, type[Criterion]] = {}
C = TypeVar("C", bound=type[Criterion])


@dataclass(frozen=True)
class Loaded:
    """The criteria that can be used, and the plug-ins that cannot.

    Attributes:
        classes: Criteria by name, in the order of `available()`.
        problems: What is wrong with the others, a line each, by the name that they claim.
    """

    classes: dict[str, type[Criterion]]
    problems: dict[str, str]


def register(cls: C) -> C:
    """Class decorator that makes a criterion known under its `name`.

    Raises:
        DuplicateCriterionError: Another class holds that name.
        CriterionError: The class misses a method, or derives from the wrong base.
    """
    _require_complete(cls)
    holder = _registered.setdefault(cls.name, cls)
    if holder is not cls:
        raise DuplicateCriterionError(
            f"criterion name {cls.name!r} of {_path(cls)} is already taken by {_path(holder)}"
        )
    return cls


def available() -> tuple[str, ...]:
    """Names of all criteria: built-ins, first those of the paper's Table 1, then plug-ins.

    Criteria that need parameters are not among them, see `families`.
    """
    _load_builtins()
    known = {*_registered, *_plugins()} - set(families())
    return (*(name for name in BUILTINS if name in known), *sorted(known - set(BUILTINS)))


def families() -> tuple[str, ...]:
    """Names of the criteria that `create` makes from parameters only, such as I from W."""
    _load_builtins()
    found = {name for name, cls in _registered.items() if cls.needs_parameters}
    return (*(name for name in FAMILIES if name in found), *sorted(found - set(FAMILIES)))


def get(name: str) -> type[Criterion]:
    """The criterion class of that name; no plug-in of another name is imported.

    Raises:
        UnknownCriterionError: No criterion has that name; the message lists the names.
        DuplicateCriterionError: Two plug-ins claim the name.
        CriterionError: A plug-in does not load, or is no complete Criterion.
    """
    _load_builtins()
    if not isinstance(name, str):
        raise UnknownCriterionError(f"expected the name of a criterion, not {type(name).__name__}")
    if name in _registered:
        return _registered[name]
    claims = _plugins().get(name, ())
    if not claims:
        raise UnknownCriterionError(
            f"unknown criterion {name!r}; available: {', '.join(available())}, and with "
            f"parameters {', '.join(families())}"
        )
    if len(claims) > 1:
        values = " and ".join(repr(point.value) for point in claims)
        raise DuplicateCriterionError(f"criterion name {name!r} is claimed by {values}")
    cls = load_plugin(claims[0])
    _require_complete(cls)
    guard_plugin(cls)
    return register(cls)


def load_all() -> Loaded:
    """Load all criteria; a plug-in that fails is left out, and does no harm to the others."""
    classes: dict[str, type[Criterion]] = {}
    problems: dict[str, str] = {}
    for name in available():
        try:
            cls = get(name)
            # A plug-in may turn out to need parameters only now that it is loaded.
            if not cls.needs_parameters:
                classes[name] = cls
        except CriterionError as error:
            problems[name] = str(error)
    for name, claims in _plugins().items():
        holder = classes.get(name)
        others = [point.value for point in claims if holder and _path(holder, ":") != point.value]
        if holder is not None and others:
            problems[name] = (
                f"criterion name {name!r} of entry point {others[0]!r} is already taken by "
                f"{_path(holder)}"
            )
    return Loaded(classes, problems)


def create(
    name: str,
    target: ArrayLike | None = None,
    interest: ArrayLike | None = None,
    targets: ArrayLike | None = None,
    **parameters: Any,
) -> Criterion:
    """Construct a criterion by name.

        >>> import criteria
        >>> criteria.create("phi", q=1).value([[2.0, 0.0], [0.0, 4.0]])
        0.375

    Args:
        name: One of `available()`, or with parameters one of `families()`.
        target: The test pose's regressor A0 (rows, p) [m/(rad/(N m))], for criteria that need it.
        interest: Combinations K (p, s) of the parameters, one a column, about which alone the
            criterion shall be, see `Interest`; defaults to all parameters.
        targets: The regressors (tasks, rows, p) of several tasks, for criteria that look at each of
            them; without them `target` is the only task.
        parameters: What a criterion of `families()` needs, such as W of I; its class describes it.

    Raises:
        MissingTargetError: The criterion needs a target and `target` is None.
        CriterionError: The name is unknown, the class of a plug-in fails or has another degree than
            it declares, a parameter is missing, unknown or wrong, or the criterion has no meaning
            for combinations.
    """
    cls = get(name)
    if interest is not None and "interest" in known_parameters(cls):
        parameters = {**parameters, "interest": interest}
        interest = None
    made = construct(cls, target, targets, _with_tasks(parameters, target, targets))
    return made if interest is None else Interest(made, interest)


def _with_tasks(
    parameters: Mapping[str, Any], target: ArrayLike | None, targets: ArrayLike | None
) -> Mapping[str, Any]:
    """Parameters whose parts that are called by a name, such as "rho0", are about the tasks."""
    parts = parameters.get("criteria")
    if target is None or not isinstance(parts, list | tuple):
        return parameters
    made = [
        construct(get(part), target, targets, {})
        if isinstance(part, str) and get(part).needs_target
        else part
        for part in parts
    ]
    return {**parameters, "criteria": made}


def from_dict(data: Mapping[str, Any]) -> Criterion:
    """Make the criterion that `Criterion.to_dict` has written.

    Raises:
        CriterionError: There is no such criterion, or its arguments are wrong.
    """
    return create(**data)


def as_criterion(
    given: Criterion | str | Mapping[str, Any],
    names: Sequence[str] = (),
    places: Callable[[str], Mapping[str, Any]] | None = None,
) -> Criterion:
    """The criterion that somebody names: by itself, by its name, or by a table with its parameters.

        >>> import criteria
        >>> criteria.as_criterion({"name": "phi", "q": 2}).label
        'phi (q = 2)'
        >>> criteria.as_criterion({"name": "Ds", "interest": ["k2"]}, ["k1", "k2"]).label
        'Ds of k2'

    Args:
        given: The criterion.
        names: Names (p,) of the model's parameters, by which a table may name some of them.
        places: Tells a criterion about predictions by its name where these are, for one that is
            named without any, by itself or within others.

    Raises:
        CriterionError: There is no such criterion, or its parameters are wrong.
    """
    if places is not None:
        given = _placed(given, places)
    if isinstance(given, Criterion):
        return given
    if isinstance(given, str):
        return create(given)
    if isinstance(given, Mapping) and isinstance(given.get("name"), str):
        if not names:
            return from_dict(given)
        try:
            return from_dict(named_parameters(given, names)).named(tuple(names))
        except ValueError as error:
            raise CriterionError(f"criterion {given['name']!r}: {error}") from error
    shown = " ".join(shortened(given).split())
    raise CriterionError(f"expected a criterion, its name or a table with a name, not {shown}")


def _placed(given: Any, places: Callable[[str], Mapping[str, Any]]) -> Any:
    """The same with places of predictions for whatever is named without any."""
    if isinstance(given, Mapping) and isinstance(given.get("criteria"), list | tuple):
        return {**given, "criteria": [_placed(one, places) for one in given["criteria"]]}
    name = given["name"] if isinstance(given, Mapping) and set(given) == {"name"} else given
    if isinstance(name, str) and "points" in parameters_of(name):
        return create(name, **places(name))
    return given


def parameters_of(name: str) -> tuple[str, ...]:
    """Names of the parameters that `create` takes for a criterion; none but for `families()`.

    Raises:
        CriterionError: There is no such criterion.
    """
    return tuple(known_parameters(get(name)))


@cache
def _load_builtins() -> None:
    """Import every module of this package: a criterion is added by adding its file."""
    package = importlib.import_module("criteria")
    for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
        importlib.import_module(f"criteria.{module}")


@cache
def _entry_points(path: tuple[str, ...]) -> "EntryPoints":
    """Entry points of the group `edtk.criteria` on a search path."""
    # Imported late: this module takes 40 ms, which `import criteria` need not pay.
    from importlib.metadata import entry_points

    return entry_points(group=GROUP)


def _plugins() -> "dict[str, tuple[EntryPoint, ...]]":
    """Entry points of the group `edtk.criteria` by name, without those that repeat another."""
    found: dict[str, dict[str, EntryPoint]] = {}
    # Reading the metadata of all distributions takes 7 ms, which every look-up would pay. The path
    # is the key, so that a folder that joins it later is noticed.
    for point in _entry_points(tuple(sys.path)):
        found.setdefault(point.name, {}).setdefault(point.value, point)
    return {name: tuple(claims.values()) for name, claims in found.items()}


def _require_complete(cls: type[Criterion]) -> None:
    """Reject a class that could not be used, or not be relaxed although it is meant to be."""
    missing = sorted(getattr(cls, "__abstractmethods__", ()))
    if missing:
        raise CriterionError(
            f"criterion {cls.name!r}: {_path(cls)} does not define {' and '.join(missing)}"
        )
    # Such a class would work, but no relaxation would find it: an error tells its author why.
    hooks = [hook for hook in HOOKS if inspect.isfunction(getattr(cls, hook, None))]
    if hooks and not issubclass(cls, Relaxable):
        raise CriterionError(
            f"criterion {cls.name!r}: {_path(cls)} defines {hooks[0]}, so it must derive from "
            "criteria.ConvexCriterion instead of criteria.Criterion"
        )


def _path(cls: type, separator: str = ".") -> str:
    """Where a class is defined."""
    return f"{cls.__module__}{separator}{cls.__qualname__}"


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
