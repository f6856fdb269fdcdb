"""Criteria of combinations of the parameters that a person names: I, c and Ds."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria.criterion import Criterion
from criteria.interest import Interest
from criteria.linalg.logarithms import log_of_inverse
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, Relaxable

if TYPE_CHECKING:
    import cvxpy as cp

# Numbers by name: {k2 = 1, k3 = -1}.
BY_NAME = ("c",)
LISTED = ("interest",)  # a list of names: ["k2", "k3"]


def named_parameters(
    parameters: Mapping[str, Any], names: Sequence[str], kind: str = "parameter"
) -> dict[str, Any]:
    """Parameters of a criterion with arrays in place of names, those of its parts included.

    Args:
        parameters: As a person writes them.
        names: Names (p,) of what the model estimates.
        kind: What they are, for messages.

    Raises:
        ValueError: A name is not among them; the line lists them.
    """
    found = dict(parameters)
    for key in BY_NAME:
        factors = found.get(key)
        if isinstance(factors, Mapping):
            _require_known(factors, names, kind)
            found[key] = [factors.get(name, 0.0) for name in names]
    for key in LISTED:
        listed = found.get(key)
        if isinstance(listed, np.ndarray) and listed.dtype.kind in "OU":
            listed = listed.tolist()
        if isinstance(listed, list | tuple) and all(isinstance(name, str) for name in listed):
            _require_known(listed, names, kind)
            found[key] = np.array([[float(each == name) for name in listed] for each in names])
    if isinstance(found.get("criteria"), list | tuple):
        found["criteria"] = [
            named_parameters(part, names, kind) if isinstance(part, Mapping) else part
            for part in found["criteria"]
        ]
    return found


def _require_known(given: Any, names: Sequence[str], kind: str) -> None:
    for name in given:
        if name not in names:
            raise ValueError(f"{name!r} is no {kind}; expected {', '.join(names)}")


class NamedInterest(Interest):
    """An `Interest` whose class declares its name and all that an Interest takes from its base.

    The parameters' units do not matter: the combinations change with them, and their variances stay
    as they are.
    """

    needs_parameters = True
    unit_free = True
    expression_power = 1.0

    def _describe(self, base: Relaxable) -> None:
        """Its class says it all."""

    def require_order(self, p: int) -> None:
        """As every criterion: what is of interest is its own matter, and not that of `interest`."""
        Criterion.require_order(self, p)


class SumOfVariances(NamedInterest):
    """``trace(K' cov K)``, the sum of the variances of the combinations; the base of I and of c."""

    sense = "min"
    degree = 1.0

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``trace(K'T M^-1 T'K) / unit`` as a matrix-fractional function.

        It needs no variable for C_K, and allows a singular M whose range holds K.
        """
        import cvxpy as cp

        return cp.matrix_frac(T.T @ self.K * unit**-0.5, M), [total == 1]

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """``-log(trace(K'T M^-1 T'K) / unit)``."""
        return log_of_inverse(M, self.K.T @ T, unit)
