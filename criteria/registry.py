"""Look-up of criteria by name: the built-ins of this package and third parties' entry points."""

import importlib
import pkgutil
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from numpy.typing import ArrayLike

from criteria.criterion import Criterion

GROUP = "edtk.criteria"
_registered: dict[str, type[Criterion]] = {}
C = TypeVar("C", bound=type[Criterion])


class CriterionError(LookupError):
    """Anything wrong with a criterion's name, registration or construction."""


class UnknownCriterionError(CriterionError):
    """No criterion of that name."""


class DuplicateCriterionError(CriterionError):
    """Two criteria claim one name."""


def register(cls: C) -> C:
    """Class decorator: make a criterion known under its `name`.

    Raises:
        DuplicateCriterionError: Another class holds that name.
    """
    holder = _registered.setdefault(cls.name, cls)
    if holder is not cls:
        raise DuplicateCriterionError(
            f"criterion name {cls.name!r} of {cls.__module__}.{cls.__qualname__} is already taken by "
            f"{holder.__module__}.{holder.__qualname__}"
        )
    return cls


@cache
def _load_builtins() -> None:
    """Import every module of this package: a criterion is added by adding its file."""
    package = importlib.import_module("criteria")
    for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
        importlib.import_module(f"criteria.{module}")


def _plugins() -> dict[str, EntryPoint]:
    """Entry points of the group `edtk.criteria` by name; the value of each is a Criterion class."""
    _load_builtins()
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=GROUP):
        holder = _registered.get(point.name)
        taken = holder is not None and f"{holder.__module__}:{holder.__qualname__}" != point.value
        if taken or found.setdefault(point.name, point).value != point.value:
            raise DuplicateCriterionError(
                f"criterion name {point.name!r} of entry point {point.value!r} is already taken"
            )
    return found


def available() -> tuple[str, ...]:
    """Names of all criteria, built-ins first, in the order of the paper's Table 1, then plug-ins."""
    plugins = _plugins()
    builtin = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0")
    known = {*_registered, *plugins}
    return (*(n for n in builtin if n in known), *sorted(known - set(builtin)))


def get(name: str) -> type[Criterion]:
    """The criterion class of that name.

    Raises:
        UnknownCriterionError: No such name; the message lists what there is.
        DuplicateCriterionError: A plug-in claims a name that is taken.
        CriterionError: A plug-in does not load, or is no Criterion.
    """
    plugins = _plugins()
    if name in _registered:
        return _registered[name]
    if name not in plugins:
        raise UnknownCriterionError(
            f"unknown criterion {name!r}; available: {', '.join(available())}"
        )
    try:
        cls = plugins[name].load()
    except Exception as error:
        why = " ".join(str(error).split())
        raise CriterionError(
            f"criterion plug-in {plugins[name].value!r} does not load: {why}"
        ) from error
    if not (
        isinstance(cls, type) and issubclass(cls, Criterion) and getattr(cls, "name", None) == name
    ):
        raise CriterionError(
            f"criterion plug-in {plugins[name].value!r} must be a Criterion class whose name is {name!r}"
        )
    return register(cls)


def create(name: str, target: ArrayLike | None = None) -> Criterion:
    """Construct a criterion by name.

    Args:
        name: One of `available()`.
        target: The test pose's regressor A0 (rows, p) [m/(rad/(N m))]; used only by criteria that need it.

    Raises:
        CriterionError: Unknown name, or the criterion needs a target and there is none.
    """
    cls = get(name)
    if not cls.needs_target:
        return cls()
    if target is None:
        raise CriterionError(
            f"criterion {name!r} needs a target: the regressor A0 of the test pose"
        )
    return cls(target)  # type: ignore[call-arg]
