"""The result of a relaxation: weights of candidates with the proof of a bound."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Relaxable
from edtk.design.bound import VISIBLE, RelaxedDesign
from edtk.design.problem import Problem
from edtk.design.problems import DescribedProblem
from edtk.design.relaxation.proof import InnerProof, normalised
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.theta_box import WorstTheta


@dataclass(frozen=True, eq=False, kw_only=True)
class Relaxation(RelaxedDesign):
    """A relaxed design over the candidates of a problem, each with its weight (n,).

    Attributes:
        problem: The candidates; None where they are not kept.
        accuracy: Relative error that rounding may have made in cost and bound, see
            `proof.errors`.
        rests_on_solver: Whether the bound rests on a solver's word, as of a criterion without a
            dual form of its own; else closed forms prove it.
        inner: The multipliers with more digits, of a model whose parameters are nearly dependent.
        worst: Where in ranges of theta it is worst; None of a problem without any.
    """

    criterion: Relaxable
    problem: Problem | None = None
    accuracy: float = float("nan")
    rests_on_solver: bool = False
    inner: InnerProof | None = None
    worst: "WorstTheta | None" = None

    def headline(self) -> str:
        """Criterion, value, number of candidates with weight, gap, and what doubts there are."""
        proved = "gap by a solver's word" if self.rests_on_solver else "proved gap"
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.4g}, weights on {len(self.support)} of "
            f"{len(self.weights)} candidates, {proved} {self.gap:.1e}{digits}"
            f"{'' if self.worst is None else f', {self.worst}'}"
        )

    @property
    def support(self) -> Indices:
        """Indices (k,) of the candidates that carry weight."""
        return np.flatnonzero(self.weights != 0)

    @property
    def places(self) -> Indices:
        """The candidates of the support."""
        return self.support

    def to_frame(self) -> "pd.DataFrame":
        """The candidates that carry weight, in the order of the problem, with their weights.

        Candidates from a data frame are its rows; others are numbers from zero.
        """
        import pandas as pd

        if isinstance(self.problem, DescribedProblem):
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
