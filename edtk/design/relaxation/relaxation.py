"""The result of a relaxation: weights of candidates with the proof of a bound."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Relaxable
from edtk.design.bound import Bound, printed_form
from edtk.design.problem import Problem
from edtk.design.problems import FrameProblem
from edtk.design.relaxation.proof import InnerProof, normalised
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

VISIBLE = 1e-8  # a relative error above this is told beside the gap


@dataclass(frozen=True, eq=False)
class Relaxation(Presented):
    """Weights of one experiment's worth of measurements, their cost, and a bound with its proof.

    Attributes:
        criterion: What was minimised.
        weights: Shares (n,) of the candidates, not negative, of sum one.
        cost: The criterion's cost of these weights.
        proved_bound: No weights of these candidates have a lower cost.
        multipliers: The proof of the bound (r, p, p), see `Relaxable.lower_bound`.
        solver: The solver that found the weights.
        iterations: Number of restricted master problems that were solved.
        problem: The candidates; None where they are not kept.
        accuracy: Relative error that rounding may have made in cost and bound, see
            `relative_accuracy`.
        rests_on_solver: Whether the bound rests on a solver's word, as of a criterion without a
            dual form of its own; else closed forms prove it.
        inner: The multipliers with more digits, of a model whose parameters are nearly dependent.
    """

    criterion: Relaxable
    weights: Array
    cost: float
    proved_bound: Bound
    multipliers: Array
    solver: str
    iterations: int
    problem: Problem | None = None
    accuracy: float = float("nan")
    rests_on_solver: bool = False
    inner: InnerProof | None = None

    def headline(self) -> str:
        """Criterion, value, number of candidates with weight, gap, and what doubts there are."""
        proved = "gap by a solver's word" if self.rests_on_solver else "proved gap"
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.4g}, weights on {len(self.support)} of "
            f"{len(self.weights)} candidates, {proved} {self.gap:.1e}{digits}"
        )

    @property
    def value(self) -> float:
        """The criterion as its formula prints it."""
        return printed_form(self.cost, self.criterion.sense)

    @property
    def bound(self) -> float:
        """The proved bound as the criterion's formula prints it."""
        return self.proved_bound.value

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost``, never negative."""
        return self.proved_bound.gap_to(self.cost)

    @property
    def support(self) -> Indices:
        """Indices (k,) of the candidates that carry weight."""
        return np.flatnonzero(self.weights != 0)

    def to_frame(self) -> "pd.DataFrame":
        """The candidates that carry weight, in the order of the problem, with their weights.

        Candidates from a data frame are its rows; others are numbers from zero.
        """
        import pandas as pd

        if isinstance(self.problem, FrameProblem):
            return self.problem.to_frame(self.weights)
        index = pd.Index(self.support, name="candidate")
        return pd.DataFrame({"weight": self.weights[self.support]}, index=index)

    def to_dict(self) -> dict[str, Any]:
        """The certificate as plain data for JSON, which `edtk.verify` checks with the problem.

        Raises:
            ValueError: The relaxation does not hold its candidates.
        """
        from edtk.design.relaxation.certify import store  # it makes results of this kind

        if self.problem is None:
            raise ValueError("this relaxation does not hold its candidates; edtk.relax keeps them")
        return store(self, self.problem)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], problem: Problem) -> "Relaxation":
        """Restore what `to_dict` has written; cost and bound are computed anew.

        Args:
            data: The certificate.
            problem: Its candidates.

        Raises:
            ValueError: The candidates are others, or weights or multipliers do not fit them.
        """
        from edtk.design.relaxation.certify import restore  # it makes results of this kind

        return restore(data, problem)

    def sensitivities(self, problem: Problem) -> Array:
        """Sensitivities (r, n) of candidates to the multipliers, with all digits.

        By the equivalence theorem the candidates of an optimal design have the largest one. Of
        degree zero they are per trace.

        Args:
            problem: The candidates (n).
        """
        if self.inner is None:
            return normalised(problem, self.criterion).sensitivities(self.multipliers)
        inside = self.criterion.transformed(self.inner.T)
        assert inside is not None
        return normalised(problem.in_units(self.inner.T), inside).sensitivities(self.inner.Z)

    def certify(self, problem: Problem) -> tuple[float, float]:
        """Compute cost and bound anew from weights, multipliers and candidates alone.

        Args:
            problem: The candidates (n) of the weights.

        Returns:
            Cost of the weights, and a lower bound on the cost of all weights; zero where the
            multipliers prove none.

        Raises:
            ValueError: Weights or multipliers do not fit the problem, or are no such numbers.
        """
        from edtk.design.relaxation.certify import certify  # it makes results of this kind

        return certify(problem, self.criterion, self.weights, self.multipliers, self.inner)
