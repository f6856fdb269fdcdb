"""What is bounded over a box: quotients of polynomials, and where they count."""

from dataclasses import dataclass

import numpy as np

from edtk.design.enclosure.boxes import Grid, limits_on
from edtk.design.enclosure.polynomial import Axis, Polynomial
from edtk.system.typing import Array

# Levels above the largest known value, of which the next one is reached from the leaves of the
# last, whose coefficients are made anew: a tenth of the gap takes twice the boxes, or fewer.
FIRST_LEVEL = 0.3
NEXT_LEVEL = 0.1
# Where D is small in a box, a quotient's leaf says little of another level, at which all leaves are
# looked at anew: there are fewer levels.
OF_QUOTIENT = (0.03, 0.01)


@dataclass(frozen=True, eq=False)
class Objective:
    """``N/D``, whose largest value in the box is to be bounded.

    Args:
        numerator: Any polynomial.
        denominator: One that is positive in the box; None for one.
    """

    numerator: Polynomial
    denominator: Polynomial | None = None

    def __call__(self, places: Array) -> Array:
        """Values (m,) at places (m, d)."""
        above = self.numerator(places)
        return above if self.denominator is None else above / self.denominator(places)

    def plus(self, constant: float) -> "Objective":
        """The objective and a number: ``N/D + c`` as ``(N + c D)/D``."""
        if self.denominator is None:
            return Objective(self.numerator + constant)
        return Objective(self.numerator + constant * self.denominator, self.denominator)

    def tested(self, level: float) -> Polynomial:
        """``N - u D``, at most zero where the objective is at most u."""
        D = self.denominator
        return self.numerator - (level if D is None else level * D)

    @property
    def forms(self) -> tuple[Polynomial, ...]:
        """What `weights` add to `tested` on each box; none, where that is all."""
        return ()

    def weights(self, level: float, low: Array, high: Array) -> tuple[Array, Array, Array]:
        """On boxes, what is to be at most zero: `tested`, and `forms`, in these parts.

        Args:
            level: The level u.
            low: Lower bounds of the forms (forms, b) on each box.
            high: Upper bounds of the first one (b,).

        Returns:
            Factors (1 + forms, b) of `tested` and of the forms, constants (b,), and by how much
            these may be off by rounding (b,).
        """
        del level, low
        nothing = np.zeros_like(high)
        return np.ones_like(high)[None], nothing, nothing

    def scale(self, grid: Grid) -> tuple[float, float]:
        """A lower and an upper bound of D over a grid's boxes."""
        return (1.0, 1.0) if self.denominator is None else limits_on(self.denominator, grid)

    def most(self, grid: Grid) -> float:
        """What no place of a grid's boxes has an objective above."""
        least, most = self.scale(grid)
        if least <= 0:
            return np.inf
        bound = limits_on(self.numerator, grid)[1]
        return bound / (least if bound > 0 else most)

    @property
    def levels(self) -> tuple[float, float]:
        """The first level above the largest known value, and the next one in parts of it."""
        return (FIRST_LEVEL, NEXT_LEVEL) if self.denominator is None else OF_QUOTIENT

    @property
    def unit(self) -> float:
        """What N is in parts of."""
        return 1.0


@dataclass(frozen=True, eq=False)
class Enclosed:
    """A maximum over a box, and over what constraints leave of it, in polynomials.

    Args:
        axes: Variables t (d,) and their intervals.
        objectives: The largest value of any of them, anywhere, is to be bounded.
        slacks: A place is feasible where none is negative; errors of theirs count for feasible.
        base: Design variables x (k, v) of each objective where all t are zero.
        matrix: How x depends on t (v, d).
        left_out: Constraints that are not among the slacks, by name: a bound holds without them.
    """

    axes: tuple[Axis, ...]
    objectives: tuple[Objective, ...]
    slacks: tuple[Polynomial, ...]
    base: Array
    matrix: Array
    left_out: tuple[str, ...] = ()

    def experiments(self, places: Array, objective: int = 0) -> Array:
        """Design variables x (m, v) of places t (m, d)."""
        return self.base[objective] + places @ self.matrix.T
