"""Candidate experiments: design variables side by side with their information."""

from dataclasses import dataclass

import numpy as np

from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate experiments and the information of one measurement in each.

    Attributes:
        x: Design variables (n, v).
        problem: Their information, in the same order.
    """

    x: Array
    problem: Problem

    def __getitem__(self, chosen: Indices) -> "Candidates":
        """The chosen candidates."""
        return Candidates(self.x[chosen], self.problem[chosen])

    def __add__(self, others: "Candidates") -> "Candidates":
        """These candidates, then others."""
        return Candidates(np.concatenate([self.x, others.x]), self.problem + others.problem)
