"""The end of a path of steps towards a program's conditions of optimality."""

from typing import Protocol, Self, TypeVar

import numpy as np

STEPS = 60


class Point(Protocol):
    """A point of such a path."""

    @property
    def error(self) -> float:
        """How far the conditions are from holding."""
        ...

    def step(self) -> Self | None:
        """The next point; None where no step leads nearer."""
        ...


P = TypeVar("P", bound=Point)


def nearest_point(first: P, accuracy: float) -> P:
    """The point of the least error among those of the path, which ends below an accuracy."""
    point = first
    best = first
    for _ in range(STEPS):
        if best.error <= accuracy:
            break
        try:
            step = point.step()
        except np.linalg.LinAlgError:
            # Where matrices are singular to rounding, the answer is as good as it can be.
            break
        if step is None:
            break
        point = step
        best = point if point.error < best.error else best
    return best
