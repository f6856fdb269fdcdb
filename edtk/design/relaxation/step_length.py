"""How far a step of an interior point method may go."""

from edtk.system.typing import Array


def step_length(x: Array, dx: Array, most: float) -> float:
    """The length, at most one, of a step along dx (k,) from x (k,) above zero.

    Args:
        x: Positive numbers.
        dx: Their changes.
        most: Part of the way to the first zero that the step may go.
    """
    fastest = -(dx / x).min(initial=0.0)
    return float(min(1.0, most / fastest)) if fastest > 0 else 1.0
