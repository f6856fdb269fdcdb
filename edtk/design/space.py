"""What descents and ascents ask of a design space, whether a robot is behind it or a function."""

from typing import Protocol

from edtk.system.typing import Array, Mask


class Space(Protocol):
    """A feasible set of experiments: bounds of its variables, and what an experiment tells."""

    @property
    def limits(self) -> Array:
        """Bounds (2, v) of the design variables."""

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change."""

    @property
    def prior(self) -> Array | None:
        """Prior information M0 (p, p) per single experiment, or None."""

    def at(self, x: Array) -> "Points":
        """The experiments of design variables x (..., v)."""


class Points(Protocol):
    """Experiments x (..., v) of a design space: information, slacks, and their derivatives."""

    @property
    def space(self) -> Space:
        """Where the experiments lie."""

    @property
    def x(self) -> Array:
        """Design variables (..., v)."""

    @property
    def regressor(self) -> Array:
        """Whitened rows (..., rows, p)."""

    @property
    def packed(self) -> Array:
        """Information of one measurement each (p(p+1)/2, ...), without the prior."""

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints other than the bounds; negative means infeasible."""

    @property
    def slack_gradient(self) -> Array:
        """Derivatives (..., c, v) of the slacks."""

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) satisfies all constraints, the bounds included."""

    def visited(self, visits: Array) -> "Points":
        """The same experiments, whose repeats may share an error."""

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p) of plans (b, k), the prior included."""

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v) of ``<B, A>`` of the whitened rows A, weights B held fixed."""
