"""The weighted least-squares inverse of measurements, with a prior or without."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

ROUNDING = 1e-9  # of a column, which others leave of it if they make the same readings


@dataclass(frozen=True, eq=False)
class LeastSquaresInverse:
    """How estimates change with measurements: ``dk = A+ change``.

    Attributes:
        whitened: The factored regressors of the measurements, and of a prior below them.
        prior: The prior; None for none.
        count: Number of measurements.
    """

    whitened: Whitened
    prior: PriorRows | None
    count: int

    @classmethod
    def of(
        cls, model: ElastostaticModel, data: Measurements, A: Array, prior: PriorRows | None = None
    ) -> "LeastSquaresInverse":
        """Factor the regressors A (m, rows, p) of measurements.

        Raises:
            SingularPlanError: Measurements and prior leave a parameter open.
        """
        noise = data.noise
        if prior is not None:
            noise = prior.noise_below(noise, A.shape[1])
            A = prior.below(A)
        return cls(Whitened.of(A, noise, model.parameters), prior, len(data))

    def solve(self, change: Array) -> Array:
        """Changes (..., p) of the estimates by changes (..., m, rows) of measurements."""
        below = change if self.prior is None else self.prior.zeros_below(change)
        return self.whitened.solve(below)

    def told(self, column: Array) -> float:
        """With which std a further parameter of this column (m, rows) would be told; may be inf."""
        below = column if self.prior is None else self.prior.zeros_below(column)
        left = float(np.linalg.norm(self.whitened.residual(below)))
        whole = float(np.linalg.norm(self.whitened.in_sigma(below)))
        return 1 / left if left > ROUNDING * whole else np.inf

    def shifts(self, changes: Array) -> Array:
        """Shifts (p, c) of the estimates by c changes (m, rows, c) of measurements."""
        return self.solve(np.moveaxis(changes, -1, 0)).T

    def by_reading(self) -> Array:
        """``W' Q`` (m, rows, p): what a unit of each measured coordinate adds to ``Q' W dp``."""
        return self.whitened.by_reading()[: self.count]
