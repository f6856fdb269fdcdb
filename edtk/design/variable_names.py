"""Names of variables and parameters, as a user gives them."""

from collections.abc import Sequence

from edtk.system.errors import ArgumentError


def variable_names(given: Sequence[str] | None, n: int) -> tuple[str, ...]:
    """Names (n,) of variables: x for one, x1 .. xn for several, unless others are given.

    Raises:
        ArgumentError: Their number is not n, or two are the same.
    """
    if given is None:
        return ("x",) if n == 1 else tuple(f"x{i + 1}" for i in range(n))
    names = as_names(given) or ()
    if len(names) != n or len(set(names)) != n:
        message = f"{', '.join(names)}; expected {n} different names"
        raise ArgumentError(message, argument="variables")
    return names


def as_names(given: Sequence[str] | None) -> tuple[str, ...] | None:
    """Names as a tuple; one may stand alone, and None stays None."""
    if given is None:
        return None
    return (given,) if isinstance(given, str) else tuple(given)
