"""The step of an interior point method for criteria of extreme eigenvalues."""

from dataclasses import dataclass

from edtk.design.relaxation.scaling import Scaling
from edtk.design.relaxation.step_length import step_length
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class SpectralDirection:
    """Changes of weights, the upper bound, slacks, and the inequalities and their duals.

    Attributes:
        w: Changes of the weights (k,).
        kappa: Change of the upper bound.
        v: Changes of the slacks (k,).
        X: Changes of the inequalities (c, p, p), in the scaled parameters.
        S: Changes of their duals (c, p, p), likewise.
    """

    w: Array
    kappa: float
    v: Array
    X: Array
    S: Array

    def lengths(self, w: Array, v: Array, scaling: Scaling, most: float) -> tuple[float, float]:
        """How far primal and dual may go, from weights w, slacks v and inequalities inside."""
        primal, dual = scaling.lengths(self.X, self.S, most)
        return min(step_length(w, self.w, most), primal), min(step_length(v, self.v, most), dual)
