"""A function of many points that a user wrote, whose answers are checked."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.errors import ArgumentError
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class UserFunction:
    """A function of points (n, d), with one value or array of values for each.

    Args:
        function: The function.
        name: The argument by which it came, for messages.
    """

    function: Callable[[Array], ArrayLike]
    name: str

    def __call__(self, x: Array, shape: tuple[int, ...] | None = None) -> Array:
        """Values (n, ...) at points (n, d), which may be not finite.

        Args:
            x: The points.
            shape: Shape of the values of one point; None for any.

        Raises:
            ArgumentError: The function fails, or its values have another shape.
        """
        try:
            with np.errstate(all="ignore"):  # what is not finite is judged by the caller
                values = np.asarray(self.function(x.copy()))
                if np.iscomplexobj(values):
                    raise TypeError("values are complex; expected real ones")
                values = values.astype(float)
        except (TypeError, ValueError, IndexError) as error:
            message = f"fails for points of shape {x.shape}: {error}"
            raise ArgumentError(message, argument=self.name) from error
        if values.shape[:1] != (len(x),) or (shape is not None and values.shape[1:] != shape):
            expected = "one entry a point" if shape is None else f"{(len(x), *shape)}"
            raise self.wrong_shape(values, f"{expected} for {len(x)} points")
        return values

    def wrong_shape(self, values: Array, expected: str) -> ArgumentError:
        """The error of values of a wrong shape."""
        message = f"values have the shape {values.shape}; expected {expected}"
        return ArgumentError(message, argument=self.name)


def user_functions(given: object, name: str) -> tuple[UserFunction, ...]:
    """One function or a list of them.

    Raises:
        ArgumentError: It is neither.
    """
    each = [given] if callable(given) or not isinstance(given, Iterable) else list(given)
    functions = [function for function in each if callable(function)]
    if len(functions) < len(each):
        raise ArgumentError("expected a function of points, or a list of them", argument=name)
    return tuple(UserFunction(function, name) for function in functions)
