"""What one restricted master problem has found."""

from dataclasses import dataclass

from edtk.design.relaxation.proof import Proof
from edtk.design.relaxation.warm_start import WarmStart
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Step:
    """One solved restricted master problem.

    Attributes:
        active: Indices (k,) of the candidates that carry weight.
        weights: Their weights (k,), positive, of sum one.
        M: Information matrix (p, p) of these weights.
        proof: The best proof of this and all earlier steps.
        solver: The solver that found the weights.
        last: All candidates of the problem, with weight or without, and the solver's multiplier.
    """

    active: Indices
    weights: Array
    M: Array
    proof: Proof
    solver: str
    last: WarmStart
