"""Look-up of criteria by name: the built-ins of this package and third parties' entry points."""

import importlib
import inspect
import pkgutil
import sys
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from numpy.typing import ArrayLike

from criteria.criterion import Criterion
from criteria.relaxable import Relaxable

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

GROUP = "edtk.criteria"
BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0")  # the order of Table 1
RELAXATION_HOOKS = ("expression", "polar", "formulation", "lower_bound", "subproblem")
_registered: dict[str, type[Criterion]] = {}
C = TypeVar("C", bound=type[Criterion])


class CriterionError(LookupError):
    """A criterion's name, registration or construction is wrong."""


class UnknownCriterionError(CriterionError):
    """No criterion has that name."""


class DuplicateCriterionError(CriterionError):
    """Two criteria claim one name."""


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
    """Names of all criteria: built-ins in the order of the paper's Table 1, then plug-ins."""
    plugins = _plugins()  # loads the built-ins too, so it comes before `_registered` is read
    known = {*_registered, *plugins}
    return (*(name for name in BUILTINS if name in known), *sorted(known - set(BUILTINS)))


def get(name: str) -> type[Criterion]:
    """The criterion class of that name.

    Raises:
        UnknownCriterionError: No criterion has that name; the message lists the names.
        DuplicateCriterionError: A plug-in claims a name that is taken.
        CriterionError: A plug-in does not load, or is no complete Criterion.
    """
    plugins = _plugins()  # first, so that a plug-in that claims a built-in's name is found out
    if name in _registered:
        return _registered[name]
    if name not in plugins:
        raise UnknownCriterionError(
            f"unknown criterion {name!r}; available: {', '.join(available())}"
        )
    return register(_load(plugins[name]))


def create(name: str, target: ArrayLike | None = None) -> Criterion:
    """Construct a criterion by name.

    Args:
        name: One of `available()`.
        target: The test pose's regressor A0 (rows, p) [m/(rad/(N m))], for criteria that need it.

    Raises:
        CriterionError: The name is unknown, or the criterion needs a target and `target` is None.
    """
    cls = get(name)
    if not cls.needs_target:
        return cls()
    if target is None:
        raise CriterionError(
            f"criterion {name!r} needs a target: the regressor A0 of the test pose"
        )
    return cls(target)  # type: ignore[call-arg]


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


def _plugins() -> "dict[str, EntryPoint]":
    """Entry points of the group `edtk.criteria` by name, each of which names a Criterion class."""
    _load_builtins()
    found: dict[str, EntryPoint] = {}
    # Reading the metadata of all distributions takes 7 ms, which every look-up would pay. The path
    # is the key, so that a folder that joins it later is noticed.
    for point in _entry_points(tuple(sys.path)):
        holder = _registered.get(point.name)
        # A plug-in that is loaded already holds its own name.
        is_taken = holder is not None and _path(holder, ":") != point.value
        if is_taken or found.setdefault(point.name, point).value != point.value:
            raise DuplicateCriterionError(
                f"criterion name {point.name!r} of entry point {point.value!r} is already taken"
            )
    return found


def _load(plugin: "EntryPoint") -> type[Criterion]:
    """The class that an entry point names."""
    try:
        cls = plugin.load()
    except Exception as error:  # a third party's module may raise anything
        why = " ".join(str(error).split())
        raise CriterionError(f"criterion plug-in {plugin.value!r} does not load: {why}") from error
    is_criterion = isinstance(cls, type) and issubclass(cls, Criterion)
    if not is_criterion or getattr(cls, "name", None) != plugin.name:
        raise CriterionError(
            f"criterion plug-in {plugin.value!r} must be a Criterion class "
            f"whose name is {plugin.name!r}"
        )
    return cls


def _require_complete(cls: type[Criterion]) -> None:
    """Reject a class that could not be used, or not be relaxed although it is meant to be."""
    missing = sorted(getattr(cls, "__abstractmethods__", ()))
    if missing:
        raise CriterionError(
            f"criterion {cls.name!r}: {_path(cls)} does not define {' and '.join(missing)}"
        )
    # Such a class would work, but no relaxation would find it: an error tells its author why.
    hooks = [hook for hook in RELAXATION_HOOKS if inspect.isfunction(getattr(cls, hook, None))]
    if hooks and not issubclass(cls, Relaxable):
        raise CriterionError(
            f"criterion {cls.name!r}: {_path(cls)} defines {hooks[0]}, so it must derive from "
            "criteria.ConvexCriterion instead of criteria.Criterion"
        )


def _path(cls: type, separator: str = ".") -> str:
    """Where a class is defined."""
    return f"{cls.__module__}{separator}{cls.__qualname__}"
