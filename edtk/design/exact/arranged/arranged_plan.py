"""A plan of runs in order, whose errors have a structure."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import printed
from edtk.design.bound import HEADLINE, VISIBLE
from edtk.design.errors import RunErrors
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.exact.counts.problem_plan import PlanOrder, Transition


@dataclass(frozen=True, eq=False, kw_only=True)
class ArrangedPlan(ProblemPlan):
    """The best plan of runs in order that a search has found, under generalised least squares.

    Attributes:
        places: The candidate (m,) of each run, in order.
        structure: The structure of the errors of the runs, with their covariance and precision.
    """

    places: Indices
    structure: RunErrors

    def headline(self) -> str:
        """Criterion, value, size, structure of errors and efficiency."""
        value = printed(self.criterion, self.value, digits=HEADLINE)
        words = self.structure.errors.headline()
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {value} with {self.size} runs in {words}, "
            f"{self._bounded}{digits}"
        )

    @property
    def experiments(self) -> Indices:
        """Indices (m,) of the candidates, in the order of the runs."""
        return self.places

    def order(self, transition: "Transition", begin: int | None = None) -> "PlanOrder":
        """Refused: the errors of the runs depend on their order, which the plan has.

        Raises:
            UserError: Always.
        """
        raise UserError("the order of the runs is part of a plan with a structure of errors")

    @property
    def groups(self) -> dict[str, Indices]:
        """The group (m,) of each run by the name of its stratum, counted from 1."""
        strata = self.structure.errors.levels
        pairs = zip(strata, self.structure.labels, strict=True)
        return {stratum.name: labels + 1 for stratum, labels in pairs}

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of generalised least squares, the prior included."""
        M = self.turned.T @ self.turned
        return M if self.problem.prior is None else M + self.size * self.problem.prior

    @property
    def turned(self) -> Array:
        """Rows (m r, p) of all runs, whitened: their squares are what the runs tell."""
        return self.turn(self.problem.factors(self.places))

    def turn(self, rows: Array) -> Array:
        """Rows (m r, q), whitened, of rows (m, r, q) of the runs."""
        m, r, q = rows.shape
        turned = self.structure.whitening @ rows.reshape(m, r * q)
        return np.asarray(turned.reshape(m * r, q))

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a run a row, in order: the groups that it is in, and its settings.

        The index counts the runs from 1. Candidates from a data frame have its columns; others are
        numbers from zero.
        """
        import pandas as pd

        settings = self.problem.settings(self.places)
        taken = set(map(str, settings.columns))
        for i, (name, labels) in enumerate(self.groups.items()):
            column = name
            while column in taken:
                column += "_"
            settings.insert(i, column, labels)
        settings.index = pd.RangeIndex(1, self.size + 1, name="run")
        return settings
